"""The layout of a results file: every dataset named once, with dimensions, units, type and meaning.

Writers, readers, exports and the documentation all take their names from here. A dataset's ``column`` tells how
it becomes flat columns of a table: each dimension in braces is replaced by the label of an entry along it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

from relnav_sim.results.dataset import Dataset as Dataset
from relnav_sim.results.dataset import Dimension as Dimension
from relnav_sim.results.editing_layout import EDITING as EDITING

FORMAT = "relnav result"
SHARD_FORMAT = "relnav shard"
BOUND_FORMAT = "relnav bound"
FORMAT_VERSION = 2
"""The newest that is read: of results and of shards."""

COMPONENTS = ("x", "y", "z", "vx", "vy", "vz")
QUANTITIES = (*COMPONENTS, "r", "v")
NORMS = ("r", "v")
SPANS = ("whole", "settled")
BLOCKS = ("full", "position", "velocity")
BLOCK_SIZES = (6, 3, 3)
LEVELS = (0.5, 0.9, 0.95, 0.99, 0.9999)
PROBABILITIES = (0.5, 0.95, 0.99, 0.997)
THRESHOLDS_M = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)

FIXED = "text"
"""The type of texts of one length in the file, which are read at once however many there are."""
TEXTS = ("str", FIXED)

FACTOR = tuple(f"{row},{column}" for i, row in enumerate(COMPONENTS) for column in COMPONENTS[: i + 1])
"""Entries of the lower triangle of a 6 x 6 matrix, row by row: ``x,x``, ``y,x``, ``y,y``, ..."""

LAGS = tuple(float(lag) for lag in range(21))
"""Lags of the autocorrelation of residuals, in measurements."""

STATE_UNITS = "m; m/s"
_STATE_NOTE = "(m for x y z, m/s for vx vy vz)"
_QUANTITY_NOTE = "(m for x y z r, m/s for vx vy vz v)"


DIMENSIONS = {
    dimension.name: dimension
    for dimension in (
        Dimension("run", "<i8", "1", "number of the run in the campaign, from 0"),
        Dimension("time", "<f8", "s", "time since the start of the run"),
        Dimension("trajectory", "<i8", "1", "run that flew this truth; -1: all runs share it"),
        Dimension("component", "str", "", "component of the relative state, RTN axes of the chief", COMPONENTS),
        Dimension("factor", "str", "", "entry of a lower-triangular 6 x 6 matrix by row and column", FACTOR),
        Dimension("quantity", "str", "", "component of the error, or norm: r position, v velocity", QUANTITIES),
        Dimension("norm", "str", "", "norm of the error: r position, v velocity", NORMS),
        Dimension("span", "str", "", "whole: every epoch after the start; settled: steady state, t >= settle_s", SPANS),
        Dimension("block", "str", "", "part of the state that is tested against its covariance", BLOCKS),
        Dimension("level", "<f8", "1", "probability that the error ellipsoid should hold", LEVELS),
        Dimension("probability", "<f8", "1", "probability of the quantile", PROBABILITIES),
        Dimension("threshold", "<f8", "m", "position error that a run has to stay below", THRESHOLDS_M),
        Dimension("diagnostic", "str", "", "what a filter reports of its own working, by the name it gives"),
        Dimension("extra", "str", "", "state that the filter carries behind position and velocity, by its name"),
        Dimension("sensor", "str", "", "sensor whose measurements the filter takes, by its name in the campaign"),
        Dimension("edited", "str", "", "sensor whose measurements the filter edits, by its name in the campaign"),
        Dimension("channel", "str", "", "channel of a sensor as the filter takes its measurements: sensor and channel"),
        Dimension("lag", "<f8", "1", "distance between residuals, measurements of the channel", LAGS),
        Dimension("state", "str", "", "state that the filter estimates: position, velocity, augmented states by name"),
        Dimension("case", "<i8", "1", "number of the case, from 0"),
        Dimension("bound_case", "<i8", "1", "number of the case that the bound is of, from 0"),
        Dimension("perfect_bound_case", "<i8", "1", "number of the case that the perfect model's bound is of, from 0"),
        Dimension("observed_case", "<i8", "1", "number of the case that the observability is of, from 0"),
        Dimension("failure", "<i8", "1", "number of the failure in this case, from 0"),
    )
}

_F8, _F4, _I8, _I4, _I2, _I1 = "<f8", "<f4", "<i8", "<i4", "<i2", "|i1"
_PER_QUANTITY = ("run", "span", "quantity")
_PER_SPAN = ("run", "span")
_PER_BLOCK = ("run", "span", "block")

SUMMARY = (
    Dataset("failed", ("run",), _I1, "1", "1: the filter or its run failed; statistics end before that", "failed"),
    Dataset("failed_epoch", ("run",), _I8, "1", "first failed epoch; -1: none, or not known", "failed_epoch"),
    Dataset("epochs", _PER_SPAN, _I8, "1", "epochs that the statistics cover", "{span}epochs"),
    Dataset("updates", _PER_SPAN, _I8, "1", "epochs with a measurement", "{span}updates"),
    Dataset(
        "mean", _PER_QUANTITY, _F8, STATE_UNITS,
        f"mean over epochs of the error, estimate minus truth {_QUANTITY_NOTE}", "{span}{quantity}_mean_{unit}",
    ),
    Dataset(
        "std", _PER_QUANTITY, _F8, STATE_UNITS,
        f"standard deviation over epochs of the error, divisor n {_QUANTITY_NOTE}", "{span}{quantity}_std_{unit}",
    ),
    Dataset(
        "rms", _PER_QUANTITY, _F8, STATE_UNITS,
        f"root mean square over epochs of the error {_QUANTITY_NOTE}", "{span}{quantity}_rms_{unit}",
    ),
    Dataset(
        "max", _PER_QUANTITY, _F8, STATE_UNITS,
        f"largest absolute error over epochs {_QUANTITY_NOTE}", "{span}{quantity}_max_{unit}",
    ),
    Dataset(
        "quantile", ("run", "span", "norm", "probability"), _F8, STATE_UNITS,
        "smallest |position error| and |velocity error| that this share of epochs does not exceed; from counts in "
        "logarithmic bins, off by at most their relative width, 1/32", "{span}{norm}_{probability}_{unit}",
    ),
    Dataset(
        "anees", _PER_BLOCK, _F8, "1",
        "mean over epochs of e^T P^-1 e divided by the dimension; 1 when consistent", "{span}{block}anees",
    ),
    Dataset(
        "coverage", (*_PER_BLOCK, "level"), _F8, "1",
        "share of epochs with the error inside the ellipsoid of this probability", "{span}{block}coverage_{level}",
    ),
    Dataset(
        "outside_late", ("run",), _F8, "1",
        "share of the epochs in the last half of the run with e^T P^-1 e beyond its 0.9999 quantile", "outside_late",
    ),
    Dataset(
        "nis_mean", _PER_SPAN, _F8, "1",
        "mean over updates of the normalised innovation squared; the measurement's dimension when consistent",
        "{span}nis_mean",
    ),
    Dataset(
        "nis_lag1", _PER_SPAN, _F8, "1",
        "autocorrelation of the NIS between successive updates; 0 when consistent", "{span}nis_lag1",
    ),
    Dataset(
        "log_likelihood", _PER_SPAN, _F8, "1",
        "sum over epochs of the log likelihood of the measurements", "{span}log_likelihood",
    ),
    Dataset(
        "convergence", ("run",), _F8, "s",
        "first time from which |position error| stays below convergence_m for convergence_hold_s; NaN: never",
        "convergence_s",
    ),
    Dataset(
        "convergence_relative", ("run",), _F8, "s",
        "first time from which |position error| stays for convergence_hold_s below 3 times its steady-state rms, "
        "rounded up by at most 1/32 to a bin edge; NaN: never", "convergence_relative_s",
    ),
    Dataset(
        "convergence_final", ("run",), _F8, "s",
        "first time from which |position error| stays below convergence_m to the end; NaN: never",
        "convergence_final_s",
    ),
    Dataset(
        "convergence_level", ("run", "threshold"), _F8, "s",
        "first time from which |position error| stays below the threshold for convergence_hold_s; NaN: never",
        "convergence_{threshold}_s",
    ),
    Dataset(
        "cpu_per_step", ("run",), _F8, "us", "CPU time of the filter per run and epoch, mean of its block",
        "cpu_us_per_step", timing=True,
    ),
)  # fmt: skip

SERIES = (
    Dataset(
        "error", ("run", "time", "component"), _F4, STATE_UNITS,
        f"error, estimate minus truth, RTN; NaN once failed {_STATE_NOTE}",
    ),
    Dataset(
        "sigma", ("run", "time", "component"), _F4, STATE_UNITS,
        f"standard deviation that the filter states {_STATE_NOTE}",
    ),
    Dataset("nis", ("run", "time"), _F4, "1", "normalised innovation squared; NaN: no measurement"),
    Dataset("nees", ("run", "time"), _F4, "1", "normalised estimation error squared e^T P^-1 e, 6 components"),
)  # fmt: skip

COVARIANCE = Dataset(
    "covariance_root", ("run", "time", "factor"), _F4, STATE_UNITS,
    "lower-triangular Cholesky factor L of the covariance that the filter states of position and velocity, P = L L^T; "
    "NaN once failed (m in the rows of x y z, m/s in those of vx vy vz)",
)  # fmt: skip
"""Only where the campaign stores covariances (``clock.store_covariance``)."""

DIAGNOSTICS = Dataset(
    "diagnostics", ("run", "diagnostic"), _F8, "1",
    "mean over updates of a number that the filter reports of its own working; of a flag, the share of updates; "
    "NaN: never reported",
)  # fmt: skip
"""Beside the other statistics, and only where the filter reports any: which ones is the filter's affair."""

