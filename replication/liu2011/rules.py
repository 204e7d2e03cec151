"""The rules for the claims C1 and C2 of Liu et al. (2011)."""

from __future__ import annotations

from dataclasses import replace

from replication.rules import Interpretation, Part, Rule

WIDE_M, PRIORS_M = 200, (1, 10, 50, 200)
QUICK_S = 60.0


def prior(sigma_m: float) -> dict[str, object]:
    """Return what picks the case with this start error."""
    return {"start": {"kind": "dispersed", "position_sigma_m": sigma_m}}


def _prior(sigma_m: float, filters: dict[str, str]) -> Interpretation:
    words = f"with a start error of {sigma_m:g} m"
    return Interpretation(f"{sigma_m:g} m", words, "two_step", filters, prior(sigma_m))


_STARTS = {"two_step": "two_step_unscented", "arbitrary": "two_step_linearised"}
_FILTERS = {"two_step": "two_step_unscented", "ekf": "ekf", "ukf": "ukf"}
SLACKS = {
    "two_step_tight": "1e-6 R",
    "two_step_linearised": "R",
    "two_step_slack_100": "100 R",
    "two_step_slack_10000": "1e4 R",
    "two_step_loose": "1e6 R",
}
"""Linearised starts F P F^T + slack by filter: what the paper calls an arbitrary start."""


def _slack(filter: str) -> Interpretation:
    return replace(
        _prior(WIDE_M, {**_STARTS, "arbitrary": filter}),
        name=f"slack {SLACKS[filter]}",
        words=f"against an arbitrary start of covariance F P Fᵀ + {SLACKS[filter]}",
    )


RULES = (
    Rule(
        "C1",
        "Converged: the position error stays below 1 m for 10 s, from 60 s at the latest, from start errors of 200 "
        "m and 0.3 m/s. With the unscented start at least 95 % of the runs have converged (the 95 % interval's "
        "lower end above 90 %), and at least half of all runs more than from the linearised covariance F P F^T with "
        "any slack between 1e-6 R and 1e6 R.",
        (
            Part(
                "share that converges from the unscented start",
                "share",
                ("two_step",),
                "convergence_s",
                "1",
                at_least=0.9,
                within=QUICK_S,
            ),
            Part(
                "less the share from the linearised start",
                "share",
                ("two_step",),
                "convergence_s",
                "1",
                ("arbitrary",),
                at_least=0.5,
                within=QUICK_S,
            ),
        ),
        tuple(map(_slack, SLACKS)),
        tuple(_prior(sigma, _STARTS) for sigma in PRIORS_M if sigma != WIDE_M),
    ),
    Rule(
        "C2",
        "From start errors between 1 m and 200 m, the RMS position error over the whole run is below the EKF's and "
        "below the UKF's, on the same runs, and that of the steady state (t >= 150 s) is at most 5 % above either.",
        (
            *(
                Part(
                    f"whole run, below the {name.upper()}'s",
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
                    f"steady state, below the {name.upper()}'s",
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
        tuple(_prior(sigma, _FILTERS) for sigma in PRIORS_M),
    ),
)
