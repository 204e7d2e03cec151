"""Errors of the filters of Shi et al. (2025) in one setting: Tables 2, 3 and 4 flown together.

At 12 km EKF, UKF and a Kalman filter on the converted measurement are one filter, and the alpha filter is that with
R / alpha and the scatter of its samples (docs/replication.md). Late steps are longer than the paper's 0.2 s and their
measurements that much better, which leaves white noise as it is; `FULL` has the paper's own steps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from replication.inverse import recursion
from replication.inverse.alpha_kf_truth import DURATION_S, positions, steps_left_out
from replication.inverse.alpha_kf_unknowns import COLUMNS, SHARING

MEASUREMENT_S = 0.2
RANGE_M, ANGLE_RAD = 12.0, np.radians(0.2)
BIAS_RAD = np.radians(0.05)
TRACKER_RAD = np.radians(np.array([30.0, 100.0]) / 3600)
GNSS_RAD = np.array([0.45 / 7500, 0.0, 90 / 7.1e6])
"""How far the measured orbit turns RTN about R, T and N: by its velocity across the plane, and along the track."""
ALPHAS = (0.001, 0.005, 0.01, 0.05, 0.1, 0.5, 0.999)
ALPHA = 0.5
SAMPLES = 10_000
TABLES = (2, 3, 4)


@dataclass(frozen=True)
class Flown:
    """What the filters of a table have made.

    Attributes:
        errors: Errors, RTN, (filters, runs, K, 6), m and m/s.
        formal_m: Formal standard deviations of the position, (filters, K), m.
    """

    errors: Array
    formal_m: Array


@dataclass(frozen=True)
class Clock:
    """Steps of several lengths.

    Attributes:
        spans_s: The lengths, (S,).
        kinds: Which of them each step has, (K,).
    """

    spans_s: Array
    kinds: Integers

    @property
    def steps_s(self) -> Array:
        """Length of each step, (K,)."""
        return self.spans_s[self.kinds]


def clock(*stages: tuple[float, float]) -> Clock:
    """Return steps of these lengths, s, each up to a time, s, on which they end."""
    kinds, begin = [], 0.0
    for kind, (span, end) in enumerate(stages):
        kinds.append(np.full(round((end - begin) / span), kind))
        begin = end
    return Clock(np.array([span for span, _ in stages]), np.concatenate(kinds).astype(np.int64))


FULL = clock((MEASUREMENT_S, DURATION_S))
QUICK = clock((0.2, 60), (0.5, 120), (1.5, 300), (3, 960), (5, DURATION_S))


def flights(
    setting: Mapping[str, float],
    mean_motion: float,
    nodes: Array,
    left_out: Array,
    generator: np.random.Generator,
    runs: int,
    steps: Clock = QUICK,
    tables: Sequence[int] = TABLES,
) -> dict[int, Flown]:
    """Return the errors of each table's filters.

    Args:
        setting: Value of each unknown.
        mean_motion: The chief's, rad/s.
        nodes: States at the nodes, (nodes, 6).
        left_out: What Clohessy-Wiltshire leaves out, (nodes - 1, 2, 3).
        generator: Source of all noise.
        runs: Number of runs.
        steps: Steps to fly.
        tables: Tables to fly.
    """
    h = steps.steps_s
    ends = np.cumsum(h)
    F = np.stack([cw_transition(mean_motion, span) for span in steps.spans_s])
    Q = np.stack([_white_acceleration(span, setting) for span in steps.spans_s])
    places = np.concatenate([nodes[:1, :3], positions(nodes, ends)])
    axes, lever = _axes(places)
    scale = 1 / 3 if setting["sigma_interpretation"] == 0 else 1.0
    sigmas = scale * np.stack([np.full(len(lever), RANGE_M), lever * ANGLE_RAD, lever * ANGLE_RAD], axis=1)
    told = setting["told_r"] * _told(axes, sigmas, setting["told_shape"] == 1)
    share = np.concatenate([[1.0], MEASUREMENT_S / h])  # of a measurement's variance that is left in a step's
    missed = steps_left_out(left_out, ends, h)
    flown = {}
    for table in tables:
        errors = _measurement_errors(
            setting, table, places, axes, sigmas, share, np.append(MEASUREMENT_S, h), generator, runs
        )
        columns = _columns(setting, table)
        larger = _variance(setting) if table > 2 and setting["told_mixture"] == 1 else 1.0
        R = larger * told
        drawn = columns[:, 3].any()
        g = generator.standard_normal((len(columns), runs, len(h), 6)) if drawn else np.zeros((1, 1, 1, 6))
        P0 = np.zeros((6, 6))
        P0[:3, :3] = setting["start_position"] * R[0]
        P0[3:, 3:] = setting["start_velocity_m_s"] ** 2 * np.eye(3)
        e0 = np.concatenate([errors[:, 0], np.broadcast_to(-nodes[0, 3:], (runs, 3))], axis=1)
        distinct, which = np.unique(columns, axis=0, return_inverse=True)
        if drawn:
            distinct, which = columns, np.arange(len(columns))
        out, formal = np.empty((len(distinct), runs, len(h), 6)), np.empty((len(distinct), len(h)))
        spans = np.stack([steps.spans_s, steps.spans_s / MEASUREMENT_S], axis=1)
        w = np.ascontiguousarray(errors[:, 1:])
        Rk = np.ascontiguousarray(R[1:] * share[1:, None, None])
        recursion.errors(F, Q, spans, steps.kinds, missed, Rk, w, g, distinct, P0, e0, out, formal)
        flown[table] = Flown(out[which.reshape(-1)], formal[which.reshape(-1)])
    return flown


def _white_acceleration(h: float, setting: Mapping[str, float]) -> Array:
    """Return the process noise of a white acceleration over h s, (6, 6), of density 1 along the track.

    What turns meanwhile is left out: it is of order (n h)^2.
    """
    densities = np.diag([setting["radial_noise"], 1.0, setting["cross_noise"]])
    return np.asarray(np.kron([[h**3 / 3, h**2 / 2], [h**2 / 2, h]], densities), dtype=float)


def _axes(places: Array) -> tuple[Array, Array]:
    """Return the directions of range, azimuth and elevation at each epoch, (K, 3, 3) in columns, and the distance."""
    distance = np.linalg.norm(places, axis=1)
    along = places / distance[:, None]
    azimuth = np.stack([-along[:, 1], along[:, 0], np.zeros(len(along))], axis=1)
    flat = np.linalg.norm(azimuth, axis=1)
    azimuth = np.where(flat[:, None] > 1e-6, azimuth / np.maximum(flat, 1e-6)[:, None], [1.0, 0.0, 0.0])
    return np.stack([along, azimuth, np.cross(along, azimuth)], axis=2), distance


def _told(axes: Array, sigmas: Array, equal: bool) -> Array:
    """Return R of a measurement as filters are told it, (K, 3, 3); the same on all axes has the same trace."""
    variances = sigmas**2
    if equal:
        return np.einsum("k,ij->kij", variances.mean(axis=1), np.eye(3))
    return np.einsum("kia,ka,kja->kij", axes, variances, axes)


def _variance(setting: Mapping[str, float]) -> float:
    """Return the variance of the mixture over that of component A; component B is twice as wide."""
    return 1 + 3 * setting["mixture_share"]


def _measurement_errors(
    setting: Mapping[str, float],
    table: int,
    places: Array,
    axes: Array,
    sigmas: Array,
    share: Array,
    h: Array,
    generator: np.random.Generator,
    runs: int,
) -> Array:
    """Return the errors of the converted measurements at the start and after each step, (runs, K + 1, 3), RTN, m."""
    noise = generator.standard_normal((runs, len(h), 3)) * np.sqrt(share)[:, None]
    if table > 2:
        wide = generator.random((runs, len(h))) < setting["mixture_share"]
        single = share > 0.99  # a mean of several is as good as normal
        scale = np.where(single, np.where(wide, 2.0, 1.0), np.sqrt(_variance(setting)))
        noise *= scale[:, :, None]
    local = noise * sigmas
    if table == 4:
        size = BIAS_RAD * (1 / 3 if setting["bias_interpretation"] == 1 else 1.0)
        lever = np.linalg.norm(places, axis=1) * size
        if setting["bias_channel"] != 2:
            local[:, :, 1] += (1 - 2 * setting["azimuth_sign"]) * lever
        if setting["bias_channel"] != 1:
            local[:, :, 2] += (1 - 2 * setting["elevation_sign"]) * lever
    errors = np.einsum("kia,rka->rki", axes, local)
    return errors + np.cross(_turns(setting, share, h, generator, runs), places)


def _turns(setting: Mapping[str, float], share: Array, h: Array, generator: np.random.Generator, runs: int) -> Array:
    """Return the error of the measured axes as a rotation, (runs, K + 1, 3), rad."""
    across, about = TRACKER_RAD if setting["tracker_labels"] == 0 else TRACKER_RAD[::-1]
    sigma = np.full(3, across)
    sigma[int(setting["boresight"])] = about
    sigma = np.hypot(sigma, GNSS_RAD) * (1 / 3 if setting["sigma_interpretation"] == 0 else 1.0)
    normals = generator.standard_normal((runs, len(h), 3))
    if setting["attitude_tau_s"] == 0:
        return normals * sigma * np.sqrt(share)[:, None]
    decays = np.exp(-h / setting["attitude_tau_s"])[:, None]
    return np.stack([recursion.markov(decays, each, sigma) for each in normals])


def process_noise(setting: Mapping[str, float], column: str) -> tuple[float, float]:
    """Return the two densities of the process noise of one of `COLUMNS`: acceleration and velocity."""
    sharing = SHARING[int(setting["sharing"])]
    if sharing == SHARING[0]:
        column = next(iter(COLUMNS))
    elif sharing == SHARING[1]:
        column = f"{column.rpartition('_')[0]}_2"
    position = setting[f"velocity_psd_{column}"] if setting["position_noise"] == 1 else 0.0
    return setting[f"acceleration_psd_{column}"], position


def _columns(setting: Mapping[str, float], table: int) -> Array:
    """Return the filters of a table as `recursion.errors` takes them, (filters, 4)."""
    drawn = setting["draws"] == 0
    if table == 4:
        each = [(*process_noise(setting, "alpha_kf_4"), 1 / a, SAMPLES * drawn) for a in ALPHAS]
    else:
        gains = {"ekf": (1.0, 0), "ukf": (1.0, 0), "alpha_kf": (1 / ALPHA, SAMPLES * drawn)}
        each = [(*process_noise(setting, f"{name}_{table}"), *gain) for name, gain in gains.items()]
    return np.array(each, dtype=float)
