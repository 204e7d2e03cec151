"""The rules for the claims B1 to B6 of Wei, Song and Zhang (2012)."""

from __future__ import annotations

from dataclasses import replace

from replication.rules import HALF, Interpretation, Part, Rule, reduction, within_factor

LEARNED, UNSCENTED, SIZES = "mf_upf_particles", "mf_upf", "mf_upf_size"
_TARGETS = (
    ("difference", "if it learns the difference of successive states"),
    ("residual", "if it learns the residual of the Clohessy-Wiltshire equations"),
)
_KINDS = {
    "gp_particle": "",
    "mf_upf": "with an unscented filter for each particle, ",
    "gp_ukf": "with an unscented filter instead of particles, ",
}
_AS_PRINTED = Interpretation(
    "as printed",
    "with the algorithm as printed: a Gaussian process for the next state, trained on the truth",
    LEARNED,
    {"filter": "gp_particle_absolute_truth"},
)
_VARIANTS = (
    *(
        Interpretation(
            f"{kind}, {target}, {source}",
            f"{_KINDS[kind]}{words}, trained on "
            f"{'the truth' if source == 'truth' else 'a smoothed track of its own radar'}",
            UNSCENTED if kind == "gp_ukf" else LEARNED,
            {"filter": f"{kind}_{target}_{source}"},
            family=words,
        )
        for kind in ("gp_particle", "mf_upf", "gp_ukf")
        for target, words in (("absolute", "if it learns the next state"), *_TARGETS)
        for source in ("truth", "radar")
        if (kind, target, source) != ("gp_particle", "absolute", "truth")
    ),
)
SECOND, TEN_SECONDS = {"clock.step_s": 1}, {"clock.step_s": 10}
_SIZES = tuple(
    Interpretation(
        f"{name}, {what}",
        f"{words} and {more}",
        SIZES,
        {"filter": f"{filter}_{particles}"},
        case,
        family="with fewer particles or measurements",
    )
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
_PF = Interpretation("paper's Q", "with the paper's Q and 500 particles", DEPLETION, {"filter": "pf"}, USUAL)
_PF_OTHERS = (
    Interpretation("tuned Q", "with a tuned Q", DEPLETION, {"filter": "pf_tuned"}, USUAL),
    Interpretation("100 particles", "with 100 particles", DEPLETION, {"filter": "pf_100"}, USUAL),
    Interpretation("50 particles", "with 50 particles", DEPLETION, {"filter": "pf_50"}, USUAL),
    Interpretation("2000 particles", "with 2000 particles", DEPLETION, {"filter": "pf_2000"}, USUAL),
    Interpretation("roughened", "with roughening", DEPLETION, {"filter": "pf_roughened"}, USUAL),
    Interpretation("10 s", "with a measurement every 10 s", DEPLETION, {"filter": "pf"}, SLOW),
    Interpretation("perfect start", "from a perfect start", DEPLETION, {"filter": "pf"}, PERFECT),
    Interpretation(
        "open loop", "if no measurement is used after a perfect start", DEPLETION, {"filter": "open_loop"}, PERFECT
    ),
)
_AGAINST = {"filter": "gp_particle_absolute_truth"}
_DEPLETED = Interpretation(
    "depleted", "against a particle filter without roughening", LEARNED, {**_AGAINST, "pf": "pf_no_roughening"}
)
_ROUGHENED = Interpretation(
    "roughened", "against the same particle filter with roughening", LEARNED, {**_AGAINST, "pf": "pf"}
)
_EKF = Interpretation("ekf", "against an EKF with the same Q", LEARNED, {**_AGAINST, "pf": "ekf_paper_q"})
_UNSCENTED_KIND = {"filter": "mf_upf_absolute_truth"}


def _persistent(column: str) -> Part:
    return Part("RMS over that of 1000-2000 s", "value", ("filter",), column, "1", at_least=HALF)


RULES = (
    Rule(
        "B1",
        "After 1000 s the position error stays below 0.5 m for 95 % of the time: the mean over runs of each run's "
        "95 % quantile, its whole 95 % interval, is below 0.5 m.",
        (
            Part(
                "95 % of the time below",
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
                "95 % of the time below",
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
        "The largest position error of 4000-6000 s, averaged over runs, is 5 m within a factor of two, and the "
        "oscillation persists: the RMS of 4000-6000 s is at least half of that of 1000-2000 s.",
        (
            within_factor(
                Part(
                    "largest",
                    "value",
                    ("filter",),
                    "r_max_from_4000_m",
                    "m",
                    published=5.0,
                )
            ),
            _persistent("r_persistence"),
        ),
        (_PF,),
        _PF_OTHERS,
        "4000–6000 s",
    ),
    Rule(
        "B4",
        "The RMS velocity error of 4000-6000 s, averaged over runs, is 0.01 m/s within a factor of two, and it "
        "persists: at least half of that of 1000-2000 s.",
        (
            within_factor(Part("RMS", "value", ("filter",), "v_rms_late_m_s", "m/s", published=0.01)),
            _persistent("v_persistence"),
        ),
        (_PF,),
        _PF_OTHERS,
        "4000–6000 s",
    ),
    Rule(
        "B5",
        "After 1000 s the RMS position error of the model-free filter is below the particle filter's by at least half "
        "of the published 90 % (0.5 m against 5 m), whether or not the particle filter is roughened.",
        (reduction("filter", "pf", "settled_r_rms_m", 90.0, "below the particle filter's"),),
        (_DEPLETED, _ROUGHENED),
        (
            _EKF,
            *(
                replace(
                    item,
                    name=f"unscented, {item.name}",
                    words=f"with an unscented filter for each particle, {item.words}",
                    filters={**item.filters, **_UNSCENTED_KIND},
                )
                for item in (_DEPLETED, _ROUGHENED, _EKF)
            ),
        ),
    ),
    Rule(
        "B6",
        "The RMS position error of the particle filter after 1000 s, averaged over runs, is 1 m within a factor of "
        "two.",
        (within_factor(Part("RMS", "value", ("filter",), "settled_r_rms_m", "m", published=1.0)),),
        (_PF,),
        _PF_OTHERS,
    ),
)
