"""Wei, Song and Zhang (2012): the particle filter over Clohessy-Wiltshire dynamics, which B3, B4 and B6 are about."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from relnav_sim import LinearDynamics, create_filter, run_filter
from relnav_sim.arrays import Array, Indices, Mask
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from replication.inverse.bank import Bank, WithoutTables
from replication.inverse.claims import Quantity, judged
from replication.inverse.each_run import DynamicsOfEachRun
from replication.inverse.mf_upf_scenario import LATE_S, MEAN_MOTION, STEADY_S, STEPS_S, flight, rms, sizes
from replication.inverse.mf_upf_scenario import UNKNOWNS as SCENARIO
from replication.inverse.pairs import claims_together
from replication.inverse.prior import Unknown, choice, values
from replication.inverse.table import Number

PARTICLES = (50, 100, 200, 500)
ESS = (1.0, 0.5)
Q_DIAGONAL = np.array([1e-9] * 3 + [1e-6] * 3)

UNKNOWNS: tuple[Unknown, ...] = (
    *SCENARIO,
    Unknown("particles", "", "the number of particles", choice((1, 1, 1, 1)), choices=tuple(map(str, PARTICLES))),
    Unknown("resampling", "", "resampled", choice((1, 1)), choices=("at each measurement", "when half are effective")),
    Unknown("roughening", "", "resampled particles", choice((2, 1)), choices=("as they are", "roughened")),
    Unknown("q_interpretation", "", "Q", choice((2, 1)), choices=("for a step", "for a second")),
)
OUTCOMES = (
    ("largest r from 4000 s", "m"),
    ("RMS r from 4000 s", "m"),
    ("RMS r 1000 to 2000 s", "m"),
    ("RMS r from 1000 s", "m"),
    ("RMS v from 4000 s", "m/s"),
    ("RMS v 1000 to 2000 s", "m/s"),
)


class MfUpf(WithoutTables):
    """The particle filter of the comparison."""

    name = "mf_upf"
    block = 1000
    unknowns: Sequence[Unknown] = UNKNOWNS
    numbers: Sequence[Number] = tuple(Number("outcomes", "pf", what, unit, digit=1e-4) for what, unit in OUTCOMES)

    def flown(self, u: Array, seeds: Sequence[Sequence[int]], runs: int) -> Array:
        """Return the outcomes of one run, (n, 1, outcomes); arguments as for `bank.Paper`."""
        return particle_outcomes(values(UNKNOWNS, u), seeds)[:, None]


def particle_outcomes(setting: Mapping[str, Array], seeds: Sequence[Sequence[int]]) -> Array:
    """Return the outcomes of the particle filter, (n, outcomes).

    Settings whose filter has the same step, number of particles and resampling fly together.
    """
    together = np.stack([setting[name] for name in ("step", "particles", "resampling", "roughening")], axis=1)
    kinds, kind = np.unique(together, axis=0, return_inverse=True)
    found = np.empty((len(together), len(OUTCOMES)))
    for each in range(len(kinds)):
        rows = np.flatnonzero(kind.reshape(-1) == each)
        found[rows] = _flown_together(setting, rows, seeds)
    return found


def _flown_together(setting: Mapping[str, Array], rows: Indices, seeds: Sequence[Sequence[int]]) -> Array:
    first = {name: int(value[rows[0]]) for name, value in setting.items()}
    h = STEPS_S[first["step"]]
    flown = flight(setting, rows, seeds)
    scale = np.where(setting["q_interpretation"][rows] == 1, h, 1.0)
    motion = DynamicsOfEachRun([LinearDynamics(cw_transition(MEAN_MOTION, h), k * np.diag(Q_DIAGONAL)) for k in scale])
    filter = create_filter(
        "particle",
        motion,
        flown.radar,
        particles=PARTICLES[first["particles"]],
        ess_fraction=ESS[first["resampling"]],
        roughening=first["roughening"],
    )
    numbered = [int(seeds[row][1]) for row in rows]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # runs that fail have no estimate
        mean = run_filter(filter, flown.z, flown.m0, flown.P0, seed=int(seeds[0][0]), runs=numbered, step_s=h).mean
    r, v = sizes(flown, mean)
    late, steady = flown.times_s > LATE_S, flown.times_s > STEADY_S
    early = steady & (flown.times_s <= 2 * STEADY_S)
    found = [r[:, late].max(axis=1), rms(r, late), rms(r, early), rms(r, steady), rms(v, late), rms(v, early)]
    return np.stack(found, axis=1)


def holds(found: Array) -> dict[str, Mask]:
    """Return in which settings, by their outcomes (n, outcomes), a claim holds; the rules of docs/replication.md.

    B3: the largest position error from 4000 s on is 5 m within a factor of two, and the RMS is at least half of that
    of 1000 to 2000 s. B4: the same of the RMS velocity error and 0.01 m/s. B6: the RMS position error is 1 m within a
    factor of two.
    """
    largest, late, early, steady, late_v, early_v = found.T
    return {
        "B3": (largest >= 2.5) & (largest <= 10) & (late >= early / 2),
        "B4": (late_v >= 0.005) & (late_v <= 0.02) & (late_v >= early_v / 2),
        "B6": (steady >= 0.5) & (steady <= 2),
    }


def findings(bank: Bank, printed: Array) -> dict[str, Any]:
    """Return what the bank says of the claims on the particle filter."""
    setting = values(UNKNOWNS, bank.u)
    told = [Quantity(each.words, each.unit, setting[each.name], each.choices) for each in UNKNOWNS]
    none = np.empty((len(bank.u), 0), dtype=bool)
    by_claim = holds(bank.numbers)
    claims = {name: judged(mask, told, (), none) for name, mask in by_claim.items()}
    return {"claims": claims, "together": claims_together(by_claim), "sentences": []}
