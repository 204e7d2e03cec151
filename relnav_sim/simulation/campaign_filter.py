"""The filter of a campaign's entry, made of its dynamics, its sensors and its augmented states."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.dynamics.augmentation.extension import Extension
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.interface import Dynamics
from relnav_sim.dynamics.known_thrust import KnownThrust
from relnav_sim.dynamics.process_noise import white_acceleration
from relnav_sim.dynamics.registry import build_dynamics
from relnav_sim.dynamics.white_noise import WhiteAcceleration
from relnav_sim.filters.belief import Filter
from relnav_sim.filters.covariance_matching import CovarianceMatching
from relnav_sim.filters.editing import Restart, edited
from relnav_sim.filters.read_only import ReadOnlyDynamics, read_only
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.filters.rewinding import RewindableDynamics
from relnav_sim.measurements.channel import Channel
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.partial import PartialMeasurement
from relnav_sim.measurements.several import SeveralMeasurements
from relnav_sim.sensors import form_taken, relative_sensors, sensor_measurement
from relnav_sim.sensors.interface import Form
from relnav_sim.simulation.augmented_states import augmented_measurement, extension_of
from relnav_sim.simulation.host_orbits import believed_orbit
from relnav_sim.simulation.thrust_inputs import known_thrust

_RTN = tuple(
    Channel(axis, "m", f"position, {what}")
    for axis, what in zip("xyz", ("radial", "along-track", "normal"), strict=True)
)


@dataclass(frozen=True)
class CampaignFilter:
    """The filter of a campaign's entry.

    Attributes:
        filter: The filter, over [x; b] where it carries augmented states b; its measurements edited where the entry
            says.
        algorithm: The same with every measurement taken.
        dynamics: How x alone moves without thrust.
        thrust: What is told of thrust; None where the filter knows nothing of it.
        extension: The augmented states; None without any.
        rewindable: The dynamics of the filter where it is to go back; else None.
    """

    filter: Filter
    algorithm: Filter
    dynamics: Dynamics
    thrust: KnownThrust | None
    extension: Extension | None
    rewindable: RewindableDynamics | None = None


def create_campaign_filter(
    entry: FilterEntry,
    config: CaseConfig,
    context: DynamicsContext,
    late: Collection[str] = (),
    rewinds: bool = False,
    restart: Restart | None = None,
) -> CampaignFilter:
    """Return the filter of a campaign's entry, with its dynamics, its measurement and its augmented states.

    Args:
        entry: The filter.
        config: The case.
        context: What the dynamics are built from.
        late: Sensors whose measurements come with a latency of their own.
        rewinds: Whether the filter is to go back to epochs of the chunk before.
        restart: Where runs that are restarted begin.
    """
    orbit, step_s = context.orbit, context.step_s
    adaptive = entry.process_noise.adaptive
    coasting: Dynamics = read_only(build_dynamics(entry.dynamics, _told_noise(context)), ReadOnlyDynamics)
    if adaptive is not None:
        system = cw_system(orbit.mean_motion_rad_s)
        coasting = white = WhiteAcceleration(coasting, system, adaptive.start.densities, step_s)
    thrust = None if known_thrust(entry, config) == "none" else KnownThrust(coasting, orbit, step_s)
    motion = coasting if thrust is None else thrust
    factory = filter_kinds()[entry.kind].factory
    extension = extension_of(entry, config)
    dynamics = motion if extension is None else extension.dynamics(motion, orbit, step_s, thrust)
    measurement = _measurement(entry, config, extension, late)
    rewindable = RewindableDynamics(dynamics) if rewinds else None
    algorithm = factory(rewindable or dynamics, measurement, entry)
    filter = algorithm
    if adaptive is not None:
        filter = CovarianceMatching(filter, white, adaptive.window)
    filter = edited(filter, entry.editing, getattr(entry, "gate_probability", None), restart)
    return CampaignFilter(filter, algorithm, coasting, thrust, extension, rewindable)


def _told_noise(context: DynamicsContext) -> DynamicsContext:
    """Return the context without the process noise that the filter finds by itself."""
    if context.process_noise.adaptive is None:
        return context
    return replace(context, process_noise=white_acceleration(0.0))


def _measurement(
    entry: FilterEntry, config: CaseConfig, extension: Extension | None, late: Collection[str]
) -> Measurement:
    """Return what a filter is told of its sensors."""
    orbit, step_s = believed_orbit(config), config.clock.step_s
    models: dict[str, Measurement] = {}
    for name, form in sensor_forms(entry, config).items():
        model = sensor_measurement(
            name,
            config.sensors,
            orbit,
            step_s,
            form,
            entry.assumed_noise,
            entry.assumed_latency,
            frame="told",
            own_latencies=name in late,
        )
        models[name] = model if extension is None else augmented_measurement(extension, name, model, config, form)
    if len(models) > 1:
        return SeveralMeasurements(models)
    ((name, model),) = models.items()
    return PartialMeasurement(model, name)


def sensor_forms(entry: FilterEntry, config: CaseConfig) -> dict[str, Form]:
    """Return the sensors that a filter goes by, in order, with the form in which it takes their measurements."""
    relative = relative_sensors(config.sensors, entry.sensors)
    return {name: form_taken(options, entry.measurement) for name, options in relative.items()}


def filter_channels(entry: FilterEntry, config: CaseConfig) -> dict[str, tuple[Channel, ...]]:
    """Return the numbers of each sensor's measurements as a filter takes them: converted, those of a position."""
    sensors = relative_sensors(config.sensors)
    return {
        name: sensors[name].channels if form == sensors[name].forms[0] else _RTN
        for name, form in sensor_forms(entry, config).items()
    }
