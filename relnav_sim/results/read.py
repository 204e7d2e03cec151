"""Reading a results file: labelled columns and series, nothing to know about HDF5."""

from __future__ import annotations

import importlib.util
import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from relnav_sim.arrays import Array, Integers
from relnav_sim.measurements.channel import Channel
from relnav_sim.results import layout, store
from relnav_sim.results.block import AugmentedStates, BySensor, Editing, Failure, RefusedError, ResultsError
from relnav_sim.results.by_channel import ByChannel
from relnav_sim.results.covariance_root import covariances
from relnav_sim.results.editing_columns import editing_columns
from relnav_sim.results.header import read_header
from relnav_sim.results.observability import Observability
from relnav_sim.results.settings import filter_settings
from relnav_sim.results.stored_cases import StoredCases, StoredPart

if TYPE_CHECKING:
    import xarray

_SERIES = {spec.name: spec for spec in layout.SERIES}
_BY_SENSOR = {spec.name: spec for spec in layout.BY_SENSOR}


@dataclass(frozen=True)
class Series:
    """One run of one filter at the stored epochs.

    Attributes:
        case: Label of the case.
        filter: Name of the filter.
        run: Number of the run.
        time_s: Stored epochs (K,), s.
        error: Estimate minus truth, RTN, (K, 6), m and m/s; NaN once the filter failed.
        sigma: Standard deviations that the filter states, (K, 6).
        nis: Normalised innovation squared (K,); NaN without a measurement.
        nees: Normalised estimation error squared (K,).
        truth: True relative state, RTN, (K, 6).
        covariance: Formal covariance of position and velocity, RTN, (K, 6, 6); None where the file holds none.
        nis_by: NIS of each sensor's readings (K,), by its name; empty where the file does not tell them apart.
        dof_by: Its degrees of freedom (K,); 0 without a reading.
    """

    case: str
    filter: str
    run: int
    time_s: Array
    error: Array
    sigma: Array
    nis: Array
    nees: Array
    truth: Array
    nis_by: Mapping[str, Array] = field(default_factory=dict)
    dof_by: Mapping[str, Array] = field(default_factory=dict)
    covariance: Array | None = None


