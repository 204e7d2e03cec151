"""Wei, Song and Zhang (2012): the particle filter over Clohessy-Wiltshire dynamics, which claims B3 and B4 are about.

The cheap part of the prior: no filter over learned dynamics is flown, no more than 500 particles, and at least 2 s
between readings. The radar is on the chief, and its elevation is the angle across the orbit plane; seen from the deputy
the errors are the same. A hundred settings share filter and clock, which relnav takes once for all runs of a block.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from relnav_sim import (
    ExponentialAtmosphere,
    ForceModel,
    LinearDynamics,
    create_filter,
    eci_from_rtn,
    measurements,
    propagate,
    rtn_from_eci,
    run_filter,
)
from relnav_sim.arrays import Array, Indices, Mask
from relnav_sim.astro.constants import MU_M3_S2, RADIUS_M
from relnav_sim.astro.orbits import Elements, state_from_elements
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from replication.inverse.bank import BLOCK, Bank
from replication.inverse.claims import Quantity, judged
from replication.inverse.prior import Unknown, choice, log_uniform, or_else, values
from replication.inverse.table import Number

DURATION_S, WINDOWS_S = 6000.0, ((500, 1000), (1000, 3500), (3500, 6000))
RANGE_SIGMA_M, ANGLE_SIGMA_DEG = 0.1 / 3, 0.05 / 3
Q_DIAGONAL = np.array([1e-9] * 3 + [1e-6] * 3)
STEPS_S = (2.0, 5.0, 10.0, 20.0)
START = (300.0, -371.055, -400.0, -0.2, -0.646805, 0.1)
ORBIT = Elements(7e6, 0.0, np.pi / 6, np.pi / 4, 0.0, np.pi / 6)
FORCE = ForceModel(MU_M3_S2, RADIUS_M, atmosphere=ExponentialAtmosphere(600e3, 1.454e-13, 71_835.0))

SHARED = (
    Unknown("particles", "", "the number of particles", log_uniform(50, 500), True),
    Unknown("step", "", "the time between readings", choice((1, 1, 1, 1)), choices=tuple(f"{h:g} s" for h in STEPS_S)),
    Unknown("roughening", "", "resampled particles", choice((2, 1)), choices=("as they are", "roughened")),
    Unknown("q_reading", "", "Q", choice((2, 1)), choices=("for a step", "for a second")),
    Unknown("told_sigma", "", "the radar's sigma told over the true one", or_else(0.4, 1.0, log_uniform(1, 300)), True),
)
OWN = (
    Unknown("start_position_m", "m", "the start error of each position", log_uniform(0.01, 100), True),
    Unknown("start_velocity_m_s", "m/s", "the start error of each velocity", log_uniform(1e-4, 0.5), True),
    Unknown("ballistic_m2_kg", "m^2/kg", "Cd A / m of the chief, half the deputy's", log_uniform(2e-3, 0.1), True),
)
UNKNOWNS: tuple[Unknown, ...] = (*SHARED, *OWN)


class MfUpf:
    """The particle filter of the comparison."""

    name = "mf_upf"
    unknowns: Sequence[Unknown] = UNKNOWNS
    numbers: Sequence[Number] = tuple(
        Number("outcomes", "pf", f"{what} {low} to {high} s", unit, digit=1e-4)
        for what, unit in (("largest r", "m"), ("RMS v", "m/s"))
        for low, high in WINDOWS_S
    )
    printed = np.empty(0)
    groups: Sequence[tuple[Indices, Indices]] = ()

    def effective(self, u: Array) -> Array:
        """Return uniform numbers (n, unknowns) with those of each block's first setting where a block shares them."""
        acting = u.copy()
        acting[:, : len(SHARED)] = u[np.arange(len(u)) // BLOCK * BLOCK, : len(SHARED)]
        return acting

    def apart(self, u: Array) -> Array:
        """Return the settings as they are: there are no groups."""
        return u

    def flown(self, u: Array, seeds: Sequence[Sequence[int]], runs: int) -> Array:
        """Return the outcomes of one run, (n, 1, outcomes), of a block of settings; arguments as for `bank.Paper`."""
        setting = values(UNKNOWNS, self.effective(u))
        shared = {unknown.name: float(setting[unknown.name][0]) for unknown in SHARED}
        h = STEPS_S[int(shared["step"])]
        times = np.arange(h, DURATION_S + h / 2, h)
        truth = _truth(setting["ballistic_m2_kg"], np.append(0.0, times))
        normals = np.stack([np.random.default_rng(list(seed)).standard_normal((len(times) + 2, 3)) for seed in seeds])
        mounting = (0.0, 0.0, 90.0)
        sigma = np.array([RANGE_SIGMA_M, *[np.radians(ANGLE_SIGMA_DEG)] * 2])
        told = measurements.radar(
            range_sigma_m=shared["told_sigma"] * RANGE_SIGMA_M,
            angle_sigma_deg=shared["told_sigma"] * ANGLE_SIGMA_DEG,
            mounting_deg=mounting,
        )
        z = told.predict(truth[:, 1:], 0) + sigma * normals[:, 2:]
        deviations = np.stack([setting["start_position_m"]] * 3 + [setting["start_velocity_m_s"]] * 3, axis=1)
        Q = np.diag(Q_DIAGONAL * (h if shared["q_reading"] == 1 else 1.0))
        n = np.sqrt(MU_M3_S2 / float(ORBIT.semi_major_axis_m) ** 3)
        flown = create_filter(
            "particle",
            LinearDynamics(cw_transition(n, h), Q),
            told,
            particles=round(shared["particles"]),
            roughening=shared["roughening"],
        )
        m0, P0 = truth[:, 0] + deviations * normals[:, :2].reshape(-1, 6), deviations[:, :, None] ** 2 * np.eye(6)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # runs that fail have no estimate
            numbered = [int(seed[1]) for seed in seeds]
            mean = run_filter(flown, z, m0, P0, seed=int(seeds[0][0]), runs=numbered, step_s=h).mean
        error = np.nan_to_num(mean - truth[:, 1:], nan=1e6)
        r, v = np.linalg.norm(error[..., :3], axis=-1), np.linalg.norm(error[..., 3:], axis=-1)
        within = [(times > low) & (times <= high) for low, high in WINDOWS_S]
        found = [r[:, each].max(axis=1) for each in within]
        found += [np.sqrt((v[:, each] ** 2).mean(axis=1)) for each in within]
        return np.stack(found, axis=1)[:, None]


def _truth(ballistic: Array, times: Array) -> Array:
    """Return relative states (n, T, 6), RTN, for the chief's Cd A / m, (n,); the deputy's is twice that."""
    chief0 = state_from_elements(ORBIT, MU_M3_S2)
    both = np.stack([chief0, eci_from_rtn(chief0, START, FORCE.normal_acceleration(chief0, float(ballistic[0])))])
    count = len(ballistic)
    states = propagate(np.repeat(both, count, axis=0), times, FORCE, np.concatenate([ballistic, 2 * ballistic]))
    chief = states[:count]
    return rtn_from_eci(chief, states[count:], FORCE.normal_acceleration(chief, ballistic[:, None]))


def holds(found: Array) -> dict[str, Mask]:
    """Return in which settings, by their outcomes (n, outcomes), a claim holds.

    B3: about 5 m in both later windows, within a factor of two, and less before 1000 s: the printed oscillation starts
    then and goes on. B4: about 0.01 m/s in both.
    """
    before, middle, last = found[:, :3].T
    about_5 = [(r >= 2.5) & (r <= 10) for r in (middle, last)]
    about_1_cm = [(v >= 0.005) & (v <= 0.02) for v in found[:, 4:].T]
    return {"B3": about_5[0] & about_5[1] & (before < middle), "B4": about_1_cm[0] & about_1_cm[1]}


def findings(bank: Bank, printed: Array) -> dict[str, Any]:
    """Return what the bank says of the claims on the particle filter."""
    setting = values(UNKNOWNS, MfUpf().effective(bank.u))
    told = [Quantity(each.words, each.unit, setting[each.name], each.choices) for each in UNKNOWNS]
    none = np.empty((len(bank.u), 0), dtype=bool)
    by_claim = holds(bank.numbers)
    claims = {name: judged(mask, told, (), none, BLOCK) for name, mask in by_claim.items()}
    return {"claims": claims, "sentences": []}
