"""The filters by name: built in, and those of other packages through the entry-point group ``relnav.filters``."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, TypeVar

import numpy as np
from pydantic import ValidationError

from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.interface import Dynamics
from relnav_sim.dynamics.process_noise import AddedNoiseOptions, process_noise_matrix
from relnav_sim.dynamics.white_noise import AddedNoise, WhiteAcceleration
from relnav_sim.filters.belief import Filter, KeepsModels, considered_states
from relnav_sim.filters.editing_options import EditingOptions
from relnav_sim.filters.operations import Formula
from relnav_sim.filters.read_only import ReadOnlyDynamics, ReadOnlyMeasurement, read_only
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.partial import PartialMeasurement
from relnav_sim.measurements.several import SeveralMeasurements
from relnav_sim.options import Options
from relnav_sim.plugins import load_plugins, no_such_plugin

MeasurementKind = Literal["spherical", "cartesian"]
C = TypeVar("C", bound=type)

_BUILT_IN = (
    "kalman",
    "ekf",
    "ukf",
    "alpha_kf",
    "adaptive_alpha_kf",
    "mkf",
    "skf",
    "iekf",
    "ckf",
    "sr_ukf",
    "ud_ekf",
    "srif",
    "two_step",
    "adaptive_two_step",
    "particle",
    "unscented_particle",
    "gp_presets",
    "huber",
    "mckf",
    "student_t",
    "gaussian_sum",
    "imm",
    "batch_least_squares",
)
_KINDS: dict[str, FilterKind] = {}


@dataclass(frozen=True)
class FilterKind:
    """A registered filter.

    Args:
        name: The name that campaigns and `create_filter` use.
        options_model: Its options, a pydantic model.
        factory: ``factory(dynamics, measurement, options) -> Filter``.
        measurement: The form of the measurements that it takes unless the campaign says otherwise.
        cost_us: Rough CPU time per filter step and run, for planning, us.
        learned_dynamics: Whether campaigns may give it learned dynamics only.
        overhead_us: Rough CPU time per filter step however few the runs, for planning, us.
        linear_only: Whether its measurements must be linear in the state; campaigns refuse it others.
        operations: Its operations and bytes at an epoch, by size and options; None: not stated.
    """

    name: str
    options_model: type[Options]
    factory: Callable[[Dynamics, Measurement, Any], Filter]
    measurement: MeasurementKind
    cost_us: float
    learned_dynamics: bool = False
    overhead_us: float = 200.0
    linear_only: bool = False
    operations: Formula | None = None

    @property
    def considers(self) -> bool:
        """Whether it can account for states without estimating them: `considers` of its class."""
        return bool(getattr(self.factory, "considers", False))

    @property
    def matches_covariance(self) -> bool:
        """Whether its process noise can be found during a run: `matches_covariance` of its class."""
        return bool(getattr(self.factory, "matches_covariance", False))

    @property
    def in_single(self) -> bool:
        """Whether it can compute in float32: its options have `arithmetic`."""
        return "arithmetic" in self.options_model.model_fields

    @property
    def repeats(self) -> bool:
        """Whether it passes over all measurements of a run again and again: its class says how long by `settled`."""
        return hasattr(self.factory, "settled")

    @property
    def smooths(self) -> bool:
        """Whether a smoother can go back over its estimates: its class says by which linear step it has predicted."""
        return hasattr(self.factory, "linear_step")

    @property
    def edits(self) -> bool:
        """Whether its measurements can be edited by their NIS: `edits` of its class."""
        return bool(getattr(self.factory, "edits", False))

    @property
    def description(self) -> str:
        """What the filter is: the docstring of its class."""
        return inspect.getdoc(self.factory) or ""


def register_filter(
    name: str,
    options_model: type[Options],
    measurement: MeasurementKind | Literal["polar"] = "spherical",
    cost_us: float = 3.0,
    learned_dynamics: bool = False,
    overhead_us: float = 200.0,
    linear_only: bool = False,
    operations: Formula | None = None,
) -> Callable[[C], C]:
    """Return a decorator that registers a filter class under `name`.

    Args:
        name: The name in campaigns.
        options_model: Subclass of `relnav_sim.options.Options`.
        measurement: Form of the measurements that it takes by default, ``spherical`` (as they are read; formerly
            ``polar``) or ``cartesian`` (converted to a position).
        cost_us: Rough CPU time per filter step and run, us; only for planning.
        learned_dynamics: Campaigns give it `gp` dynamics by default and may name learned ones only.
        overhead_us: Rough CPU time per filter step however few the runs of a block, us; only for planning.
        linear_only: It needs measurements that are linear in the state; campaigns refuse it others.
        operations: ``operations(size, options)``, its `relnav_sim.filters.operations.Operations` at an epoch. Not that
            of a base class, which may do other things; default: not stated.

    Raises:
        ValueError: Another filter has this name.

    Examples:
        A whole filter of a package of its own is in docs/add-a-filter.md. A name is given once:

        >>> from relnav_sim import register_filter
        >>> from relnav_sim.filters.ekf import ExtendedKalmanFilter
        >>> from relnav_sim.filters.kalman import GaussianFilterOptions
        >>> register_filter("ekf", GaussianFilterOptions)(type("Mine", (ExtendedKalmanFilter,), {}))
        Traceback (most recent call last):
        ValueError: a filter named 'ekf' is registered already
    """

    def register(factory: C) -> C:
        known = _KINDS.get(name)
        if known is not None and known.factory is not factory:
            raise ValueError(f"a filter named {name!r} is registered already")
        form: MeasurementKind = "cartesian" if measurement == "cartesian" else "spherical"
        _KINDS[name] = FilterKind(
            name, options_model, factory, form, cost_us, learned_dynamics, overhead_us, linear_only, operations
        )
        return factory

    return register


@cache
def _load_all() -> None:
    modules = [f"relnav_sim.filters.{module}" for module in _BUILT_IN]
    load_plugins(_KINDS, modules, "relnav.filters")

    def place(kind: FilterKind) -> int:
        return modules.index(kind.factory.__module__) if kind.factory.__module__ in modules else len(modules)

    # In the order above, whichever module somebody has imported first.
    ordered = sorted(_KINDS.values(), key=place)
    _KINDS.clear()
    _KINDS.update((kind.name, kind) for kind in ordered)


def filter_kinds() -> dict[str, FilterKind]:
    """Return every registered filter by name."""
    _load_all()
    return dict(_KINDS)


def create_filter(
    name: str,
    dynamics: Dynamics,
    measurement: Measurement | Mapping[str, Measurement],
    editing: Mapping[str, Any] | None = None,
    process_noise: Mapping[str, Any] | None = None,
    **options: Any,
) -> Filter:
    """Return a filter of the registry.

    The filter asks dynamics and measurement themselves, not copies: a function that is assigned to one of them later
    (``radar.noise = f``) counts from the next run on. What the filter is made for, `angles`, `depends_on`, `states`,
    `whole` and `dimension` of a measurement, stays, and `run_filter` refuses others; so do the two models themselves.

    Args:
        name: A registered name, ``ekf`` say; `relnav list filters` shows them.
        dynamics: How the state moves.
        measurement: What is measured: one measurement, or several sensors by name. The measurements of an epoch are
            then processed one after the other in this order, which for linear measurements is the same as all at once.
        editing: Which measurements are rejected and how the filter recovers, as in a campaign: ``probability``,
            ``scope``, ``max_rejects``, ``action`` (docs/editing.md). A restart is about the present estimate, as
            uncertain as at the start or more. None: every measurement is taken.
        process_noise: What is added to the process noise of the dynamics, position and velocity in RTN, as in a
            campaign: ``adaptive``, ``snc_rtn``, ``acceleration_psd_m2_s3``, ``diagonal`` or ``matrix``, beside the
            chief's ``mean_motion_rad_s`` and ``step_s``, the time between epochs (docs/process-noise.md). What
            ``adaptive`` finds is in the history's ``extras``. None: nothing.
        **options: The filter's options, as in a campaign.

    Raises:
        ValueError: The name is not registered, an option is unknown or out of range, the measurement is none or for
            another number of states, a sensor has no name, or the dynamics have considered states and the filter can't
            do that, or the filter's measurements can't be edited, or its process noise can't be found.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import LinearDynamics, LinearMeasurement, create_filter
        >>> dynamics = LinearDynamics(np.array([[1.0, 1.0], [0.0, 1.0]]), 0.01 * np.eye(2))
        >>> position = LinearMeasurement(np.array([[1.0, 0.0]]), np.eye(1))
        >>> rate = LinearMeasurement(np.array([[0.0, 1.0]]), 0.1 * np.eye(1))
        >>> filter = create_filter("kf", dynamics, {"radar": position, "doppler": rate}, editing={"probability": 0.999})
        >>> filter.measurement.dimension
        2

        Densities that the filter finds during the run, from m^2/s^3 on each axis:

        >>> from relnav_sim import dynamics, measurements, run_filter
        >>> motion = dynamics.cw(mean_motion_rad_s=1.1e-3, step_s=10.0, acceleration_psd_m2_s3=0.0)
        >>> gnss = measurements.relative_gnss(position_sigma_m=0.01)
        >>> start = {"radial_psd_m2_s3": 1e-9, "along_track_psd_m2_s3": 1e-9, "normal_psd_m2_s3": 1e-9}
        >>> noise = {"adaptive": {"start": start}, "mean_motion_rad_s": 1.1e-3, "step_s": 10.0}
        >>> filter = create_filter("ekf", motion, gnss, process_noise=noise)
        >>> z = np.random.default_rng(1).normal(0.0, 0.01, (1, 200, 3))
        >>> history = run_filter(filter, z, np.zeros(6), np.eye(6), step_s=10.0)
        >>> bool(history.extras["radial_psd_m2_s3"][0, -1] < 1e-9)  # this craft rests
        True
    """
    # Here because they build on filters, which are registered above.
    from relnav_sim.filters.covariance_matching import CovarianceMatching
    from relnav_sim.filters.editing import edited

    kinds = filter_kinds()
    if name not in kinds:
        raise ValueError(no_such_plugin("filter", name, kinds))
    kind = kinds[name]
    if "arithmetic" in options and not kind.in_single:
        raise ValueError(f"filter {name!r}: arithmetic: {double_only(name)}")
    checked = _checked(kind.options_model, f"filter {name!r}", options)
    edits = None if editing is None else _checked(EditingOptions, f"filter {name!r}: editing", editing)
    if edits is not None and not kind.edits:
        raise ValueError(f"filter {name!r}: {not_edited(name)}")
    if considered_states(dynamics) and not kind.considers:
        raise ValueError(f"filter {name!r} can't account for states without estimating them")
    moving, attending = read_only(dynamics, ReadOnlyDynamics), _attending(measurement, dynamics.dimension)
    if process_noise is None:
        made = kind.factory(moving, attending, checked)
    else:
        noise = _checked(AddedNoiseOptions, f"filter {name!r}: process_noise", process_noise)
        _check_noise(kind, dynamics, noise)
        system = cw_system(noise.mean_motion_rad_s)
        if noise.adaptive is None:
            Q = process_noise_matrix(noise, system, noise.step_s)
            made = kind.factory(AddedNoise(moving, Q), attending, checked)
        else:
            white = WhiteAcceleration(moving, system, noise.adaptive.start.densities, noise.step_s)
            made = CovarianceMatching(kind.factory(white, attending, checked), white, noise.adaptive.window)
    filter = edited(made, edits, getattr(checked, "gate_probability", None))
    if isinstance(filter, KeepsModels):
        filter.keep_models()
    return filter


def _check_noise(kind: FilterKind, dynamics: Dynamics, noise: AddedNoiseOptions) -> None:
    """Refuse process noise that can't be added.

    Raises:
        ValueError: The dynamics are not of six states, the form is `dmc`, or `adaptive` for another kind of filter.
    """
    what = f"filter {kind.name!r}: process_noise"
    if dynamics.dimension != 6:
        raise ValueError(f"{what} acts on position and velocity, 6 states; the dynamics have {dynamics.dimension}")
    if noise.dmc is not None:
        raise ValueError(
            f"{what}.dmc: its three states are for campaigns; take snc_rtn or adaptive, or dynamics of your own with "
            "these states"
        )
    if noise.adaptive is not None and not kind.matches_covariance:
        raise ValueError(
            f"{what}.adaptive: this filter is not a single Gaussian of position and velocity, whose corrections tell "
            "the process noise; take acceleration_psd_m2_s3 or snc_rtn, or a filter such as ekf or ukf"
        )


def not_edited(kind: str) -> str:
    """Return why a kind of filter has no editing."""
    if filter_kinds()[kind].repeats:
        return (
            f"the {kind} filter has no editing: each measurement is part of the fit that it would be judged by, so its "
            "NIS is not chi-square, and no quantile says which to reject; use a filter of flight (ekf, ukf, ...)"
        )
    return (
        f"the {kind} filter has no editing: its belief is no single Gaussian, so its NIS is not chi-square where the "
        "filter is right, and no quantile says which measurements to reject; use a Gaussian filter (ekf, ukf, ...)"
    )


def double_only(kind: str) -> str:
    """Return why a kind of filter has no `arithmetic`, and which kinds have it."""
    kinds = filter_kinds()
    have = [name for name, known in kinds.items() if known.in_single]
    why = getattr(kinds[kind].factory, "double_only", "its kernels are")
    return (
        f"the {kind} filter computes in float64 only, as {why}; leave the key out, or take a filter that has "
        f"float32: {', '.join(have[:-1])} and {have[-1]}"
    )


M = TypeVar("M", bound=Options)


def _checked(model: type[M], what: str, options: Mapping[str, Any]) -> M:
    """Return options as their model has them.

    Raises:
        ValueError: They are unknown or out of range.
    """
    if not isinstance(options, Mapping):
        raise ValueError(f"{what} is {options!r}; it must be a mapping of options")
    try:
        # Through JSON, so that lists become tuples as they do in a campaign file.
        return model.model_validate_json(json.dumps(dict(options), default=_plain))
    except ValidationError as error:
        problems = "; ".join(
            f"{'.'.join(map(str, item['loc'])) or 'options'}: {item['msg']}" for item in error.errors()
        )
        raise ValueError(f"{what}: {problems}") from None


def _attending(measurement: Measurement | Mapping[str, Measurement], states: int) -> Measurement:
    """Return what a filter measures by, which can be told the channels that are present.

    Raises:
        ValueError: There is no sensor, a name is no text or empty, or a measurement is for another number of states.
    """
    named = measurement if isinstance(measurement, Mapping) else {"": measurement}
    if not named:
        raise ValueError("the mapping of measurements is empty; give at least one sensor")
    guarded: dict[str, Measurement] = {}
    for name, one in named.items():
        if isinstance(measurement, Mapping) and (not isinstance(name, str) or not name):
            raise ValueError(f"{name!r} can't be the name of a sensor; give each measurement a name that is text")
        which = f"of sensor {name!r} " if name else ""
        lacking = [part for part in ("dimension", "predict", "jacobian", "noise") if not hasattr(one, part)]
        if lacking:
            raise ValueError(
                f"the measurement {which}is {type(one).__name__!r} without {', '.join(lacking)}; give a model of "
                "relnav_sim.measurements or a FunctionMeasurement, and several sensors as {name: measurement}"
            )
        measured_states = getattr(one, "states", None)
        if measured_states not in (None, states):
            raise ValueError(
                f"the measurement {which}(columns of H) is for {measured_states} states, the dynamics have {states}"
            )
        guarded[name] = read_only(one, ReadOnlyMeasurement)
    if len(guarded) > 1:
        return SeveralMeasurements(guarded)
    [(name, only)] = guarded.items()
    return PartialMeasurement(only, name)


def _plain(value: object) -> object:
    """Return a NumPy number or array as plain Python."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise ValueError(f"{value!r} is no number, text, list or section")
