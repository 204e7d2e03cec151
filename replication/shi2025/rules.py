"""The rules for the claims A1 to A12 of Shi et al. (2025)."""

from __future__ import annotations

import math

from replication.rules import (
    HALF,
    Interpretation,
    Part,
    Rule,
    among_single_runs,
    reduction,
    within_factor,
    within_tenth,
)
from replication.shi2025.interpretations import (
    A3_OTHERS,
    ABSOLUTE_OTHERS_2,
    ABSOLUTE_OTHERS_3,
    BEST,
    COMMON_WORDS,
    IMPLIED,
    IMPLIED_WORDS,
    MAIN_2,
    MAIN_3,
    ORBITS,
    OTHERS_2,
    OTHERS_3,
    R_MEAN,
    REST,
    SAME,
    SWEEP_MAIN,
    SWEEP_OTHERS,
    TIME,
    V_MEAN,
)

_A3_PARTS = (
    within_factor(
        Part("EKF's time", "median", ("ekf",), TIME, "s", published=18.0),
    ),
    Part(
        "UKF's time over alpha filter's",
        "ratio of medians",
        ("ukf",),
        TIME,
        "1",
        ("alpha_kf",),
        published=240 / 21,
        # Half of it on the scale where such ratios live, the logarithm.
        at_least=math.sqrt(240 / 21),
    ),
    within_factor(Part("alpha filter's over EKF's", "ratio of medians", ("alpha_kf",), TIME, "1", ("ekf",), 21 / 18)),
)
# The paper's own margin in its Table 4: 6.947 m at alpha = 0.05, 7.077 m at 0.01.
_A6_PARTS = (
    Part(
        "mean position error below that at the best other alpha",
        "margin",
        BEST,
        R_MEAN,
        "%",
        REST,
        published=100 * (1 - 6.947 / 7.077),
        at_least=HALF * 100 * (1 - 6.947 / 7.077),
    ),
)
_A10_PARTS = tuple(
    Part(
        f"share of outliers, {what}, below that at the best other alpha",
        "margin",
        BEST,
        column,
        "%",
        REST,
        at_least=0.0,
    )
    for what, column in (("position", "outliers_r"), ("velocity", "outliers_v"))
)
_LABELS = {"ekf": "EKF", "ukf": "UKF", "alpha_kf": "alpha filter"}


