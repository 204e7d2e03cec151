"""The rules for the claims C1 and C2 of Liu et al. (2011)."""

from __future__ import annotations

from replication.rules import Part, Reading, Rule

WIDE_M, PRIORS_M = 200, (1, 10, 50, 200)
QUICK_S = 60.0


def prior(sigma_m: float) -> dict[str, object]:
    """Return what picks the case with this start error."""
    return {"start": {"kind": "dispersed", "position_sigma_m": sigma_m}}


def _prior(sigma_m: float, filters: dict[str, str], words: str = "") -> Reading:
    return Reading(
        f"{sigma_m:g} m{words and ', ' + words}",
        f"with a start error of {sigma_m:g} m (1 sigma){words and ' and ' + words}",
        "two_step",
        filters,
        prior(sigma_m),
    )


_STARTS = {"two_step": "two_step_unscented", "arbitrary": "two_step_linearised"}
_FILTERS = {"two_step": "two_step_unscented", "ekf": "ekf", "ukf": "ukf"}

RULES = (
    Rule(
        "C1",
        "Converged: the position error stays below 1 m for 10 s, from 60 s at the latest, from start errors of 200 "
        "m and 0.3 m/s. With the unscented start at least 95 % of the runs have converged (the 95 % interval's "
        "lower end above 90 %), and at least half of all runs more than from the linearised covariance F P F^T.",
        (
            Part(
                "share of runs that converge with the unscented start",
                "share",
                ("two_step",),
                "convergence_s",
                "1",
                at_least=0.9,
                within=QUICK_S,
            ),
            Part(
                "that share less the one with the linearised start",
                "share",
                ("two_step",),
                "convergence_s",
                "1",
                ("arbitrary",),
                at_least=0.5,
                within=QUICK_S,
            ),
        ),
        (_prior(WIDE_M, _STARTS),),
        (
            *(_prior(sigma, _STARTS) for sigma in PRIORS_M if sigma != WIDE_M),
            _prior(WIDE_M, {**_STARTS, "arbitrary": "two_step_tight"}, "next to no slack"),
            _prior(WIDE_M, {**_STARTS, "arbitrary": "two_step_loose"}, "a slack far too large"),
        ),
    ),
    Rule(
        "C2",
        "From start errors of 200 m and 0.3 m/s, the RMS position error over the whole run is below the EKF's and "
        "below the UKF's, on the same runs, at 95 % confidence, and the settled one is at most 5 % above either.",
        (
            *(
                Part(
                    f"whole-run position error below the {name.upper()}'s",
                    "reduction",
                    ("two_step",),
                    "r_rms_m",
                    "%",
                    (name,),
                    at_least=0.0,
                )
                for name in ("ekf", "ukf")
            ),
            *(
                Part(
                    f"settled position error below the {name.upper()}'s",
                    "reduction",
                    ("two_step",),
                    "settled_r_rms_m",
                    "%",
                    (name,),
                    at_least=-5.0,
                )
                for name in ("ekf", "ukf")
            ),
        ),
        (_prior(WIDE_M, _FILTERS),),
        (*(_prior(sigma, _FILTERS) for sigma in PRIORS_M if sigma != WIDE_M),),
    ),
)
