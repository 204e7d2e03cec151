"""What learned dynamics learn from: a flight of their own before the campaign, on other random numbers."""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.registry import create_filter
from relnav_sim.filters.run import advance
from relnav_sim.filters.smoother import smooth
from relnav_sim.models.cw import CwOptions
from relnav_sim.models.gp import GpOptions, TrainingTrack
from relnav_sim.runner.simulation import stretches
from relnav_sim.runner.start import radar_model, starting_belief
from relnav_sim.sensors import measurement_model
from relnav_sim.streams import RandomSource
from relnav_sim.truth import nominal_chief

TRAINING_RUN = 2**40
"""Number of the training flight: beyond every run, so that it shares no random numbers with any."""

HELD_OUT = 0.25
"""Part of the learned span that is flown on after it, to calibrate the variance."""


def training_track(config: CaseConfig, entry: FilterEntry, options: GpOptions, seed: int) -> TrainingTrack:
    """Return the states that learned dynamics are trained on, one step apart.

    The training flight starts like the campaign's runs do (dispersed, where they are) and lasts for the training span
    and a quarter more. From `smoothed_radar` the states are those of an extended Kalman filter on its radar, with
    Clohessy-Wiltshire dynamics and the entry's process noise, smoothed; from `truth` they are error-free.

    Args:
        config: The case.
        entry: The filter that uses the dynamics.
        options: What to learn from.
        seed: The campaign's seed.
    """
    orbit, step_s = nominal_chief(config.truth), config.clock.step_s
    span_s = options.training_span_s or 2 * math.pi / orbit.mean_motion_rad_s
    epochs = math.ceil((1 + HELD_OUT) * span_s / step_s)
    clock = config.clock.model_copy(update={"duration_s": epochs * step_s})
    # What is learned is free motion; known thrust comes on top of it.
    coasting = config.truth.model_copy(update={"manoeuvres": {}})
    flown = config.model_copy(update={"clock": clock, "truth": coasting})
    source = RandomSource(seed, (TRAINING_RUN,))
    flight = list(stretches(flown, source))
    time_s = np.concatenate([part.truth.times_s for part in flight])
    if options.training == "truth":
        return TrainingTrack(np.concatenate([part.truth.relative[0] for part in flight]), time_s)
    prior = starting_belief(flown, radar_model(config), flight[0], source)
    z = np.concatenate([part.inputs["polar"] for part in flight], axis=1)
    dynamics = CwOptions().build(orbit, entry.process_noise, step_s)
    tracker = create_filter("ekf", dynamics, measurement_model("polar", "total", config.sensors, orbit))
    start = Gaussian(prior.mean, prior.covariance)
    _, history = advance(tracker, start, z[:, 1:], 1, step_s)
    smoothed = smooth(history, dynamics, step_s, first_epoch=1)
    return TrainingTrack(smoothed.mean[0], time_s[1:])