AUGMENTED_UNIT = Dataset(
    "extra_unit", ("extra",), "str", "", "unit of the augmented state, and of all figures about it"
)
AUGMENTED = (
    Dataset(
        "extra_mean", (*_PER_SPAN, "extra"), _F8, "see extra_unit",
        "mean over epochs of the error of the augmented state, estimate minus truth; NaN where the truth is not known",
    ),
    Dataset(
        "extra_rms", (*_PER_SPAN, "extra"), _F8, "see extra_unit",
        "root mean square over epochs of the error of the augmented state; NaN where the truth is not known",
    ),
    Dataset("extra_estimate", ("run", "time", "extra"), _F4, "see extra_unit", "estimate of the augmented state"),
    Dataset(
        "extra_error", ("run", "time", "extra"), _F4, "see extra_unit",
        "error of the augmented state, estimate minus truth; NaN where the truth is not known",
    ),
    Dataset(
        "extra_sigma", ("run", "time", "extra"), _F4, "see extra_unit",
        "formal standard deviation of the augmented state",
    ),
)  # fmt: skip
"""Only where the filter carries states behind position and velocity."""

BY_SENSOR = (
    Dataset(
        "sensor_nis_sum", (*_PER_SPAN, "sensor"), _F8, "1",
        "sum over the sensor's updates of its normalised innovation squared; chi-square with sensor_dof_sum degrees of "
        "freedom when consistent", "{span}nis_sum_{sensor}",
    ),
    Dataset(
        "sensor_dof_sum", (*_PER_SPAN, "sensor"), _I8, "1",
        "sum over the sensor's updates of the channels that were present", "{span}dof_sum_{sensor}",
    ),
    Dataset(
        "sensor_updates", (*_PER_SPAN, "sensor"), _I8, "1", "epochs with a measurement of the sensor",
        "{span}updates_{sensor}",
    ),
    Dataset(
        "sensor_nis_lag1", (*_PER_SPAN, "sensor"), _F8, "1",
        "autocorrelation of the sensor's NIS between its successive updates, brought to common degrees of freedom; 0 "
        "when consistent", "{span}nis_lag1_{sensor}",
    ),
    Dataset(
        "sensor_nis", ("run", "time", "sensor"), _F4, "1",
        "normalised innovation squared of the sensor; NaN: no measurement",
    ),
    Dataset(
        "sensor_dof", ("run", "time", "sensor"), _I2, "1",
        "degrees of freedom of that NIS: channels that were present; 0: no measurement",
    ),
    Dataset(
        "sensor_readings", ("run", "time", "sensor"), _I4, "1",
        "epochs with a measurement of the sensor since the stored epoch before, this one included",
    ),
)  # fmt: skip
"""Where the filter's history tells its measurements by sensor; not in files of relnav 0.1."""
BY_CHANNEL = (
    Dataset(
        "channel_count", (*_PER_SPAN, "channel"), _I8, "1", "measurements of the channel; 0: none",
    ),
    Dataset(
        "channel_mean", (*_PER_SPAN, "channel"), _F8, "1",
        "mean over measurements of the residual in formal sigmas, z - h(prediction) over the root of its variance; 0 "
        "when consistent",
    ),
    Dataset(
        "channel_product", (*_PER_SPAN, "channel", "lag"), _F8, "1",
        "mean over pairs of the product of residuals in formal sigmas so many measurements apart; when consistent 1 at "
        "lag 0, else 0; NaN without a pair",
    ),
)  # fmt: skip
"""Only where the campaign asks for it (``statistics.whiteness``)."""
FORMER_DOF = 3
"""Degrees of freedom of every NIS in files that do not tell them: those of a radar, the only relative sensor then."""

