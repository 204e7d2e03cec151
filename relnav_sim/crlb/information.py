"""The information that a sensor's measurements carry about the state: by its noise, and by how probable they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.crlb.fisher import ReadingInformation
from relnav_sim.crlb.host_frames import in_frame
from relnav_sim.dynamics.augmentation.extension import Extension
from relnav_sim.measurements.interface import Measurement, joint_components
from relnav_sim.sensors import form_taken, relative_sensors, sensor_measurement
from relnav_sim.sensors.front_end import Frame
from relnav_sim.sensors.interface import AssumedNoise
from relnav_sim.simulation.augmented_states import augmented_measurement
from relnav_sim.simulation.host_orbits import believed_orbit

NoiseInformation = Callable[[Array], Array]

MOST_CHANNELS = 3
"""Channels up to which the information of a mixture is integrated over all of them together."""


class SensorInformation:
    """The information of one sensor's measurements along trajectories, E[H^T I H].

    A measurement is whole, or has lost the channels that need the host's attitude and orbit, or is not there; the
    probabilities of the channels are nested accordingly.

    Args:
        name: The sensor.
        config: The case.
        states: Relative states (b, T, 6) that measurements will be taken at.
        mixture: Whether the noise counts as it is; else by its covariance, as one Gaussian.
        frame: Where its host's fixes may be missing: ``of_a_fix``, the orbit frame errs as at one; ``perfect``, `at` is
            told how it errs.
    """

    def __init__(
        self, name: str, config: CaseConfig, states: Array, mixture: bool = True, frame: Frame = "of_a_fix"
    ) -> None:
        self._name, self._config, self._frame = name, config, frame
        options = relative_sensors(config.sensors)[name]
        self._form = form_taken(options, "spherical")
        # In the deputy's frame the chief is seen from where it is on its orbit.
        self._by_epoch = options.host == "deputy" and believed_orbit(config).eccentricity > 0
        self._model = self._told("nominal" if mixture else "total")
        needs_direction = options.needs_direction()
        directed, alone = ([i for i, need in enumerate(needs_direction) if need is wanted] for wanted in (True, False))
        self._alone = alone
        whole = list(range(self._model.dimension))
        self._whole = self._noise_information(states, whole, directed, mixture)
        self._part = self._noise_information(states, alone, [], mixture) if alone and directed else None

    def at(
        self,
        states: Array,
        probability: Array,
        epochs: Integers,
        extra: Extension | None = None,
        frame: Array | None = None,
    ) -> Array:
        """Return the information of the measurements at some epochs, (K, n, n); 0 where no trajectory goes on.

        Args:
            states: Relative states (b, K, 6).
            probability: Of each channel, (b, K, m); NaN where a trajectory has ended.
            epochs: The epochs (K,).
            extra: States behind the six that measurements depend on too; they count as 0.
            frame: Covariance (K, 6, 6) of the error of the host's orbit frame; None: it is in the noise already.
        """
        flat = states.reshape(-1, 6)
        H, noise = self._jacobians(states, epochs, extra), self._whole(flat)
        if frame is not None:
            each = np.broadcast_to(frame, (len(states), *frame.shape)).reshape(-1, 6, 6)
            noise = in_frame(noise, H, flat, each)
        whole = probability.min(axis=-1)
        total = _weighed(H, noise, whole)
        if self._part is not None:
            part = probability[..., self._alone].min(axis=-1) - whole
            if (part > 0).any():
                total = total + _weighed(H[:, self._alone], self._part(flat), part)
        going = np.maximum((~np.isnan(whole)).sum(axis=0), 1)
        return np.asarray(total / going[:, None, None])

    def _jacobians(self, states: Array, epochs: Integers, extra: Extension | None) -> Array:
        """Return H (b K, m, n) at states (b, K, 6)."""
        if not self._by_epoch:
            return self._jacobian(states.reshape(-1, 6), 0, extra)
        each = [self._jacobian(states[:, k], epoch, extra) for k, epoch in enumerate(epochs.tolist())]
        H = np.stack(each, axis=1)
        return H.reshape(-1, *H.shape[-2:])

    def _jacobian(self, states: Array, epoch: int, extra: Extension | None) -> Array:
        """Return H (N, m, n) at states (N, 6) of an epoch."""
        if extra is None:
            H = self._model.jacobian(states, epoch)
        else:
            whole = np.concatenate([states, np.zeros((len(states), len(extra.names)))], axis=1)
            model = augmented_measurement(extra, self._name, self._model, self._config, self._form)
            H = model.jacobian(whole, epoch)
        return np.broadcast_to(H, (len(states), *H.shape[-2:]))

    def _told(self, assumed: AssumedNoise, perfect_attitude: bool = False) -> Measurement:
        """Return the sensor as a filter is told of it, spherical where it can be, without its latency."""
        sensors = relative_sensors(self._config.sensors) if perfect_attitude else self._config.sensors
        orbit, step_s = believed_orbit(self._config), self._config.clock.step_s
        return sensor_measurement(
            self._name, sensors, orbit, step_s, self._form, assumed, assumed_latency="none", frame=self._frame
        )

    def _noise_information(
        self, states: Array, channels: list[int], directed: list[int], mixture: bool
    ) -> NoiseInformation:
        """Return what gives the Fisher information (N, c, c) that noise leaves about some of the channels.

        The noise is taken as at epoch 0: where the chief is on its orbit moves it by separation over orbit radius.

        Args:
            states: Where measurements will be taken, (b, T, 6).
            channels: The channels.
            directed: Those of them that an error of the attitude moves.
            mixture: Whether the components count.
        """

        def noise(model: Measurement, at: Array) -> Array:
            R = _of_channels(model.noise(at, 0), channels)
            return np.broadcast_to(R, (len(at), *R.shape[-2:]))

        if not mixture:
            return lambda at: np.asarray(np.linalg.inv(noise(self._model, at)))
        # At one state that is known: the law of the noise is everywhere the same but for its scale.
        known = states[np.isfinite(states).all(axis=-1)][:1]
        told = self._told("mixture")
        found = told.mixture(known, 0) if len(known) else None
        if found is None or len(joint_components(found)[0]) == 1:
            return lambda at: np.asarray(np.linalg.inv(noise(self._model, at)))
        bare_model, bare = self._told("nominal", True), self._told("mixture", True).mixture(known, 0)
        assert bare is not None  # as the same sensor with an attitude has
        weights, components = joint_components(bare)
        components = _of_channels(np.broadcast_to(components, (1, *components.shape[-3:]))[0], channels)
        deviations = np.sqrt(np.einsum("kii->ki", components))
        if len(channels) > MOST_CHANNELS or len(directed) not in (0, 2) or not _diagonal(components):
            return lambda at: _of_known_components(told, at, channels)
        own = np.einsum("nii->ni", noise(bare_model, known))[0]

        def scales(at: Array) -> Array:
            """Return how many times the deviations at the known state those at states (N, 6) are, (N, c)."""
            return np.asarray(np.sqrt(np.einsum("nii->ni", noise(bare_model, at)) / own))

        def attitude(at: Array) -> Array:
            """Return the covariance that the attitude's error adds, (N, d, d), in units of these scales."""
            R = noise(self._model, at) - noise(bare_model, at)
            s = scales(at)[:, directed]
            return np.asarray(_of_channels(R, directed) / (s[:, :, None] * s[:, None]))

        met = np.concatenate([attitude(along) for along in states])
        reading = ReadingInformation(weights, deviations, met, tuple(directed))

        def information(at: Array) -> Array:
            s = scales(at)
            return np.asarray(reading.at(attitude(at)) / (s[:, :, None] * s[:, None]))

        return information


