"""A campaign with every kind of source, and its Monte Carlo with some of them switched on."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from relnav_sim.campaign import Campaign
from relnav_sim.campaign.load import parse_campaign
from relnav_sim.sensors.streams import SensorStreams
from relnav_sim.sensors.suite import streams_of
from relnav_sim.simulation.block import filter_block
from relnav_sim.simulation.chunks import chunks
from relnav_sim.streams import RandomSource, Streams
from relnav_sim.truth import nominal_truth

TEXT = """
name: budgeted
seed: 7
runs: 10
clock: {duration_s: 60, step_s: 1, store_every_s: 5}
truth:
  chief:
    orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 30, argp_deg: 0, ta_deg: 40}
    mass_kg: 200
    area_m2: 1
    drag_coefficient: 2.2
  deputy:
    relative: {position_m: [0, -2000, 100], velocity_m_s: [0.05, 0, 0.1]}
    mass_kg: 100
    area_m2: 1
    drag_coefficient: 2.2
  manoeuvres: {push: {time_s: 20.5, delta_v_m_s: [0, 0.5, 0.2]}}
  execution_errors: {magnitude_sigma_percent: 5, direction_sigma_deg: 2, timing_sigma_s: 0.1}
  dispersions: {relative_velocity: {kind: uniform, half_width_m_s: [0.1, 0, 0]}}
sensors:
  radar:
    range_sigma_m: 2
    angle_sigma_deg: 0.1
    azimuth_bias_deg: 0.02
    noise: [{kind: gaussian}, {kind: gauss_markov, tau_s: 20, scale: 0.5}, {kind: bias, value: [1, 0, 0]}]
  gnss: {position_sigma_m: 300, velocity_sigma_m_s: 3}
  star_tracker: {cross_boresight_sigma_arcsec: 100, about_boresight_sigma_arcsec: 300}
start: {kind: first_fix, velocity_sigma_m_s: 0.5}
filters:
  ekf: {kind: ekf, dynamics: {kind: cw}, process_noise: {acceleration_psd_m2_s3: 1.0e-4}}
  kf: {kind: kf, dynamics: {kind: cw}, process_noise: {acceleration_psd_m2_s3: 1.0e-4}}
  sr_ukf:
    kind: sr_ukf
    dynamics: {kind: nonlinear_j2}
    process_noise: {acceleration_psd_m2_s3: 1.0e-4}
    augment: [{kind: range_bias, sigma_m: 3}]
  huber: {kind: huber, dynamics: {kind: cw}, process_noise: {acceleration_psd_m2_s3: 1.0e-4}}
statistics: {settle_s: 30}
"""


def campaign(*overrides: str) -> Campaign:
    return parse_campaign(TEXT, overrides)


class Number(NamedTuple):
    """One of the numbers that a run draws: its stream (SENSOR.WORD, truth.WORD, start) and its place in it."""

    stream: str
    place: int


def only(values, place):
    """Return draws with the numbers of all places but one at 0."""
    flat = values.reshape(*values.shape[:1], -1) if values.ndim > 1 else values[:, None]
    left = np.zeros_like(flat)
    left[:, place] = flat[:, place]
    return left.reshape(values.shape)


class Some(SensorStreams):
    """A sensor's random numbers, of which only some are left."""

    def __init__(self, whole: SensorStreams, kept: Callable[[str, int], bool], name: str, number: Number) -> None:
        self._whole, self._kept, self._sensor, self._number = whole, kept, name, number

    @property
    def runs(self):
        return self._whole.runs

    def noise(self, times_s):
        values = self._whole.noise(times_s)
        mask = [self._kept(self._sensor, place) for place in range(values.shape[-1])]
        return np.where(np.isnan(values) | mask, values, 0.0)

    def normal(self, word, epochs, *shape):
        if self._number.stream == f"{self._sensor}.{word}" and int(np.prod(shape)) == 1:
            return self._whole.normal(word, epochs, *shape)
        return np.zeros((self.runs, epochs, *shape))

    def constant(self, word, *shape):
        if self._number.stream == f"{self._sensor}.{word}":
            return only(self._whole.constant(word, *shape), self._number.place)
        return np.zeros((self.runs, *shape))


class Kept(Streams):
    """A stream of truth or start, with one number left, or with none."""

    def __init__(self, generators, place):
        super().__init__(generators)
        self._place = place

    def normal(self, *shape):
        values = super().normal(*shape)
        return np.zeros_like(values) if self._place is None else only(values, self._place)

    def uniform(self, *shape):
        return 0.5 + self._about(super().uniform(*shape) - 0.5)

    def _about(self, values):
        return np.zeros_like(values) if self._place is None else only(values, self._place)


@dataclass(frozen=True)
class OneSource(RandomSource):
    """The seed's streams of truth and start, of which one number is left."""

    number: Number

    def streams(self, name):
        drawn = super().streams(name)
        if name == "start" or name.startswith("truth."):
            return Kept(drawn.generators, self.number.place if self.number.stream == name else None)
        return drawn


def errors(
    campaign: Campaign,
    filter: str,
    runs: int,
    kept: Callable[[str, int], bool] | None = None,
    nominal: bool = True,
    number: Number | None = None,
):
    """Return the errors (runs, T, 6) of a filter with the noise of some channels; None: of all that there is.

    Args:
        campaign: Its first case.
        filter: The filter.
        runs: How many.
        kept: Whether the noise of a sensor's channel is there.
        nominal: Whether the truth is the nominal one.
        number: The one number that is drawn beside the noise of channels; None: all of them, or none with `kept`.
    """
    case = campaign.cases[0]
    config = case.config.model_copy(update={"filters": {filter: case.config.filters[filter]}})
    if nominal:
        config = config.model_copy(update={"truth": nominal_truth(config.truth)})
    source = RandomSource(campaign.seed, tuple(range(runs)))
    if number is not None:
        source = OneSource(campaign.seed, tuple(range(runs)), number)

    def streams(name, *rest):
        whole = streams_of(name, *rest)
        return whole if kept is None else Some(whole, kept, name, number or Number("", 0))

    found = []

    def watch(name, filter, chunk, before, history):
        found.append(history.mean[..., :6] - chunk.truth.relative)

    outcome = filter_block(
        type(case)(**{**vars(case), "config": config}), source, chunks(config, source, streams), watch=watch
    )
    assert not outcome.broken and not outcome.result.failures
    return np.concatenate(found, axis=1)