RULES = (
    Rule(
        "A1",
        "The mean over time (t >= 500 s) of the position error, averaged over runs, is lower for the alpha filter "
        "than for the EKF and for the UKF by at least half the published percentage: both 95 % intervals of the "
        "reduction lie wholly above it.",
        (
            reduction("alpha_kf", "ekf", R_MEAN, 74.6, "below the EKF's"),
            reduction("alpha_kf", "ukf", R_MEAN, 56.7, "below the UKF's"),
        ),
        MAIN_2,
        OTHERS_2,
    ),
    Rule(
        "A2",
        "As A1, for the velocity error.",
        (
            reduction("alpha_kf", "ekf", V_MEAN, 47.8, "below the EKF's"),
            reduction("alpha_kf", "ukf", V_MEAN, 40.0, "below the UKF's"),
        ),
        MAIN_2,
        OTHERS_2,
    ),
    Rule(
        "A3",
        "Converged: the position error stays for 50 s below three times its steady-state RMS. The EKF's median time "
        "over runs is 18 s within a factor of two; the UKF takes at least sqrt(240/21) = 3.4 times as long as the "
        "alpha filter; the alpha filter's time over the EKF's is 21/18 within a factor of two.",
        _A3_PARTS,
        MAIN_2,
        A3_OTHERS,
    ),
    Rule(
        "A4",
        "As A1, with mixture noise.",
        (
            reduction("alpha_kf", "ekf", R_MEAN, 34.5, "below the EKF's"),
            reduction("alpha_kf", "ukf", R_MEAN, 36.0, "below the UKF's"),
        ),
        MAIN_3,
        OTHERS_3,
    ),
    Rule(
        "A5",
        "With mixture noise the alpha filter's mean velocity error is below the EKF's by at least half of 4.3 %, "
        "and above the UKF's by at least half of 0.007 m/s.",
        (
            reduction("alpha_kf", "ekf", V_MEAN, 4.3, "below the EKF's"),
            Part(
                "above the UKF's",
                "difference",
                ("alpha_kf",),
                V_MEAN,
                "m/s",
                ("ukf",),
                published=0.007,
                at_least=HALF * 0.007,
            ),
        ),
        MAIN_3,
        OTHERS_3,
    ),
    Rule(
        "A6",
        "With mixture noise and 0.05 deg of bias, the mean position error at the better of alpha = 0.05 and 0.1 is "
        "below that at every other alpha of Table 4 by at least half of the paper's own margin of 1.8 %, on the same "
        "runs.",
        _A6_PARTS,
        SWEEP_MAIN,
        SWEEP_OTHERS,
    ),
    Rule(
        "A7",
        "Floating-point operations of one prediction and update, counted by formula: the alpha filter needs fewer "
        "than the EKF and fewer than the UKF.",
        tuple(
            Part(
                f"times the {name.upper()}'s operations",
                "operations",
                ("alpha_kf",),
                "",
                "1",
                (name,),
                at_most=1.0,
            )
            for name in ("ekf", "ukf")
        ),
        (Interpretation("10000 samples", "with 10000 samples", samples=10000),),
        (
            Interpretation("256 samples", "with 256 samples", samples=256),
            Interpretation("13 samples", "with as many samples as the UKF has sigma points", samples=13),
        ),
    ),
    Rule(
        "A8",
        "The three mean position errors printed in Table 2 lie within two standard deviations of the mean errors of "
        "our single runs (t >= 500 s).",
        tuple(
            among_single_runs(role, R_MEAN, printed, f"printed {printed:g} m, from our mean")
            for role, printed in (("ekf", 2.623), ("ukf", 1.541), ("alpha_kf", 0.667))
        ),
        (Interpretation("common", COMMON_WORDS, "alpha_kf_gaussian", SAME),),
        ABSOLUTE_OTHERS_2,
    ),
    Rule(
        "A9",
        "As A8, for the two numbers of the abstract, with mixture noise.",
        tuple(
            among_single_runs("alpha_kf", column, printed, f"printed {printed:g} {unit}, from our mean")
            for column, printed, unit in ((R_MEAN, 1.813, "m"), (V_MEAN, 0.022, "m/s"))
        ),
        (Interpretation("common", COMMON_WORDS, "alpha_kf_mixture", SAME),),
        ABSOLUTE_OTHERS_3,
    ),
    Rule(
        "A10",
        "The share of the steady state that a box plot draws as outliers (beyond 1.5 interquartile ranges) is lower "
        "at the better of alpha = 0.05 and 0.1 than at every other alpha, for position and velocity, on the same runs.",
        _A10_PARTS,
        SWEEP_MAIN,
        SWEEP_OTHERS,
    ),
    Rule(
        "A11",
        "The sinusoid that, beside a line, fits a run's radial velocity error best (t >= 500 s) has a period of 3500 s "
        "within a tenth, in the mean over runs, for each filter.",
        tuple(
            within_tenth(Part(f"period, {_LABELS[role]}", "value", (role,), "wave_period_s", "s", published=3500.0))
            for role in _LABELS
        ),
        (Interpretation("common", COMMON_WORDS, "alpha_kf_gaussian", SAME),),
        (Interpretation("implied", IMPLIED_WORDS, "alpha_kf_gaussian", IMPLIED), *ORBITS),
    ),
    Rule(
        "A12",
        "The formal position sigma after 100 s is at most half of that at the first fix, for each filter. The paper "
        "prints no number.",
        tuple(
            Part(
                f"formal sigma, last over first, {_LABELS[role]}",
                "value",
                (role,),
                "sigma_r_ratio",
                "1",
                at_most=HALF,
            )
            for role in _LABELS
        ),
        (Interpretation("common", COMMON_WORDS, "alpha_kf_start", SAME),),
    ),
)