TRUTH = Dataset(
    "truth", ("trajectory", "time", "component"), _F8, STATE_UNITS,
    f"true state of the deputy relative to the chief, RTN {_STATE_NOTE}",
)  # fmt: skip

BOUND = Dataset(
    "bound", ("time", "quantity"), _F8, STATE_UNITS,
    "posterior Cramer-Rao bound on the rms error over runs under the white part of the noise: beside the truth of a "
    f"perfect model that goes by all sensors, in a filter's group of its own model, process noise and sensors "
    f"{_QUANTITY_NOTE}",
)  # fmt: skip

PERFECT_BOUND = Dataset(
    "perfect_bound", BOUND.dims, _F8, STATE_UNITS,
    f"the same bound of a perfect model that goes by the filter's sensors {_QUANTITY_NOTE}",
)  # fmt: skip
"""Only in the group of a filter that goes by some of the sensors."""

OBSERVABILITY = (
    Dataset(
        "observability", ("time",), _F8, "1",
        "posterior over prior sigma in the direction of position and velocity of which the measurements so far tell "
        "least; 1: nothing",
    ),
    Dataset(
        "weakest_direction", ("state",), _F8, "1",
        "that direction at the end, as a change of the state at the start in its prior sigmas; of unit length over "
        "position and velocity",
    ),
    Dataset(
        "sigma_ratio", ("state",), _F8, "1", "posterior over prior sigma of each state, from all measurements",
    ),
)  # fmt: skip
"""Of filters whose observability is known; the attributes ``sensors``, ``blind`` (number of directions that are not
observable), ``weakest`` (the direction in words) and ``course`` (the same over time) of the group go with it."""

