"""Liu et al. (2011) as a paper of which nothing but the method is known: any scenario may be its own.

Its numbers are not printed ones but what its claims are about, over `RUNS` runs of a setting. The motion is that of
Clohessy and Wiltshire for truth and filters alike: the claims are about starts, not about dynamics.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from relnav_sim import create_filter, dynamics, run_filter
from relnav_sim.arrays import Array, Indices, Mask
from replication.inverse.bank import Bank, WithoutTables
from replication.inverse.claims import Quantity, judged
from replication.inverse.each_run import DynamicsOfEachRun, RadarOfEachRun
from replication.inverse.pairs import claims_together
from replication.inverse.prior import Unknown, choice, log_uniform, uniform, values
from replication.inverse.table import Number

RUNS, EPOCHS = 8, 40
STEADY = EPOCHS * 2 // 3
SEARCH = {"tolerance": 1e-3, "max_iterations": 8}
"""Of filters that iterate: a block waits for its slowest run. With 20 steps C1 and C2 hold in the same 250 settings."""
CONVERGED = 3.0
"""Times the steady-state error of an iterated EKF, which has no first-step state: a run below has converged."""

SLACKS = (1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6)

UNKNOWNS: tuple[Unknown, ...] = (
    Unknown("period_s", "s", "the chief's period", uniform(5400, 6600)),
    Unknown("step_s", "s", "the time between measurements", log_uniform(0.5, 20), True),
    Unknown("range_sigma_m", "m", "the range's standard deviation", log_uniform(0.01, 10), True),
    Unknown("angle_sigma_deg", "deg", "the angles' standard deviation", log_uniform(0.003, 0.3), True),
    Unknown("acceleration_psd", "m^2/s^3", "the process noise", log_uniform(1e-13, 1e-7), True),
    Unknown(
        "slack",
        "",
        "what an arbitrary start adds to the variance of g(x)",
        choice((1,) * len(SLACKS)),
        choices=tuple(f"{slack:g} R" for slack in SLACKS),
    ),
    Unknown("distance_m", "m", "the distance", log_uniform(50, 20_000), True),
    Unknown("azimuth_deg", "deg", "the azimuth", uniform(-180, 180)),
    Unknown("elevation_deg", "deg", "the elevation", uniform(-60, 60)),
    Unknown("start_position_m", "m", "the start error of each position", log_uniform(0.1, 1000), True),
    Unknown("start_velocity_m_s", "m/s", "the start error of each velocity", log_uniform(1e-3, 1), True),
)
MOTION = ("period_s", "step_s", "acceleration_psd")
OUTCOMES = (
    "converged, unscented start",
    "converged, arbitrary start",
    *(f"{span} error over the {other}'s" for other in ("ekf", "ukf") for span in ("whole", "steady-state")),
)
FILTERS: Mapping[str, Mapping[str, object]] = {
    "unscented": {"name": "two_step", "start": "unscented", **SEARCH},
    "ekf": {"name": "ekf"},
    "ukf": {"name": "ukf", "alpha": 1, "beta": 0, "kappa": 0},
    "iekf": {"name": "iekf", **SEARCH},
}


class TwoStep(WithoutTables):
    """The two-step filter's start."""

    name = "two_step_kf"
    block = 250
    unknowns: Sequence[Unknown] = UNKNOWNS
    numbers: Sequence[Number] = tuple(Number("outcomes", "two_step", outcome, "", digit=1e-3) for outcome in OUTCOMES)

    def flown(self, u: Array, seeds: Sequence[Sequence[int]], runs: int) -> Array:
        """Return what the claims are about, (n, 1, outcomes); arguments as for `bank.Paper`."""
        setting = values(UNKNOWNS, u)
        each = {name: np.repeat(value, RUNS) for name, value in setting.items()}
        normals = np.concatenate([_normals(seed) for seed in seeds])
        whole: dict[str, Array] = {}
        steady: dict[str, Array] = {}
        for name, rows, mean, truth in _flights(each, normals):
            square = np.nan_to_num(((mean - truth)[:, :, :3] ** 2).sum(axis=2), nan=1e12)
            for errors, part in ((whole, square), (steady, square[:, STEADY:])):
                errors.setdefault(name, np.empty(len(normals)))[rows] = np.sqrt(part.mean(axis=1))
        whole, steady = ({name: e.reshape(-1, RUNS) for name, e in errors.items()} for errors in (whole, steady))
        limit = CONVERGED * np.median(steady["iekf"], axis=1)[:, None]
        shares = [(steady[name] <= limit).mean(axis=1) for name in ("unscented", "arbitrary")]
        ratios = [
            np.median(errors["unscented"] / errors[other], axis=1)
            for other in ("ekf", "ukf")
            for errors in (whole, steady)
        ]
        return np.stack([*shares, *ratios], axis=1)[:, None]


