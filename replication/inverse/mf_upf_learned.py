"""Wei, Song and Zhang (2012): filters over learned dynamics beside the particle filter, for B1, B2 and B5.

An unscented Kalman filter over the learned dynamics stands for their filter: it has no number of particles and no
resampling, and costs a hundredth. `agreement` measures how far the two differ. The revolution after the flight stands
for the one before, as far from it; one process serves all outputs.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from relnav_sim import LinearDynamics, Step, create_filter, dynamics, fit_gp_dynamics, run_filter
from relnav_sim.arrays import Array, Indices, Mask
from relnav_sim.dynamics.gp.dynamics import GpDynamics
from relnav_sim.dynamics.interface import Dynamics
from replication.inverse.bank import Bank, WithoutTables
from replication.inverse.claims import Quantity, judged, wilson
from replication.inverse.each_run import LearnedOfEachRun
from replication.inverse.mf_upf import OUTCOMES as PARTICLE_OUTCOMES
from replication.inverse.mf_upf import UNKNOWNS as PARTICLE_UNKNOWNS
from replication.inverse.mf_upf import holds as particle_holds
from replication.inverse.mf_upf import particle_outcomes
from replication.inverse.mf_upf_process import FITTED, learned
from replication.inverse.mf_upf_scenario import DURATION_S, MEAN_MOTION, STEADY_S, STEPS_S, flight, rms, sizes, truth
from replication.inverse.pairs import claims_together
from replication.inverse.prior import Unknown, choice, log_uniform, or_else, values
from replication.inverse.table import Number

POINTS, TOGETHER = 500, 25
TARGETS = ("absolute", "difference", "residual")
LEARNED = ("the next state", "the difference", "the residual of the Clohessy-Wiltshire equations")

UNKNOWNS: tuple[Unknown, ...] = (
    *PARTICLE_UNKNOWNS,
    Unknown("target", "", "what is learned", choice((2, 1, 1)), choices=LEARNED),
    Unknown("trained_on", "", "learned from", choice((1, 1)), choices=("another revolution", "the flight itself")),
    Unknown("selection", "", "the 500 pairs", choice((1, 1)), choices=("spread over a revolution", "consecutive")),
    Unknown("training_error_m", "m", "the error of training positions", or_else(0.5, 0.0, log_uniform(1e-4, 1)), True),
    Unknown("lengths", "", "length scales", choice((1, 1)), choices=("one for all inputs", "one for each")),
    Unknown("standardised", "", "inputs and outputs", choice((1, 1)), choices=("in metres", "standardised")),
    Unknown("calibrated", "", "the learned variance", choice((1, 1)), choices=("as it is", "calibrated")),
    Unknown("added_psd", "m^2/s^3", "the process noise added", or_else(0.5, 0.0, log_uniform(1e-14, 1e-6)), True),
)
OUTCOMES = (
    ("95 % of r from 1000 s", "m"),
    ("95 % of v from 1000 s", "m/s"),
    ("RMS r from 1000 s", "m"),
)
CLAIMS = ("B1", "B2", "B5")
LEARNED_R, PARTICLE_R = 2, len(OUTCOMES) + [name for name, _ in PARTICLE_OUTCOMES].index("RMS r from 1000 s")


class MfUpfLearned(WithoutTables):
    """Both filters of the comparison in one setting."""

    name = "mf_upf_learned"
    block = 500
    unknowns: Sequence[Unknown] = UNKNOWNS
    numbers: Sequence[Number] = tuple(
        Number("outcomes", column, what, unit, digit=1e-5)
        for column, each in (("learned", OUTCOMES), ("pf", PARTICLE_OUTCOMES))
        for what, unit in each
    )

    def flown(self, u: Array, seeds: Sequence[Sequence[int]], runs: int) -> Array:
        """Return the outcomes of one run, (n, 1, outcomes); arguments as for `bank.Paper`."""
        setting = values(UNKNOWNS, u)
        return np.concatenate([learned_outcomes(setting, seeds), particle_outcomes(setting, seeds)], axis=1)[:, None]


def learned_outcomes(setting: Mapping[str, Array], seeds: Sequence[Sequence[int]]) -> Array:
    """Return the outcomes of the stand-in, (n, outcomes); settings with the same step fly together."""
    found = np.empty((len(seeds), len(OUTCOMES)))
    for step in range(len(STEPS_S)):
        same = np.flatnonzero(setting["step"] == step)
        for first in range(0, len(same), TOGETHER):
            rows = same[first : first + TOGETHER]
            models = [_quick(setting, row, seeds[row]) for row in rows]
            found[rows] = _flown(setting, rows, seeds, "gp_ukf", LearnedOfEachRun(models))
    return found


def published_outcomes(setting: Mapping[str, Array], row: int, seeds: Sequence[Sequence[int]], particles: int) -> Array:
    """Return the outcomes of the filter of the paper in the setting of a row, (outcomes,)."""
    return _flown(setting, np.array([row]), seeds, "mf_upf", _exact(setting, row, seeds[row]), particles=particles)[0]


def _flown(
    setting: Mapping[str, Array],
    rows: Indices,
    seeds: Sequence[Sequence[int]],
    filter: str,
    motion: Dynamics,
    **options: object,
) -> Array:
    """Return the outcomes of a filter in some settings with the same step, (rows, outcomes)."""
    flown = flight(setting, rows, seeds)
    numbered = [int(seeds[row][1]) for row in rows]
    h = STEPS_S[int(setting["step"][rows[0]])]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # runs that fail have no estimate
        made = create_filter(filter, motion, flown.radar, **options)
        seed = int(seeds[rows[0]][0])
        mean = run_filter(made, flown.z, flown.m0, flown.P0, seed=seed, runs=numbered, step_s=h).mean
    r, v = sizes(flown, mean)
    after = flown.times_s > STEADY_S
    return np.stack([np.quantile(r[:, after], 0.95, axis=1), np.quantile(v[:, after], 0.95, axis=1), rms(r, after)], 1)


def _quick(setting: Mapping[str, Array], row: int, seed: Sequence[int]) -> GpDynamics:
    """Return the learned dynamics of a row's setting, with a cheaper fit and variance."""
    own = _own(setting, row)
    form = (own[name] == place for name, place in (("lengths", 0), ("standardised", 1), ("calibrated", 1)))
    return learned(*_pairs(own, seed), TARGETS[int(own["target"])], _motion(own), *form)