def joint_information(
    sensors: Mapping[str, SensorInformation],
    states: Array,
    probability: Mapping[str, Array],
    epochs: Integers,
    extra: Extension | None = None,
    frames: Mapping[str, Array] | None = None,
) -> Array:
    """Return the information of some sensors' measurements together, (K, n, n); their errors count as independent.

    Args:
        sensors: The sensors by name, one or more.
        states: Relative states (b, K, 6).
        probability: By sensor, of each of its channels, (b, K, m).
        epochs: The epochs (K,).
        extra: States behind the six.
        frames: By sensor, the covariance (K, 6, 6) of its frame's error where `at` is told of it.
    """
    told = frames or {}
    each = [sensor.at(states, probability[name], epochs, extra, told.get(name)) for name, sensor in sensors.items()]
    return each[0] if len(each) == 1 else np.asarray(sum(each))


def _of_known_components(told: Measurement, states: Array, channels: list[int]) -> Array:
    """Return the mean over the components of what each of them leaves, (N, c, c).

    Never less than the information of the mixture, which is convex in the density (Cohen, IEEE Trans. Information
    Theory 14(4), 1968): that of a filter that knew from which component each measurement comes.
    """
    found = told.mixture(states, 0)
    assert found is not None  # where its components are told
    weights, covariances = joint_components(found)
    information = np.einsum("k,...kij->...ij", weights, np.linalg.inv(_of_channels(covariances, channels)))
    return np.asarray(np.broadcast_to(information, (len(states), *information.shape[-2:])))


def _of_channels(covariance: Array, channels: list[int]) -> Array:
    """Return the part (..., c, c) of covariances that is of some channels."""
    row, column = np.ix_(channels, channels)
    return np.asarray(covariance[..., row, column])


def _diagonal(covariances: Array) -> bool:
    return bool((covariances == covariances * np.eye(covariances.shape[-1])).all())


def _weighed(H: Array, noise: Array, probability: Array) -> Array:
    """Return the sum (K, n, n) over the ensemble of the information H^T I H times its probability (b, K)."""
    n = H.shape[-1]
    information = (H.swapaxes(1, 2) @ noise @ H).reshape(*probability.shape, n, n)
    # Where nothing is measured the information may be anything, as of a target on a sensor's axis.
    weighed = np.where(probability[..., None, None] > 0, probability[..., None, None] * information, 0.0)
    return np.asarray(weighed.sum(axis=0))
