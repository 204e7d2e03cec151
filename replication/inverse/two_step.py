"""Liu et al. (2011) as a paper of which nothing but the method is known: any scenario may be its own.

Its numbers are not printed ones but what its claims are about, over `RUNS` runs of a setting. The motion is that of
Clohessy and Wiltshire for truth and filters alike: the claims are about starts, not about dynamics. A hundred settings
share radar, clock and process noise, which relnav's filters take once for all runs of a block.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from relnav_sim import create_filter, dynamics, measurements, run_filter
from relnav_sim.arrays import Array, Indices, Mask
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from replication.inverse.bank import BLOCK, Bank
from replication.inverse.claims import Quantity, judged
from replication.inverse.prior import Unknown, log_uniform, uniform, values
from replication.inverse.table import Number

RUNS, EPOCHS = 8, 60
SETTLED = EPOCHS * 2 // 3
CONVERGED = 3.0
"""Times the settled error of an iterated EKF, which needs no start of a first-step state: a run below has converged."""

SHARED = (
    Unknown("period_s", "s", "the chief's period", uniform(5400, 6600)),
    Unknown("step_s", "s", "the time between readings", log_uniform(0.5, 20), True),
    Unknown("range_sigma_m", "m", "the range's standard deviation", log_uniform(0.01, 10), True),
    Unknown("angle_sigma_deg", "deg", "the angles' standard deviation", log_uniform(0.003, 0.3), True),
    Unknown("acceleration_psd", "m^2/s^3", "the process noise", log_uniform(1e-13, 1e-7), True),
    Unknown("slack", "R", "what an arbitrary start adds to the variance of g(x)", log_uniform(1e-6, 1e6), True),
)
OWN = (
    Unknown("distance_m", "m", "the distance", log_uniform(50, 20_000), True),
    Unknown("azimuth_deg", "deg", "the azimuth", uniform(-180, 180)),
    Unknown("elevation_deg", "deg", "the elevation", uniform(-60, 60)),
    Unknown("start_position_m", "m", "the start error of each position", log_uniform(0.1, 1000), True),
    Unknown("start_velocity_m_s", "m/s", "the start error of each velocity", log_uniform(1e-3, 1), True),
)
UNKNOWNS: tuple[Unknown, ...] = (*SHARED, *OWN)
OUTCOMES = (
    "converged, unscented start",
    "converged, arbitrary start",
    *(f"{span} error over the {other}'s" for other in ("ekf", "ukf") for span in ("whole", "settled")),
)
FILTERS: Mapping[str, Mapping[str, object]] = {
    "unscented": {"name": "two_step", "start": "unscented"},
    "arbitrary": {"name": "two_step", "start": "linearised"},
    "ekf": {"name": "ekf"},
    "ukf": {"name": "ukf", "alpha": 1, "beta": 0, "kappa": 0},
    "iekf": {"name": "iekf"},
}


class TwoStep:
    """The two-step filter's start."""

    name = "two_step_kf"
    unknowns: Sequence[Unknown] = UNKNOWNS
    numbers: Sequence[Number] = tuple(Number("outcomes", "two_step", outcome, "", digit=1e-3) for outcome in OUTCOMES)
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
        """Return what the claims are about, (n, 1, outcomes), of a block of settings; arguments as for `bank.Paper`."""
        setting = values(UNKNOWNS, self.effective(u))
        shared = {unknown.name: float(setting[unknown.name][0]) for unknown in SHARED}
        normals = np.concatenate([_normals(seed) for seed in seeds])
        each = {unknown.name: np.repeat(setting[unknown.name], RUNS) for unknown in OWN}
        n, h = 2 * np.pi / shared["period_s"], shared["step_s"]
        start = _start(each, n)
        F = cw_transition(n, h)
        truth = np.empty((len(start), EPOCHS, 6))
        truth[:, 0] = start @ F.T
        for k in range(1, EPOCHS):
            truth[:, k] = truth[:, k - 1] @ F.T
        radar = measurements.radar(range_sigma_m=shared["range_sigma_m"], angle_sigma_deg=shared["angle_sigma_deg"])
        sigma = np.array([shared["range_sigma_m"], *[np.radians(shared["angle_sigma_deg"])] * 2])
        z = radar.predict(truth, 0) + sigma * normals[:, 6:].reshape(-1, EPOCHS, 3)
        deviations = np.concatenate(
            [np.repeat(each[name][:, None], 3, axis=1) for name in ("start_position_m", "start_velocity_m_s")], axis=1
        )
        P0 = deviations[:, :, None] ** 2 * np.eye(6)
        motion = dynamics.cw(mean_motion_rad_s=n, step_s=h, acceleration_psd_m2_s3=shared["acceleration_psd"])
        whole, settled = {}, {}
        for name, options in FILTERS.items():
            given = dict(options) | ({"start_slack": shared["slack"]} if name == "arbitrary" else {})
            flown = create_filter(str(given.pop("name")), motion, radar, **given)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # runs that fail have not converged
                mean = run_filter(flown, z, start + deviations * normals[:, :6], P0, step_s=h).mean
            square = np.nan_to_num(((mean - truth)[:, :, :3] ** 2).sum(axis=2), nan=1e12)
            whole[name] = np.sqrt(square.mean(axis=1)).reshape(-1, RUNS)
            settled[name] = np.sqrt(square[:, SETTLED:].mean(axis=1)).reshape(-1, RUNS)
        limit = CONVERGED * np.median(settled["iekf"], axis=1)[:, None]
        shares = [(settled[name] <= limit).mean(axis=1) for name in ("unscented", "arbitrary")]
        ratios = [
            np.median(errors["unscented"] / errors[other], axis=1)
            for other in ("ekf", "ukf")
            for errors in (whole, settled)
        ]
        return np.stack([*shares, *ratios], axis=1)[:, None]


