"""The rules for the claims B1 to B4 of Wei, Song and Zhang (2012)."""

from __future__ import annotations

from relnav_sim.replication.rules import Part, Reading, Rule, within_factor

_LEARNED = (
    ("difference", "if it learns the difference of successive states"),
    ("residual", "if it learns what the Clohessy-Wiltshire equations leave over"),
)
_AS_PRINTED = Reading(
    "as printed",
    "with the algorithm as printed: a Gaussian process for the next state, trained on the truth",
    "mf_upf",
    {"filter": "gp_particle_absolute_truth"},
)
_VARIANTS = (
    *(
        Reading(
            f"{target}, {source}",
            f"{words}, trained on {'the truth' if source == 'truth' else 'a smoothed track of its own radar'}",
            "mf_upf",
            {"filter": f"{kind}_{target}_{source}"},
        )
        for kind in ("gp_particle", "mf_upf")
        for target, words in (("absolute", "if it learns the next state"), *_LEARNED)
        for source in ("truth", "radar")
        if (kind, target, source) != ("gp_particle", "absolute", "truth")
    ),
)
_PF = Reading("paper's Q", "with the paper's Q and 500 particles", "mf_upf", {"filter": "pf"})
_PF_OTHERS = (
    Reading("tuned Q", "with a tuned Q", "mf_upf", {"filter": "pf_tuned"}),
    Reading("100 particles", "with 100 particles", "mf_upf_sensitivity", {"filter": "pf_100"}),
    Reading("50 particles", "with 50 particles", "mf_upf_sensitivity", {"filter": "pf_50"}),
)

RULES = (
    Rule(
        "B1",
        "After 1000 s the position error stays below 0.5 m for 95 % of the time: the mean over runs of each run's 95 % "
        "quantile, its whole 95 % interval, is below 0.5 m.",
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
        _VARIANTS,
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
        _VARIANTS,
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
