"""Measurement editing: a filter rejects measurements that it does not believe, and recovers where it is locked out.

A measurement fails where its NIS nu^T S^-1 nu exceeds a chi-square quantile (Bar-Shalom, Li and Kirubarajan, Estimation
with Applications to Tracking and Navigation, 2001, sec. 5.4); by channel, where nu_i^2 / S_ii does. A filter that has
lost the truth rejects good measurements, and the smaller its covariance the longer: so after N rejections in a row, a
lock-out, something else happens until a measurement passes (Carpenter and D'Souza, NASA/TP-2018-219822, 2018, discuss
the practice).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import (
    Filter,
    Gaussian,
    Innovation,
    KeepsModels,
    WrappedBelief,
    believed_noise,
    considered_states,
    keep_considered,
    where_runs,
)
from relnav_sim.filters.channel_quantile import ChannelQuantile
from relnav_sim.filters.editing_options import EditingOptions
from relnav_sim.filters.kalman import joseph_update
from relnav_sim.measurements.interface import linearised
from relnav_sim.measurements.partial import Sensor, channel_count, present_channels, sensors_of
from relnav_sim.streams import RandomSource

INFLATION = 10.0
"""Factor on the covariance where an option names none."""

Restart = Callable[[str, Gaussian, Step], Gaussian | None]
"""``restart(sensor, belief, step)`` -> where runs start again from that sensor's measurement; else NaN."""


@dataclass(frozen=True)
class EditedBelief(WrappedBelief):
    """A filter's belief, and what was rejected of late; u sensors or channels are judged.

    Attributes:
        inner: The filter's own belief.
        rejects: Failed tests in a row by now, (runs, u).
        since: Epoch of the first of them, (runs, u); -1 where there are none.
    """

    rejects: Integers
    since: Integers


@dataclass(frozen=True)
class _Test:
    """One measurement, judged: its units among all, and which of them were judged and failed, (runs, own units)."""

    units: slice
    judged: Mask
    fails: Mask