LIMITS = (BOUND, PERFECT_BOUND, *OBSERVABILITY)
"""What a case's group or a filter's may hold of what measurements can tell at most."""

FAILURES = (
    Dataset("run", ("failure",), _I8, "1", "run that failed"),
    Dataset("epoch", ("failure",), _I8, "1", "first failed epoch; -1: not known"),
    Dataset("filter", ("failure",), "str", "", "filter that failed; empty: the whole run"),
    Dataset("reason", ("failure",), "str", "", "why, in words"),
)

FILTER = (*SUMMARY, *SERIES)
"""What every filter's group holds."""
OWN = (COVARIANCE, DIAGNOSTICS, *BY_SENSOR, *EDITING, *BY_CHANNEL, AUGMENTED_UNIT, *AUGMENTED)
"""What some hold besides."""

SPAN_PREFIXES = ("", "settled_")
"""How column names tell the spans apart."""
_LABELS = {
    "span": SPAN_PREFIXES,
    "quantity": QUANTITIES,
    "norm": NORMS,
    "block": ("", "position_", "velocity_"),
    "level": ("50", "90", "95", "99", "9999"),
    "threshold": tuple(f"{threshold:g}m" for threshold in THRESHOLDS_M),
    "probability": ("median", "p95", "p99", "p997"),
}