def _flights(each: Mapping[str, Array], normals: Array) -> Iterator[tuple[str, Indices, Array, Array]]:
    """Yield filters with the runs that they fly, their means and the truth, (runs, EPOCHS, 6).

    The arbitrary start takes one slack at a time, as the filter does.

    Args:
        each: Value of each unknown in each run.
        normals: Normal numbers of starts and measurements, (runs, 6 + 3 EPOCHS).
    """
    every = np.arange(len(normals))
    for name, options in FILTERS.items():
        yield name, every, *_flight(each, normals, dict(options))
    for which, slack in enumerate(SLACKS):
        rows = np.flatnonzero(each["slack"] == which)
        if len(rows):
            own = {name: value[rows] for name, value in each.items()}
            options = {"name": "two_step", "start": "linearised", "start_slack": slack, **SEARCH}
            yield "arbitrary", rows, *_flight(own, normals[rows], options)


def _flight(each: Mapping[str, Array], normals: Array, options: dict[str, object]) -> tuple[Array, Array]:
    """Return the means of a filter and the truth."""
    motions = [
        dynamics.cw(mean_motion_rad_s=2 * np.pi / period, step_s=h, acceleration_psd_m2_s3=psd)
        for period, h, psd in zip(*(each[name][::RUNS] for name in MOTION), strict=True)
    ]
    motion = DynamicsOfEachRun(motions, RUNS)
    start = _start(each)
    truth = np.empty((len(start), EPOCHS, 6))
    state = start
    for k in range(EPOCHS):
        state = truth[:, k] = np.einsum("rij,rj->ri", motion.F, state)
    angle = np.radians(each["angle_sigma_deg"])
    sigmas = np.stack([each["range_sigma_m"], angle, angle], axis=1)
    radar = RadarOfEachRun(sigmas)
    z = radar.predict(truth, 0) + sigmas[:, None] * normals[:, 6:].reshape(-1, EPOCHS, 3)
    deviations = np.stack([each["start_position_m"]] * 3 + [each["start_velocity_m_s"]] * 3, axis=1)
    P0 = deviations[:, :, None] ** 2 * np.eye(6)
    flown = create_filter(str(options.pop("name")), motion, radar, **options)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # runs that fail have not converged
        return run_filter(flown, z, start + deviations * normals[:, :6], P0).mean, truth


def _normals(seed: Sequence[int]) -> Array:
    return np.random.default_rng(list(seed)).standard_normal((RUNS, 6 + 3 * EPOCHS))


def _start(each: Mapping[str, Array]) -> Array:
    """Return first states (runs, 6), RTN, of orbits that close; angles as the radar's, whose x is along the track."""
    n = 2 * np.pi / each["period_s"]
    azimuth, elevation = np.radians(each["azimuth_deg"]), np.radians(each["elevation_deg"])
    along = each["distance_m"] * np.cos(elevation) * np.cos(azimuth)
    cross = -each["distance_m"] * np.cos(elevation) * np.sin(azimuth)
    radial = each["distance_m"] * np.sin(elevation)
    zero = np.zeros_like(along)
    return np.stack([radial, along, cross, zero, -2 * n * radial, zero], axis=1)


def holds(found: Array) -> dict[str, Mask]:
    """Return in which settings, by their outcomes (n, outcomes), each claim holds."""
    unscented, arbitrary, whole_ekf, steady_ekf, whole_ukf, steady_ukf = found.T
    return {
        "C1": (unscented >= 0.9) & (unscented - arbitrary >= 0.5),
        "C2": (whole_ekf < 1) & (whole_ukf < 1) & (steady_ekf <= 1.05) & (steady_ukf <= 1.05),
    }


def findings(bank: Bank, printed: Array) -> dict[str, Any]:
    """Return what the bank says of each claim; the paper's accessible part has no sentence with a number to test."""
    setting = values(UNKNOWNS, bank.u)
    told = [Quantity(each.words, each.unit, setting[each.name], each.choices) for each in UNKNOWNS]
    across = np.minimum(setting["distance_m"] * np.radians(setting["angle_sigma_deg"]), setting["range_sigma_m"])
    told.append(
        Quantity("the start error over the better of the radar's errors", "", setting["start_position_m"] / across)
    )
    bend = setting["start_position_m"] ** 2 / (2 * setting["distance_m"]) / setting["range_sigma_m"]
    told.append(
        Quantity("the curvature of the range over the start error, in standard deviations of the range,", "", bend)
    )
    none = np.empty((len(bank.u), 0), dtype=bool)
    by_claim = holds(bank.numbers)
    claims = {name: judged(mask, told, (), none) for name, mask in by_claim.items()}
    return {"claims": claims, "together": claims_together(by_claim), "sentences": []}