def _normals(seed: Sequence[int]) -> Array:
    return np.random.default_rng(list(seed)).standard_normal((RUNS, 6 + 3 * EPOCHS))


def _start(each: Mapping[str, Array], n: float) -> Array:
    """Return first states (runs, 6), RTN, of orbits that close; angles as the radar's, whose x is along the track."""
    azimuth, elevation = np.radians(each["azimuth_deg"]), np.radians(each["elevation_deg"])
    along = each["distance_m"] * np.cos(elevation) * np.cos(azimuth)
    cross = -each["distance_m"] * np.cos(elevation) * np.sin(azimuth)
    radial = each["distance_m"] * np.sin(elevation)
    zero = np.zeros_like(along)
    return np.stack([radial, along, cross, zero, -2 * n * radial, zero], axis=1)


def holds(found: Array) -> dict[str, Mask]:
    """Return in which settings, by their outcomes (n, outcomes), each claim holds."""
    unscented, arbitrary, whole_ekf, settled_ekf, whole_ukf, settled_ukf = found.T
    return {
        "C1": (unscented >= 0.9) & (unscented - arbitrary >= 0.5),
        "C2": (whole_ekf < 1) & (whole_ukf < 1) & (settled_ekf <= 1.05) & (settled_ukf <= 1.05),
    }


def findings(bank: Bank, printed: Array) -> dict[str, Any]:
    """Return what the bank says of each claim; the paper's accessible part has no sentence with a number to test."""
    setting = values(UNKNOWNS, TwoStep().effective(bank.u))
    told = [Quantity(unknown.words, unknown.unit, setting[unknown.name]) for unknown in UNKNOWNS]
    across = np.minimum(setting["distance_m"] * np.radians(setting["angle_sigma_deg"]), setting["range_sigma_m"])
    told.append(
        Quantity("the start error over the better of the radar's errors", "", setting["start_position_m"] / across)
    )
    bend = setting["start_position_m"] ** 2 / (2 * setting["distance_m"]) / setting["range_sigma_m"]
    told.append(Quantity("the bend of the range over the start error, in the range's standard deviations", "", bend))
    none = np.empty((len(bank.u), 0), dtype=bool)
    return {
        "claims": {name: judged(mask, told, (), none, BLOCK) for name, mask in holds(bank.numbers).items()},
        "sentences": [],
    }