def case_group(index: int) -> str:
    """Return the name of a case's group."""
    return f"case_{index:03d}"


@dataclass(frozen=True)
class Columns:
    """What a filter's group holds beyond what all of them hold.

    Attributes:
        diagnostics: Names of what the filter reports of its own working.
        augmented: Names of its augmented states.
        augmented_units: Their units.
        sensors: Names of the sensors that its statistics are told by; empty where they are not.
        edited: Names of the sensors whose measurements it edits.
        factor: Names of the entries of its covariances' roots, `FACTOR`; empty where they are not stored.
        channels: Channels whose residuals its statistics are told by; empty where they are not.
    """

    diagnostics: tuple[str, ...] = ()
    augmented: tuple[str, ...] = ()
    augmented_units: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    edited: tuple[str, ...] = ()
    factor: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()

    @property
    def datasets(self) -> tuple[Dataset, ...]:
        """The datasets of the group that have a row for each run."""
        held = (
            ((COVARIANCE,), self.factor),
            ((DIAGNOSTICS,), self.diagnostics),
            (BY_SENSOR, self.sensors),
            (EDITING, self.edited),
            (BY_CHANNEL, self.channels),
            (AUGMENTED, self.augmented),
        )
        return (*FILTER, *(spec for specs, names in held if names for spec in specs))

    @property
    def labels(self) -> dict[str, tuple[str, ...]]:
        """The entries along the dimensions that these names make."""
        return {
            "diagnostic": self.diagnostics,
            "extra": self.augmented,
            "sensor": self.sensors,
            "edited": self.edited,
            "channel": self.channels,
        }

    @property
    def lengths(self) -> dict[str, int]:
        """The lengths of these dimensions."""
        return {name: len(labels) for name, labels in self.labels.items()}


NO_COLUMNS = Columns()


def quantity_unit(quantity: str) -> str:
    """Return the unit of a component or norm as it stands in column names: ``m`` or ``m_s``."""
    return "m_s" if quantity.startswith("v") else "m"


def columns(dataset: Dataset) -> Iterator[tuple[str, tuple[int, ...]]]:
    """Yield the flat columns of a summary dataset: name, and index behind the run axis."""
    dims = dataset.dims[1:]
    for index in itertools.product(*(range(len(_LABELS[dim])) for dim in dims)):
        labels = {dim: _LABELS[dim][i] for dim, i in zip(dims, index, strict=True)}
        quantity = labels.get("quantity", labels.get("norm", ""))
        yield dataset.column.format(**labels, unit=quantity_unit(quantity)), index


def sizes(runs: int, times: int, trajectories: int = 1) -> dict[str, int]:
    """Return the length of every dimension for so many runs, stored epochs and truths."""
    fixed = {name: len(d.values) for name, d in DIMENSIONS.items() if d.values is not None}
    return fixed | {"run": runs, "time": times, "trajectory": trajectories}


def shape(dataset: Dataset, lengths: dict[str, int]) -> tuple[int, ...]:
    """Return the shape of a dataset for the given lengths of the dimensions."""
    return tuple([lengths[dim] for dim in dataset.dims])
