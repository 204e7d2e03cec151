"""Where the filters of a run start: all of them at the same mean and covariance, at epoch 0."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.campaign.models import CaseConfig, DispersedStart, FirstFixStart, GivenStart
from relnav_sim.filters.belief import Gaussian
from relnav_sim.sensors import relative_sensors, sensor_measurement
from relnav_sim.simulation.chunks import Chunk
from relnav_sim.simulation.host_orbits import believed_orbit_at
from relnav_sim.streams import RandomSource


def starting_belief(config: CaseConfig, first: Chunk, source: RandomSource) -> Gaussian:
    """Return the prior of every run at epoch 0, mean (runs, 6) and covariance (runs, 6, 6).

    In a stressed case the mean errs as the flown start says, the covariance stays the one that filters are told.

    Args:
        config: The case.
        first: The first chunk of the block. The truth is used only to disperse a start around it.
        source: Seed and numbers of the runs.

    A run without a measurement at epoch 0 gets NaN for a start at the first fix.
    """
    start, flown, B = config.start, config.flown.start, len(source.runs)
    if isinstance(start, FirstFixStart):
        assert isinstance(flown, FirstFixStart)  # no stress changes the kind of a start
        position, position_covariance = FixMaker(config, fix_sensor(config)).fix(first, 0)
        mean = np.concatenate([position, np.broadcast_to(flown.velocity_m_s, (B, 3))], axis=1)
        covariance = np.zeros((B, 6, 6))
        covariance[:, :3, :3] = position_covariance
        covariance[:, 3:, 3:] = np.diag(np.square(start.velocity_sigma_m_s))
        return Gaussian(mean, covariance)
    sigma = np.array([*start.position_sigma_m, *start.velocity_sigma_m_s])
    covariance = np.broadcast_to(np.diag(sigma**2), (B, 6, 6)).copy()
    if isinstance(flown, DispersedStart):
        errs = np.array([*flown.position_sigma_m, *flown.velocity_sigma_m_s])
        return Gaussian(first.truth.relative[:, 0] + errs * source.streams("start").normal(6), covariance)
    assert isinstance(flown, GivenStart)
    state = np.array([*flown.position_m, *flown.velocity_m_s])
    return Gaussian(np.broadcast_to(state, (B, 6)).copy(), covariance)


class FixMaker:
    """What a sensor that gives a position by itself says the position is.

    Args:
        config: The case.
        name: The sensor.
    """

    def __init__(self, config: CaseConfig, name: str) -> None:
        self._name, self._options = name, relative_sensors(config.sensors)[name]
        self._config = config

    def fix(self, chunk: Chunk, k: int) -> tuple[Array, Array]:
        """Return position (runs, 3), RTN m, and covariance (runs, 3, 3) by the measurement at column k of a chunk."""
        step_s, sensors = self._config.clock.step_s, self._config.sensors
        # To a sensor's options a first fix is one at epoch 0.
        now = believed_orbit_at(self._config, self._name, (chunk.first_epoch + k) * step_s)
        model = sensor_measurement(self._name, sensors, now, step_s, assumed_noise="nominal")
        fix = self._options.first_fix(model, chunk.inputs[self._name][self._options.forms[0]][:, k])
        assert fix is not None  # the sensor is one that gives fixes
        return fix


def fix_sensor(config: CaseConfig) -> str:
    """Return the name of the first sensor that gives a position by itself.

    Raises:
        ValueError: None does; a campaign with such a start is refused when it is loaded.
    """
    for name, options in relative_sensors(config.sensors).items():
        if options.gives_fix:
            return name
    raise ValueError("a start at the first fix needs a sensor that gives a position by itself")