class MeasurementEditing(KeepsModels):
    """A Gaussian filter whose measurements are edited.

    Its innovations keep the NIS and likelihood of whole measurements, rejected or not: `rejected` among their extras is
    the share of the measurement that was rejected, and their `edits` count (see `EDITS`).

    Args:
        filter: The filter.
        options: How its measurements are edited.
        restart: Where runs start again, with action restart; None: about their present estimate, as uncertain as they
            started or more, taking the measurement.

    Raises:
        ValueError: Channels are to be judged, and the measurements count as a whole only.
    """

    def __init__(self, filter: Filter, options: EditingOptions, restart: Restart | None = None) -> None:
        from scipy.special import chdtri

        self.dynamics, self.measurement, self.stochastic = filter.dynamics, filter.measurement, filter.stochastic
        self._filter, self._options, self._restart = filter, options, restart
        self._sensors = sensors_of(self.measurement)
        self._by_channel = options.scope == "channel"
        if self._by_channel:
            check_channels(self._sensors)
        self._units = self.measurement.dimension if self._by_channel else len(self._sensors)
        self._quantile = ChannelQuantile(self.measurement, options.probability)
        self._channel_limit = float(chdtri(1, 1 - options.probability))

    def start(self, prior: Gaussian, source: RandomSource) -> EditedBelief:
        """Return the filter's start, with nothing rejected.

        Raises:
            ValueError: The belief is to be restarted or inflated, and holds more than a Gaussian about random numbers.
        """
        inner, runs = self._filter.start(prior, source), len(prior.mean)
        if self._options.action in ("inflate", "restart") and self.stochastic and type(inner) is not Gaussian:
            raise ValueError(
                f"a filter with random numbers and a belief of its own can't {self._options.action}; take action accept"
            )
        self._source, self._wide = source, prior.covariance.copy()
        return EditedBelief(
            inner, np.zeros((runs, self._units), dtype=np.int64), np.full((runs, self._units), -1, dtype=np.int64)
        )

    def predict(self, belief: EditedBelief, step: Step) -> EditedBelief:
        """Return the filter's prediction."""
        return replace(belief, inner=self._filter.predict(belief.inner, step))

    def believed_noise(self, belief: EditedBelief, epoch: int) -> Array | None:
        """Return R with which the filter takes the next measurement; None: the measurement's own."""
        return believed_noise(self._filter, belief.inner, epoch)

    def linear_step(self, belief: EditedBelief, step: Step) -> tuple[Array, Array]:
        """Return the filter's F and Q of the step predicted last."""
        found: tuple[Array, Array] = self._filter.linear_step(belief.inner, step)  # type: ignore[attr-defined]  # a Gaussian filter has it
        return found

    def update(self, belief: EditedBelief, z: Array, step: Step) -> tuple[EditedBelief, Innovation]:
        """Return the filter's update by what passes, and what happened to the measurement."""
        options, present = self._options, present_channels(self.measurement)
        place = self._read_sensor(present)
        taken, innovation = self._filter.update(belief.inner, z, step)
        test = self._test(belief.inner, z, step, innovation, place, present)
        fails, units = test.fails, test.units
        before = belief.rejects[:, units]
        was_locked, locked_anywhere = before >= options.max_rejects, _any(belief.rejects >= options.max_rejects)
        rejects = np.where(test.judged, np.where(fails, before + 1, 0), before)
        since = np.where(fails & (before == 0), step.epoch, np.where(rejects > 0, belief.since[:, units], -1))
        refused = fails & ~was_locked if options.action == "accept" else fails
        acted = _any(fails & ~refused)
        left_out = self._left_out(refused, place, len(z))
        inner = self._without(belief.inner, taken, z, step, refused, place, present)
        if options.action == "inflate":
            acted = _any(refused & (rejects >= options.max_rejects))
            if acted.any():
                wider = Gaussian(inner.mean, inner.covariance * self._widths())
                inner = where_runs(acted, self._begun(wider), inner)
        elif options.action == "restart":
            acted = _any(refused) & locked_anywhere
            if acted.any():
                inner, acted = self._restarted(belief.inner, inner, acted, z, step, place)
        lock_outs = fails & (rejects == options.max_rejects)
        row = np.where(lock_outs, step.epoch - since, 0).max(axis=1)
        all_rejects, all_since = belief.rejects.copy(), belief.since.copy()
        all_rejects[:, units], all_since[:, units] = rejects, since
        if options.action == "restart":
            all_rejects[acted], all_since[acted] = 0, -1  # what was rejected before says nothing of a new start
            refused = refused & ~acted[:, None]
        locked = all_rejects[:, units] >= options.max_rejects
        counts = {
            "tests": test.judged.sum(axis=1),
            "rejected": refused.sum(axis=1),
            "lock_outs": lock_outs.sum(axis=1),
            "actions": acted.astype(np.int64),
            "locked": locked.any(axis=1).astype(np.int64),
            "row_epochs": row,
        }
        share = refused.sum(axis=1) / np.maximum(test.judged.sum(axis=1), 1)
        lost = np.asarray(refused.all(axis=1)) | (acted & (options.action != "accept"))
        return EditedBelief(inner, all_rejects, all_since), replace(
            innovation,
            refused=left_out,
            extras={**innovation.extras, "rejected": share},
            # What a measurement would have done to a run does not count where it is not taken.
            failed={run: why for run, why in innovation.failed.items() if not lost[run]},
            edits=counts,
        )

    def _read_sensor(self, present: Mask | None) -> int:
        """Return the place of the sensor whose measurement this is."""
        if present is None or len(self._sensors) == 1:
            return 0
        channel = int(np.argmax(present.any(axis=0)))
        return next(place for place, one in enumerate(self._sensors) if channel < one.channels.stop)

    def _test(
        self, inner: Any, z: Array, step: Step, innovation: Innovation, place: int, present: Mask | None
    ) -> _Test:
        if not self._by_channel:
            fails = innovation.nis > self._quantile.of_present()
            return _Test(slice(place, place + 1), np.ones((len(z), 1), dtype=bool), fails[:, None])
        own = self._sensors[place].channels
        every = np.ones(z.shape, dtype=bool) if present is None else present
        squares = np.zeros((len(z), own.stop - own.start))
        for place_in, channel in enumerate(range(own.start, own.stop)):
            alone = np.zeros_like(every)
            alone[:, channel] = every[:, channel]
            has: Mask = every[:, channel]
            if not has.any() and not self.stochastic:
                continue
            # With one channel present the filter's own NIS is nu_i^2 / S_ii, whatever its S.
            self.measurement.attend(np.where(has[:, None], alone, every))  # type: ignore[attr-defined]  # checked
            squares[:, place_in] = np.where(has, self._filter.update(inner, z, step)[1].nis, 0.0)
        self.measurement.attend(present)  # type: ignore[attr-defined]
        return _Test(own, every[:, own], (squares > self._channel_limit) & every[:, own])

    def _left_out(self, refused: Mask, place: int, runs: int) -> Mask | None:
        """Return the channels (runs, m) of a measurement that no update takes; None: there are none."""
        if not refused.any():
            return None
        channels = np.zeros((runs, self.measurement.dimension), dtype=bool)
        channels[:, self._sensors[place].channels] = refused
        return channels

    def _without(
        self, inner: Any, taken: Any, z: Array, step: Step, refused: Mask, place: int, present: Mask | None
    ) -> Any:
        """Return the update by what is left of a measurement without its refused channels, or without all of it."""
        # Mixed at every update, so that what lies in memory how does not depend on the block.
        if not self._by_channel or not (refused.any() or self.stochastic):
            return where_runs(~_any(refused), taken, inner)
        own = self._sensors[place].channels
        every = np.ones(z.shape, dtype=bool) if present is None else present
        left = every.copy()
        left[:, own] &= ~refused
        some = _any(left)
        self.measurement.attend(np.where(some[:, None], left, every))  # type: ignore[attr-defined]
        partly, _ = self._filter.update(inner, z, step)
        self.measurement.attend(present)  # type: ignore[attr-defined]
        kept = where_runs(some, partly, inner)
        return where_runs(~_any(refused), taken, kept)

    def _restarted(
        self, predicted: Any, inner: Any, wanted: Mask, z: Array, step: Step, place: int
    ) -> tuple[Any, Mask]:
        """Return the belief with the runs that could start again, and which did.

        They start from the prediction: what passed of the measurement is in the fix too, and must not count twice.
        """
        now = Gaussian(predicted.mean, predicted.covariance)
        given: Gaussian | None
        if self._restart is None:
            given = self._about(now, z, step.epoch)
        else:
            given = self._restart(self._sensors[place].name, now, step)
        if given is None:
            return inner, np.zeros_like(wanted)
        usable = np.isfinite(given.mean.sum(axis=1) + given.covariance.sum(axis=(1, 2)))
        rows = wanted & usable
        # A filter may factor what it is given, all runs together.
        sound = where_runs(rows, given, now)
        return where_runs(rows, self._begun(sound), inner), rows

    def _about(self, belief: Gaussian, z: Array, epoch: int) -> Gaussian:
        """Return a belief about the present one that takes the measurement, as uncertain before it as a run's start.

        Present variances are added to the start's covariance, and both are widened until the measurement is no
        surprise: to a NIS of one for each channel. By the linearised update, which draws no random numbers.
        """
        residual, H, R = linearised(self.measurement, z, belief.mean, epoch)
        variances = np.diagonal(belief.covariance, axis1=1, axis2=2).copy()
        considered = considered_states(self.dynamics)
        variances[:, list(considered)] = 0.0  # the start's covariance holds theirs, which no measurement narrows
        wide = self._wide + variances[:, :, None] * np.eye(variances.shape[1])
        _, innovation = joseph_update(Gaussian(belief.mean, wide), residual, H, R)
        excess = np.sqrt(np.maximum(innovation.nis / np.maximum(channel_count(self.measurement), 1), 1.0))
        factors = np.repeat(excess[:, None], variances.shape[1], axis=1)
        factors[:, list(considered)] = 1.0
        prior = Gaussian(belief.mean, wide * factors[:, :, None] * factors[:, None, :])
        posterior, _ = joseph_update(prior, residual, H, R)
        return keep_considered(prior, posterior, considered)

    def _widths(self) -> Array:
        """Return the factors (n, n) on the covariance of a belief that is inflated."""
        widths = np.full(self.dynamics.dimension, np.sqrt(self._options.inflation or INFLATION))
        widths[list(considered_states(self.dynamics))] = 1.0  # no measurement would ever narrow them again
        factors: Array = widths[:, None] * widths
        return factors

    def _begun(self, gaussian: Gaussian) -> Any:
        """Return the filter's belief of a Gaussian, without starting its random numbers again."""
        return gaussian if self.stochastic else self._filter.start(gaussian, self._source)


