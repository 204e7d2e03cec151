"""The rules for the claims B1 to B4 of Wei, Song and Zhang (2012)."""

from __future__ import annotations

from replication.rules import Part, Reading, Rule, within_factor

LEARNED, UNSCENTED, SIZES = "mf_upf_particles", "mf_upf", "mf_upf_size"
_TARGETS = (
    ("difference", "if it learns the difference of successive states"),
    ("residual", "if it learns what the Clohessy-Wiltshire equations leave over"),
)
_KINDS = {
    "gp_particle": "",
    "mf_upf": "with an unscented filter for each particle, ",
    "gp_ukf": "with an unscented filter instead of particles, ",
}
_AS_PRINTED = Reading(
    "as printed",
    "with the algorithm as printed: a Gaussian process for the next state, trained on the truth",
    LEARNED,
    {"filter": "gp_particle_absolute_truth"},
)
_VARIANTS = (
    *(
        Reading(
            f"{kind}, {target}, {source}",
            f"{_KINDS[kind]}{words}, trained on "
            f"{'the truth' if source == 'truth' else 'a smoothed track of its own radar'}",
            UNSCENTED if kind == "gp_ukf" else LEARNED,
            {"filter": f"{kind}_{target}_{source}"},
        )
        for kind in ("gp_particle", "mf_upf", "gp_ukf")
        for target, words in (("absolute", "if it learns the next state"), *_TARGETS)
        for source in ("truth", "radar")
        if (kind, target, source) != ("gp_particle", "absolute", "truth")
    ),
)
SECOND, TEN_SECONDS = {"clock.step_s": 1}, {"clock.step_s": 10}
_SIZES = tuple(
    Reading(f"{name}, {what}", f"{words} and {more}", SIZES, {"filter": f"{filter}_{particles}"}, case)
    for name, words, filter in (
        ("as printed", "with the algorithm as printed", "gp_particle_absolute_truth"),
        (
            "mf_upf, absolute, truth",
            "with an unscented filter for each particle, if it learns the next state, trained on the truth,",
            "mf_upf_absolute_truth",
        ),
    )
    for what, more, particles, case in (
        ("50 particles", "50 particles", 50, SECOND),
        ("10 s", "100 particles, a measurement every 10 s", 100, TEN_SECONDS),
    )
)
DEPLETION = "mf_upf_depletion"
USUAL = {"clock.step_s": 1, "start.position_sigma_m": 10}
SLOW = {"clock.step_s": 10}
PERFECT = {"start.position_sigma_m": 0.001}
_PF = Reading("paper's Q", "with the paper's Q and 500 particles", DEPLETION, {"filter": "pf"}, USUAL)
_PF_OTHERS = (
    Reading("tuned Q", "with a tuned Q", DEPLETION, {"filter": "pf_tuned"}, USUAL),
    Reading("100 particles", "with 100 particles", DEPLETION, {"filter": "pf_100"}, USUAL),
    Reading("50 particles", "with 50 particles", DEPLETION, {"filter": "pf_50"}, USUAL),
    Reading("10 s", "with a measurement every 10 s", DEPLETION, {"filter": "pf"}, SLOW),
    Reading("perfect start", "from a perfect start", DEPLETION, {"filter": "pf"}, PERFECT),
    Reading("open loop", "without any measurement, from a perfect start", DEPLETION, {"filter": "open_loop"}, PERFECT),
)

RULES = (
    Rule(
        "B1",
        "After 1000 s the position error stays below 0.5 m for 95 % of the time: the mean over runs of each run's "
        "95 % quantile, its whole 95 % interval, is below 0.5 m.",
        (
            Part(
                "95 % quantile over time of the position error",
                "value",
                ("filter",),
                "settled_r_p95_m",
                "m",
                published=0.5,
                at_most=0.5,
            ),
        ),
        (_AS_PRINTED,),
        (*_VARIANTS, *_SIZES),
    ),
    Rule(
        "B2",
        "As B1, for the velocity error and 0.001 m/s.",
        (
            Part(
                "95 % quantile over time of the velocity error",
                "value",
                ("filter",),
                "settled_v_p95_m_s",
                "m/s",
                published=0.001,
                at_most=0.001,
            ),
        ),
        (_AS_PRINTED,),
        (*_VARIANTS, *_SIZES),
    ),
    Rule(
        "B3",
        "The largest position error of each run after 1000 s, averaged over runs, is 5 m within a factor of two.",
        (
            within_factor(
                Part("largest position error after 1000 s", "value", ("filter",), "settled_r_max_m", "m", published=5.0)
            ),
        ),
        (_PF,),
        _PF_OTHERS,
    ),
    Rule(
        "B4",
        "The RMS over time (after 1000 s) of the velocity error, averaged over runs, is 0.01 m/s within a factor of "
        "two.",
        (
            within_factor(
                Part(
                    "RMS velocity error after 1000 s", "value", ("filter",), "settled_v_rms_m_s", "m/s", published=0.01
                )
            ),
        ),
        (_PF,),
        _PF_OTHERS,
    ),
)