def _exact(setting: Mapping[str, Array], row: int, seed: Sequence[int]) -> GpDynamics:
    """Return the same as relnav makes them."""
    own = _own(setting, row)
    now, after = _pairs(own, seed)
    target, motion = TARGETS[int(own["target"])], _motion(own)
    return fit_gp_dynamics(
        now,
        after,
        STEPS_S[int(own["step"])],
        motion if target == "residual" else None,
        target,
        added_noise=motion.process_noise(now, Step(0)),
        restarts=0,
        regression={
            "length_scales": ("common", "one_per_input")[int(own["lengths"])],
            "standardised": own["standardised"] == 1,
            "fitted_points": FITTED,
            "calibrated": own["calibrated"] == 1,
        },
    )


def _own(setting: Mapping[str, Array], row: int) -> dict[str, float]:
    return {name: float(value[row]) for name, value in setting.items()}


def _motion(own: Mapping[str, float]) -> LinearDynamics:
    h, psd = STEPS_S[int(own["step"])], own["added_psd"]
    return dynamics.cw(mean_motion_rad_s=MEAN_MOTION, step_s=h, acceleration_psd_m2_s3=psd)


def _pairs(own: Mapping[str, float], seed: Sequence[int]) -> tuple[Array, Array]:
    """Return the states that are learned from and the same a step later, (POINTS, 6) both."""
    h = STEPS_S[int(own["step"])]
    generator = np.random.default_rng([*seed, 1])
    begins = h * np.arange(POINTS)
    if own["selection"] == 0:
        begins = np.sort(generator.uniform(0, DURATION_S - h, POINTS))
    begins = begins + (DURATION_S if own["trained_on"] == 0 else 0.0)
    times, place = np.unique(np.concatenate([begins, begins + h]), return_inverse=True)
    states = truth(np.array([own["ballistic_m2_kg"]]), times)[0]
    scale = own["training_error_m"] * np.array([1.0] * 3 + [MEAN_MOTION] * 3)
    now, after = (states + scale * generator.standard_normal(states.shape))[place].reshape(2, POINTS, 6)
    return now, after


def holds(found: Array) -> dict[str, Mask]:
    """Return in which settings, by their outcomes (n, outcomes), a claim holds; the rules of docs/replication.md.

    B1: 95 % of the position errors after 1000 s are below 0.5 m. B2: the same of velocity errors and 0.001 m/s. B5: the
    RMS position error is at least 45 % below the particle filter's.
    """
    shared = particle_holds(found[:, len(OUTCOMES) :])
    own = {
        "B1": found[:, 0] < 0.5,
        "B2": found[:, 1] < 0.001,
        "B5": found[:, LEARNED_R] <= 0.55 * found[:, PARTICLE_R],
    }
    return own | shared


def findings(bank: Bank, printed: Array) -> dict[str, Any]:
    """Return what the bank says of the claims on learned dynamics, of all claims together, and of the stand-in."""
    setting = values(UNKNOWNS, bank.u)
    told = [Quantity(each.words, each.unit, setting[each.name], each.choices) for each in UNKNOWNS]
    none = np.empty((len(bank.u), 0), dtype=bool)
    by_claim = holds(bank.numbers)
    together = np.all(list(by_claim.values()), axis=0)
    return {
        "claims": {name: judged(by_claim[name], told, (), none) for name in CLAIMS},
        "all_claims": {
            "words": "B1 to B6",
            "probability": float(together.mean()),
            "interval": list(wilson(int(together.sum()), len(together))),
        },
        "together": claims_together(by_claim),
        "stand_in": agreement(bank, 40, 100),
        "sentences": [],
    }


def agreement(bank: Bank, count: int, particles: int) -> dict[str, Any]:
    """Return how the filter of the paper does in some settings of the bank, those with the fewest measurements.

    Args:
        bank: The bank.
        count: How many settings.
        particles: The number of particles of their filter.
    """
    setting = values(UNKNOWNS, bank.u)
    rows = np.flatnonzero(setting["step"] == len(STEPS_S) - 1)[:count]
    seeds = [[bank.seed, n, 1] for n in range(len(bank.u))]
    theirs = bank.numbers[rows].copy()
    theirs[:, : len(OUTCOMES)] = [published_outcomes(setting, row, seeds, particles) for row in rows]
    ours, seen = holds(bank.numbers[rows]), holds(theirs)
    ratio = theirs[:, LEARNED_R] / bank.numbers[rows, LEARNED_R]
    same = {name: int(np.sum(ours[name] == seen[name])) for name in CLAIMS}
    return {
        "settings": len(rows),
        "particles": particles,
        "same": {name: [count, *wilson(count, len(rows))] for name, count in same.items()},
        "ratio": [float(each) for each in np.quantile(ratio, (0.1, 0.5, 0.9))],
    }