class Results:
    """An open results file; close it, or use it in a ``with`` statement.

    Wherever a case is asked for, its number, its label or its id will do. Arrays hold one row per run, in the
    order of `case_runs`.

    Attributes:
        path: The file.
        header: What the file says of its campaign, in one piece; the attributes below are its parts.
        campaign_name: Name of the campaign.
        campaign_text: The campaign file, word for word.
        campaign_content: Its validated content with all defaults.
        campaign_hash: Hash of the content.
        seed: Seed of the campaign.
        planned_runs: Number of runs the campaign asked for.
        planned: Their numbers: 0, 1, 2, ...; a single one in a file of ``relnav run --only``; of recorded readings
            those of the recorded runs.
        replay: Where the readings were recorded: their ``files`` with SHA-256, and the ``truth`` that estimates are
            scored against; None: they were simulated.
        stopping: The rule of adaptive stopping (``metric``, ``half_width``, ``at``, ``filter``) with the number of
            runs ``reached`` and whether the rule was ``met``; empty without one.
        headers: The cases with id, label, swept variables and filter names.
        cases: Labels of the cases, in order.
        filters: Names of all filters, in order.
        constants: Constants of the models by name.
        provenance: Versions, source revision, machine, times, command.
        sealed: Whether the file has a checksum over all its bytes, which then agrees; files of relnav before 0.1.1
            have none.

    Examples:
        >>> from relnav_sim import open_results
        >>> with open_results("results/demo.h5") as results:
        ...     summary = results.summary()
        ...     one = results.series(case=0, filter="ekf", run=0)
        >>> summary["settled_r_rms_m"].shape == summary["run"].shape, one.error.shape[1]
        (True, 6)
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = store.open_checked(path, layout.FORMAT, whole=True)
        try:
            header, self.provenance = read_header(self._file)
            self.sealed = store.is_sealed(self._file)
            self._stored = StoredCases(self._file)
        except ResultsError:
            self._file.close()
            raise
        self.header = header
        self.campaign_name = header.campaign_name
        self.campaign_text = header.text
        self.campaign_content = dict(header.content)
        self.campaign_hash = header.hash
        self.seed = header.seed
        self.planned_runs = len(header.planned)
        self.planned = header.planned
        self.stopping = dict(header.stopping)
        self.replay = header.replay
        self.constants = dict(header.constants)
        self.headers = header.cases
        self.cases = tuple(case.label for case in header.cases)
        self._places: dict[int | str, int] = {index: index for index in range(len(self.headers))}
        for index, one in enumerate(self.headers):
            self._places.setdefault(one.label, index)
            self._places.setdefault(one.id, index)
        self.filters = tuple(dict.fromkeys(name for case in header.cases for name in case.filters))

    def __enter__(self) -> Results:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    @property
    def runs(self) -> tuple[int, ...]:
        """Numbers of the runs that any case and filter holds."""
        held = {run for i, case in enumerate(self.headers) for name in case.filters for run in self.case_runs(i, name)}
        return tuple(sorted(held))

    @cached_property
    def holds_covariances(self) -> bool:
        """Whether `covariance` returns any: the campaign asked for them (``clock.store_covariance``)."""
        return any(
            bool(self._filter_part(index, name).columns().factor)
            for index, case in enumerate(self.headers)
            for name in case.filters
            if len(self.case_runs(index, name))
        )

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors that any filter's statistics are told by, in order; none in files of relnav 0.1."""
        found: dict[str, None] = {}
        for index, case in enumerate(self.headers):
            for name in case.filters:
                if len(self.case_runs(index, name)):
                    found |= dict.fromkeys(self._filter_part(index, name).columns().sensors)
        return tuple(found)

    @property
    def nominal(self) -> tuple[int, ...]:
        """Numbers of the cases without a stress; all where no other is held, as by a single run of a stressed case."""
        everything = range(len(self.headers))
        return tuple(index for index in everything if not self.headers[index].stress) or tuple(everything)

    def stressed(self, case: int | str) -> dict[str, int]:
        """Return the numbers of the stressed cases of a case, by the name of the stress."""
        own = self.headers[self.case_index(case)].id
        return {header.stress: index for index, header in enumerate(self.headers) if header.nominal == own}

    def variables(self, case: int | str) -> dict[str, Any]:
        """Return the swept values of a case, by their path in the campaign."""
        return dict(self.headers[self.case_index(case)].variables)

    def case_index(self, case: int | str) -> int:
        """Return the number of the case with this number, label or id.

        Raises:
            RefusedError: There is none.
        """
        if case in self._places:
            return self._places[case]
        raise RefusedError(f"{self.path}: no case {case!r}; there are {', '.join(map(repr, self.cases))}")

    def case_runs(self, case: int | str, filter: str) -> Integers:
        """Return the numbers of the runs of a case and filter; empty where none has been computed yet."""
        index = self._check(case, filter)
        own, case_part, axis = self._stored.filter(index, filter), self._stored.case(index), layout.DIMENSIONS["time"]
        if own is None or case_part is None:
            return np.empty(0, dtype=np.int64)
        runs = own.read(layout.DIMENSIONS["run"])
        # Other programs read a filter's series against its own axis.
        if not np.array_equal(own.read(axis), case_part.read(axis)):
            here, there = own.group.name, case_part.group.name
            raise ResultsError(f"{self.path}: {here}/time differs from {there}/time; the file is damaged")
        if len(runs) and runs[-1] > self.planned[-1]:
            raise ResultsError(f"{self.path}: {own.group.name} has run {runs[-1]} of {self.header.runs}")
        return runs

    def missing(self) -> dict[tuple[str, str], tuple[int, ...]]:
        """Return the planned runs that the file does not hold, by case label and filter; empty when finished."""
        missing = {}
        everything = tuple(self.planned)  # once: of a file that holds nothing it is said of every filter
        for index, case in enumerate(self.headers):
            for name in case.filters:
                held = set(self.case_runs(index, name).tolist())
                absent = tuple(run for run in everything if run not in held) if held else everything
                if absent:
                    missing[case.label, name] = absent
        return missing

    def summary(self) -> dict[str, NDArray[Any]]:
        """Return the per-run statistics as flat columns.

        Rows are case x filter x run in order. Columns: ``case`` (number), ``case_label``, ``filter``, ``run``,
        ``failed``, ``failed_epoch``, then those of docs/results-file.md, for example ``r_rms_m``,
        ``settled_x_mean_m``, ``convergence_s``, ``anees``, ``coverage_95``, ``cpu_us_per_step``. Where cases are
        stressed, ``stress`` names what each was flown under, empty for none.
        """
        stress = ("stress",) if any(header.stress for header in self.headers) else ()
        names = ("case", "case_label", *stress, "filter", "run")
        columns: dict[str, list[NDArray[Any]]] = {name: [] for name in names}
        for index, case in enumerate(self.headers):
            for name in case.filters:
                runs = self.case_runs(index, name)
                columns["case"].append(np.full(len(runs), index))
                columns["case_label"].append(np.full(len(runs), case.label))
                for column in stress:
                    columns[column].append(np.full(len(runs), case.stress))
                columns["filter"].append(np.full(len(runs), name))
                columns["run"].append(runs)
                for spec in layout.SUMMARY:
                    data = self._filter_data(index, name, spec) if len(runs) else None
                    for column, place in layout.columns(spec):
                        where: tuple[Any, ...] = (slice(None), *place)
                        part = np.empty(0, dtype=spec.dtype) if data is None else data[where]
                        columns.setdefault(column, []).append(part)
        summary = {name: np.concatenate(parts) for name, parts in columns.items() if parts}
        summary |= self._diagnostic_columns() | self._sensor_columns()
        summary |= editing_columns(
            [
                (len(runs), self.editing(index, name))
                for index, case in enumerate(self.headers)
                for name in case.filters
                if len(runs := self.case_runs(index, name))
            ]
        )
        if "failed" in summary:
            summary["failed"] = summary["failed"].astype(bool)
        return summary

    def _diagnostic_columns(self) -> dict[str, Array]:
        """Return what any filter reports as columns ``diagnostic_<name>``; NaN for the filters that do not."""
        held = [
            (len(runs), self.diagnostics(index, name))
            for index, case in enumerate(self.headers)
            for name in case.filters
            if len(runs := self.case_runs(index, name))
        ]
        names = sorted({name for _, reported in held for name in reported})
        return {
            f"diagnostic_{name}": np.concatenate([found.get(name, np.full(runs, np.nan)) for runs, found in held])
            for name in names
        }

    def _sensor_columns(self) -> dict[str, Array]:
        """Return what the filters' sensors gave as columns ``nis_sum_<sensor>`` and the like; NaN for other filters."""
        held = [
            (len(runs), self.by_sensor(index, name))
            for index, case in enumerate(self.headers)
            for name in case.filters
            if len(runs := self.case_runs(index, name))
        ]
        columns: dict[str, Array] = {}
        for sensor, spec in itertools.product(self.sensors, (spec for spec in layout.BY_SENSOR if spec.column)):
            for span, prefix in enumerate(layout.SPAN_PREFIXES):
                columns[spec.column.format(span=prefix, sensor=sensor)] = np.concatenate(
                    [
                        np.full(runs, np.nan) if found is None else found.of(spec, sensor, runs)[:, span]
                        for runs, found in held
                    ]
                )
        return columns

    def statistic(self, case: int | str, filter: str, name: str) -> NDArray[Any]:
        """Return one dataset of `layout.SUMMARY` as stored, for example ``rms`` (runs, 2 spans, 8 quantities)."""
        specs = {spec.name: spec for spec in layout.SUMMARY}
        if name not in specs:
            raise ResultsError(f"no statistic {name!r}; there are {', '.join(specs)}")
        return self._filter_data(self._check(case, filter), filter, specs[name])

    def diagnostics(self, case: int | str, filter: str) -> dict[str, Array]:
        """Return what a filter reports of its own working, by name: mean over updates of each run (runs,).

        For example ``rejected`` (share of readings that were rejected), ``ess`` or ``alpha``; empty where the
        filter reports nothing. NaN: never reported in that run.
        """
        index = self._check(case, filter)
        names = self._filter_part(index, filter).columns().diagnostics
        if not names:
            return {}
        stored = self._filter_data(index, filter, layout.DIAGNOSTICS)
        return {name: stored[:, i] for i, name in enumerate(names)}

    def augmented(self, case: int | str, filter: str) -> AugmentedStates | None:
        """Return what a filter found out about its augmented states; None where it carries none."""
        index = self._check(case, filter)
        columns = self._filter_part(index, filter).columns()
        specs = layout.AUGMENTED if columns.augmented else ()
        parts = {spec.name: self._filter_data(index, filter, spec).astype(np.float64) for spec in specs}
        return AugmentedStates.of_arrays(columns, parts)

    def channels(self, case: int | str) -> Mapping[str, tuple[Channel, ...]]:
        """Return what a reading of each sensor of a case consists of, by the sensor's name.

        Empty in files of relnav 0.1, which had one relative sensor, a radar.
        """
        return self.headers[self.case_index(case)].channels

    def by_sensor(self, case: int | str, filter: str) -> BySensor | None:
        """Return what came of the readings of each of a filter's sensors; None where the file does not tell them apart.

        Files of relnav 0.1 do not.
        """
        index = self._check(case, filter)
        columns = self._filter_part(index, filter).columns()
        specs = layout.BY_SENSOR if columns.sensors else ()
        return BySensor.of_arrays(columns, {spec.name: self._filter_data(index, filter, spec) for spec in specs})

    def editing(self, case: int | str, filter: str) -> Editing | None:
        """Return what came of the editing of a filter's readings; None where there is none."""
        index = self._check(case, filter)
        columns = self._filter_part(index, filter).columns()
        specs = layout.EDITING if columns.edited else ()
        return Editing.of_arrays(columns, {spec.name: self._filter_data(index, filter, spec) for spec in specs})

    def by_channel(self, case: int | str, filter: str) -> ByChannel | None:
        """Return what a filter's residuals say by channel; None where the campaign has no ``statistics.whiteness``."""
        index = self._check(case, filter)
        columns = self._filter_part(index, filter).columns()
        specs = layout.BY_CHANNEL if columns.channels else ()
        return ByChannel.of_arrays(columns, {spec.name: self._filter_data(index, filter, spec) for spec in specs})

    def nis_sum(self, case: int | str, filter: str) -> Array:
        """Return the sum of the NIS over the updates of the whole run and settled, (runs, 2)."""
        by_sensor, updates = self.by_sensor(case, filter), self.statistic(case, filter, "updates")
        former = np.where(updates > 0, self.statistic(case, filter, "nis_mean") * updates, 0.0)
        if by_sensor is None:
            return former
        return np.where(by_sensor.dof_sum.sum(axis=-1) > 0, np.nansum(by_sensor.nis_sum, axis=-1), former)

    def dof_sum(self, case: int | str, filter: str) -> Integers:
        """Return the degrees of freedom of `nis_sum`, the channels that were present, (runs, 2)."""
        by_sensor, updates = self.by_sensor(case, filter), self.statistic(case, filter, "updates")
        told = np.zeros_like(updates) if by_sensor is None else by_sensor.dof_sum.sum(axis=-1)
        return np.where(told > 0, told, layout.FORMER_DOF * updates)

    def dof(self, case: int | str, filter: str) -> Integers:
        """Return the degrees of freedom of `nis`, the channels present, (runs, K); 0 without a measurement."""
        by_sensor, measured = self.by_sensor(case, filter), np.isfinite(self.nis(case, filter))
        told = np.zeros(measured.shape, dtype=np.int64)
        if by_sensor is not None:
            told = by_sensor.dof.sum(axis=-1, dtype=np.int64)
        return np.where(measured & (told == 0), layout.FORMER_DOF, told)

    def time_s(self, case: int | str) -> Array:
        """Return the stored epochs of a case, (K,), s."""
        return self._shared(self.case_index(case), layout.DIMENSIONS["time"])

    def truth(self, case: int | str) -> Array:
        """Return the true relative states of a case, RTN, (runs or 1, K, 6); 1 where all runs share them."""
        return self._shared(self.case_index(case), layout.TRUTH)

    def truth_runs(self, case: int | str) -> Integers:
        """Return which run flew each of the `truth` states, ascending; a single -1 where all runs share them."""
        return self._shared(self.case_index(case), layout.DIMENSIONS["trajectory"])

    def distance(self, case: int | str, filter: str) -> Array:
        """Return the true distance between the spacecraft in each run of a filter, (runs, K), m."""
        index = self._check(case, filter)
        distance = np.linalg.norm(self.truth(index)[..., :3], axis=-1)
        runs, owners = self.case_runs(index, filter), self.truth_runs(index)
        if owners.tolist() == [-1]:
            return np.broadcast_to(distance, (len(runs), distance.shape[1]))
        return np.asarray(distance[np.searchsorted(owners, runs)])

    def error(self, case: int | str, filter: str) -> Array:
        """Return the errors, estimate minus truth, RTN, (runs, K, 6), m and m/s; NaN once a run failed."""
        return self._series(case, filter, "error")

    def sigma(self, case: int | str, filter: str) -> Array:
        """Return the standard deviations that the filter states, (runs, K, 6), m and m/s."""
        return self._series(case, filter, "sigma")

    def covariance(
        self, case: int | str, filter: str, rows: slice = slice(None), epochs: slice = slice(None)
    ) -> Array | None:
        """Return the formal covariances of position and velocity, RTN, (runs, K, 6, 6), m and m/s.

        They are the filter's own, augmented states left out; of filters with particles or several components those of
        the whole estimate. NaN once a run failed.

        Args:
            case: The case.
            filter: The filter.
            rows: Which of the runs, by their place; all together may be large.
            epochs: Which of the stored epochs, by their place.

        Returns:
            None where the file holds none: its campaign did not ask for them (``clock.store_covariance``).

        Examples:
            The correlation of radial position with along-track velocity at the last stored epoch, one number per run::

                P = results.covariance(0, "ekf")[:, -1]
                P[:, 0, 4] / np.sqrt(P[:, 0, 0] * P[:, 4, 4])
        """
        return self._covariances(self._check(case, filter), filter, (rows, epochs))

    def _covariances(self, index: int, filter: str, rows: Any = ...) -> Array | None:
        if not self._filter_part(index, filter).columns().factor:
            return None
        return covariances(self._filter_data(index, filter, layout.COVARIANCE, rows).astype(np.float64))

    def nis(self, case: int | str, filter: str) -> Array:
        """Return the NIS (runs, K); NaN without a measurement."""
        return self._series(case, filter, "nis")

    def nees(self, case: int | str, filter: str) -> Array:
        """Return the normalised estimation errors squared, (runs, K)."""
        return self._series(case, filter, "nees")

    def series(self, case: int | str, filter: str, run: int) -> Series:
        """Return one run of one filter at the stored epochs.

        Raises:
            ResultsError: The file holds no such case, filter or run.
        """
        index = self._check(case, filter)
        rows = np.flatnonzero(self.case_runs(index, filter) == run)
        if len(rows) == 0:
            raise ResultsError(f"{self.path}: case {self.cases[index]!r}, filter {filter!r} has no run {run}")
        row = int(rows[0])
        parts = {name: self._filter_data(index, filter, spec, row).astype(np.float64) for name, spec in _SERIES.items()}
        owners = self.truth_runs(index)
        own = np.flatnonzero((owners == run) | (owners == -1))
        if len(own) == 0:
            raise ResultsError(f"{self.path}: case {self.cases[index]!r} has no truth of run {run}")
        truth = self._shared(index, layout.TRUTH, int(own[0]))
        return Series(
            self.cases[index], filter, run, self.time_s(index), **parts, truth=truth,
            nis_by=self._by_sensor_in(index, filter, row, "sensor_nis"),
            dof_by=self._by_sensor_in(index, filter, row, "sensor_dof"),
            covariance=self._covariances(index, filter, row),
        )  # fmt: skip

    def _by_sensor_in(self, index: int, filter: str, row: int, name: str) -> dict[str, Array]:
        """Return one series by sensor of one run; empty where the file does not tell them apart."""
        sensors = self._filter_part(index, filter).columns().sensors
        if not sensors:
            return {}
        values = self._filter_data(index, filter, _BY_SENSOR[name], row)
        return {sensor: values[:, place].astype(np.float64) for place, sensor in enumerate(sensors)}

    def bound(self, case: int | str, filter: str | None = None) -> Array | None:
        """Return the posterior Cramér-Rao bound on the rms error over runs at the stored epochs, (K, 8).

        Columns are x, y, z, vx, vy, vz and the norms r and v, m and m/s. It counts the white noise of the measurement
        chain only. NaN where no run could start; docs/bound.md says how to read it.

        Args:
            case: The case.
            filter: The filter whose own model, process noise and sensors count; None: a perfect model, without process
                noise, that goes by all sensors of the case.

        Returns:
            None where the file holds no bound.
        """
        part = self._stored.case(self.case_index(case)) if filter is None else self._held(case, filter)
        return None if part is None else part.limit(layout.BOUND)

    def perfect_bound(self, case: int | str, filter: str) -> Array | None:
        """Return the bound of a perfect model that goes by the same sensors as a filter, as `bound` does, (K, 8)."""
        part = self._held(case, filter)
        own = None if part is None else part.limit(layout.PERFECT_BOUND)
        return self.bound(case) if own is None else own

    def observability(self, case: int | str, filter: str) -> Observability | None:
        """Return what the readings of a filter's sensors can tell of the state, None where it is not known."""
        part = self._held(case, filter)
        return None if part is None else part.observability()

    def named_sensors(self, case: int | str, filter: str) -> tuple[str, ...]:
        """Return the names of the sensors that a filter goes by, as the campaign says; empty: all of the case."""
        index = self._check(case, filter)
        named = self.headers[index].variables.get(f"filters.{filter}.sensors")
        named = named or filter_settings(self, index, filter).get("sensors")
        return tuple(map(str, named)) if isinstance(named, list | tuple) else ()

    def failures(self, case: int | str | None = None) -> tuple[tuple[str, Failure], ...]:
        """Return the failures as (case label, failure), of one case or of all."""
        found: list[tuple[str, Failure]] = []
        for index in range(len(self.headers)) if case is None else [self.case_index(case)]:
            found += [(self.cases[index], failure) for failure in self._stored.failures(index)]
        return tuple(found)

    def lacked_memory(self) -> tuple[tuple[str, Failure], ...]:
        """Return those of the failures whose run is missing: for want of memory, and no failure of the filter."""
        missing = self.missing()
        return tuple((case, f) for case, f in self.failures() if f.run in missing.get((case, f.filter), ()))

    def to_xarray(self) -> xarray.DataTree:
        """Return the file as a tree of lazily read xarray datasets, ``tree["case_000/ekf"].ds["rms"]``.

        Raises:
            ResultsError: xarray is not installed.
        """
        if importlib.util.find_spec("xarray") is None:
            raise ResultsError("xarray is not installed; pip install 'relnav-sim[xarray]' brings it")
        from relnav_sim.results.labelled import labelled_tree

        return labelled_tree(self.path, self._file)

    def _shared(self, index: int, spec: layout.Dataset | layout.Dimension, rows: Any = ...) -> NDArray[Any]:
        part = self._stored.case(index)
        if part is None:
            raise ResultsError(f"{self.path}: case {self.cases[index]!r} has no results yet")
        return part.read(spec, rows)

    def _check(self, case: int | str, filter: str) -> int:
        index = self.case_index(case)
        names = self.headers[index].filters
        if filter not in names:
            raise ResultsError(f"{self.path}: no filter {filter!r} in case {self.cases[index]!r}: {', '.join(names)}")
        return index

    def _held(self, case: int | str, filter: str) -> StoredPart | None:
        """Return what is held of a filter; None where none of its runs has been computed yet."""
        return self._stored.filter(self._check(case, filter), filter)

    def _filter_part(self, index: int, filter: str) -> StoredPart:
        part = self._stored.filter(index, filter)
        if part is None:
            raise ResultsError(f"{self.path}: case {self.cases[index]!r}, filter {filter!r} has no run yet")
        return part

    def _filter_data(self, index: int, filter: str, spec: layout.Dataset, rows: Any = ...) -> NDArray[Any]:
        return self._filter_part(index, filter).read(spec, rows)

    def _series(self, case: int | str, filter: str, name: str) -> Array:
        return self._filter_data(self._check(case, filter), filter, _SERIES[name]).astype(np.float64)


def open_results(path: str | Path) -> Results:
    """Open a results file for reading; use it in a ``with`` statement.

    Args:
        path: The file that `run_campaign` or ``relnav run`` wrote.

    Raises:
        ResultsError: The file is missing, damaged, or no relnav result.

    Examples:
        >>> from relnav_sim import open_results
        >>> with open_results("results/demo.h5") as results:
        ...     results.filters, results.cases
        (('kf', 'ekf', 'ukf', 'imm'), ('sensors.radar.noise.kind=gaussian', 'sensors.radar.noise.kind=mixture'))
    """
    return Results(Path(path))