def _any(mask: Mask) -> Mask:
    return np.asarray(mask.any(axis=1))


def check_channels(sensors: tuple[Sensor, ...]) -> None:
    """Refuse to judge channels of measurements that count as a whole.

    Raises:
        ValueError: A sensor has such measurements.
    """
    for sensor in sensors:
        if sensor.whole:
            of = f" of {sensor.name}" if sensor.name else ""
            raise ValueError(
                f"scope: channel needs measurements{of} whose channels can be left out one by one; these count as a "
                "whole (a converted position, or a density of the measurement's own): take scope: sensor"
            )


def edited(
    filter: Filter, editing: EditingOptions | None, gate_probability: float | None, restart: Restart | None = None
) -> Filter:
    """Return a filter with its measurements edited, if at all.

    Args:
        filter: The filter.
        editing: How.
        gate_probability: The former way to say `probability` alone.
        restart: As `MeasurementEditing` takes it.

    Raises:
        ValueError: Both are given, or the filter's measurements can't be edited so.
    """
    if gate_probability is not None:
        if editing is not None:
            raise ValueError("give editing and not gate_probability, which is its former name: editing.probability")
        editing = EditingOptions(probability=gate_probability)
    return filter if editing is None else MeasurementEditing(filter, editing, restart)


EDITS: Mapping[str, str] = {
    "tests": "tests made: one for a measurement, or one for each channel present",
    "rejected": "tests failed of measurements or channels that were then left out",
    "lock_outs": "lock-outs that began",
    "actions": "1 where a measurement was taken against its test, the covariance inflated or the run restarted",
    "locked": "1 where the sensor, or a channel of it, is in a lock-out after this measurement",
    "row_epochs": "where a lock-out began: epochs from the first of its rejections to this one",
}
"""The counts of one measurement, each (runs,); 0 where nothing was read."""
