"""Truth and measurements of a block of runs, in chunks of epochs that bound the memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.campaign import Campaign
from relnav_sim.campaign.manoeuvres import default_thrust
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.conventions import CHUNK_EPOCHS
from relnav_sim.measurements.delayed import with_latency
from relnav_sim.measurements.frame_error import with_frame
from relnav_sim.sensors import HostOrbit, SensorSuite, filter_inputs, frame_is_told, own_sensor, relative_sensors
from relnav_sim.sensors.arrivals import Arrivals
from relnav_sim.sensors.interface import Craft, Form
from relnav_sim.sensors.suite import StreamsMaker, streams_of
from relnav_sim.simulation.host_orbits import HostOrbits, believed_gravity, fixes_of
from relnav_sim.simulation.thrust_inputs import ThrustInputs
from relnav_sim.streams import RandomSource
from relnav_sim.truth import Trajectory, Truth, truth_trajectory


@dataclass(frozen=True)
class Chunk:
    """A chunk of epochs of one block.

    Attributes:
        first_epoch: Number of the first epoch.
        truth: True states; the leading axis is 1 where all runs share them.
        z: Raw measurements of each sensor, (runs, K, m).
        inputs: What the front end hands to filters, by relative sensor and form, (runs, K, m); NaN = missing.
        ended: Why the truth of a run has ended by now, by the run's place in the block.
        orbits: What hosts of relative sensors know of their orbits, where their fixes may be missing.
        late: How long before its epoch each measurement was taken, on top of the sensor's own latency, (runs, K), s; by
            the relative sensors of which any was. Only recorded measurements are.
        delays: How many epochs after its own each measurement arrives, (runs, K), by the sensors that draw a latency.
        truth_is_known: Whether the true states are any. Those of a recorded flight may be NaN throughout.
        errors_are_known: Whether the errors of the sensors are those that the campaign draws. Those of a recorded
            flight are not.
    """

    first_epoch: int
    truth: Truth
    z: Mapping[str, Array]
    inputs: Mapping[str, Mapping[Form, Array]]
    ended: Mapping[int, str]
    orbits: Mapping[Craft, HostOrbit] = field(default_factory=dict)
    late: Mapping[str, Array] = field(default_factory=dict)
    delays: Mapping[str, Integers] = field(default_factory=dict)
    truth_is_known: bool = True
    errors_are_known: bool = True


@dataclass(frozen=True)
class Simulation:
    """Truth and measurements of some runs of one case.

    Attributes:
        times_s: Epochs, (T,), s; from 0 to the duration.
        chief: ECI state of the chief, (runs, T, 6), m and m/s.
        deputy: ECI state of the deputy, (runs, T, 6), m and m/s.
        relative: State of the deputy relative to the chief, RTN, (runs, T, 6), m and m/s.
        z: Raw measurements of each sensor by its name, (runs, T, m), SI and rad; NaN = no measurement.
        inputs: What the filters are given of each relative sensor, by its name, through the attitude and orbit that its
            host itself measures, (runs, T, m); ``NAME.cartesian`` is the same converted to a position.

    Examples:
        >>> from relnav_sim import load_campaign, simulate
        >>> flight = simulate(load_campaign("campaigns/demo.yaml"))
        >>> flight.times_s[-1].item(), sorted(flight.z)
        (600.0, ['gnss', 'radar', 'star_tracker'])
    """

    times_s: Array
    chief: Array
    deputy: Array
    relative: Array
    z: Mapping[str, Array]
    inputs: Mapping[str, Array]


def chunks(config: CaseConfig, source: RandomSource, streams: StreamsMaker = streams_of) -> Iterator[Chunk]:
    """Yield the truth and measurements of a block, a chunk of epochs at a time.

    What happens is `CaseConfig.flown`; what craft know of their sensors and orbits is what the case tells.

    Args:
        config: The case.
        source: Seed and numbers of the runs.
        streams: Makes the random numbers of each sensor; default: those of the seed and the runs.
    """
    clock, flown = config.clock, config.flown
    trajectory = truth_trajectory(flown.truth, clock.duration_s, source)
    suite = SensorSuite(flown.sensors, source, clock.step_s, streams)
    force = own_sensor(flown.sensors, "force")
    front_end = FrontEnd(config, len(source.runs))
    arrivals = Arrivals(flown.sensors, source, clock.step_s)
    for first in range(0, clock.epochs, CHUNK_EPOCHS):
        epochs = np.arange(first, min(first + CHUNK_EPOCHS, clock.epochs))
        times_s = np.asarray(epochs * clock.step_s, dtype=np.float64)
        truth = trajectory.at(times_s)
        felt = None if force is None else trajectory.felt(truth, clock.step_s)
        z = suite.measure(truth, first, partial(_earlier, trajectory, times_s), felt)
        delays = arrivals.delays(len(epochs))
        yield front_end.completed(Chunk(first, truth, z, {}, dict(trajectory.failures), delays=delays), truth)


class FrontEnd:
    """What makes of the measurements of a block what filters are given; it remembers where the last chunk ended.

    Args:
        config: The case.
        runs: Number of runs.
    """

    def __init__(self, config: CaseConfig, runs: int) -> None:
        self._config = config
        self._gravity = believed_gravity(config)
        self._hosts = HostOrbits(config, runs)
        self._thrust = ThrustInputs(config)

    def completed(self, chunk: Chunk, known: Truth | None) -> Chunk:
        """Return the next chunk with what the filters are given of its measurements.

        Args:
            chunk: Its truth and its measurements.
            known: The orbits of craft that know theirs perfectly, where no sensor says; None: there are none.

        Raises:
            ValueError: Such an orbit is needed and missing.
        """
        sensors, hosts = self._config.sensors, self._hosts
        if hosts.hosts:
            forces, _ = self._thrust.of(chunk, default_thrust(sensors))
            chunk = replace(chunk, orbits=hosts.advance(fixes_of(hosts.hosts, sensors, chunk.z), forces))
        return replace(chunk, inputs=filter_inputs(sensors, chunk.z, known, self._gravity, chunk.orbits, chunk.late))


def told(chunk: Chunk, forms: Mapping[str, Form], config: CaseConfig) -> dict[str, Array]:
    """Return what a filter is given of its sensors, by name, as `sensor_measurement` with a told frame takes it.

    Args:
        chunk: The epochs.
        forms: The sensors' names, with the form in which the filter takes each.
        config: The case.
    """
    given = {}
    for name, form in forms.items():
        z = chunk.inputs[name][form]
        if frame_is_told(name, config.sensors, config.clock.step_s):
            z = with_frame(z, chunk.orbits[relative_sensors(config.sensors)[name].host].frame)
        if name in chunk.late:
            z = with_latency(z, chunk.late[name])
        given[name] = z
    return given


def in_time(z: Mapping[str, Array], delays: Mapping[str, Integers], latest: int = 0) -> dict[str, Array]:
    """Return z by sensor (runs, K, m) without measurements that arrive more than `latest` epochs after their own."""
    return {
        name: np.where((delays[name] > latest)[..., None], np.nan, readings) if name in delays else readings
        for name, readings in z.items()
    }


def _earlier(trajectory: Trajectory, times_s: Array, latency_s: float) -> tuple[Array, Array]:
    """Return the states of both craft some time before the epochs, NaN before the start."""
    earlier = times_s - latency_s
    past = trajectory.at(np.maximum(earlier, 0.0))
    # An epoch less the latency may round below the start.
    before = earlier < -1e-9 * latency_s
    return np.where(before[:, None], np.nan, past.chief), np.where(before[:, None], np.nan, past.deputy)


def simulate(campaign: Campaign, case: int = 0, runs: Sequence[int] = range(1)) -> Simulation:
    """Return the truth and the measurements of some runs, the same numbers that `run_campaign` filters.

    Args:
        campaign: From `load_campaign`.
        case: Index of the case.
        runs: Numbers of the runs; any subset gives the same numbers for each run.

    Raises:
        IndexError: There is no such case.
        ValueError: No runs are asked for.

    Examples:
        >>> from relnav_sim import load_campaign, simulate
        >>> flight = simulate(load_campaign("campaigns/demo.yaml"), case=0, runs=[0, 1])
        >>> flight.relative.shape, flight.z["radar"].shape  # 600 s in steps of 1 s, range and two angles
        ((2, 601, 6), (2, 601, 3))
    """
    if not 0 <= case < len(campaign.cases):
        raise IndexError(f"there is no case {case}; the campaign has {len(campaign.cases)}, counted from 0")
    if not len(runs):
        raise ValueError("no runs are asked for")
    config = campaign.cases[case].config
    parts = list(chunks(config, RandomSource(campaign.seed, tuple(runs))))

    def joined(arrays: Sequence[Array]) -> Array:
        whole = np.concatenate(arrays, axis=1)
        return np.broadcast_to(whole, (len(runs), *whole.shape[1:]))

    usual = {name: options.forms[0] for name, options in relative_sensors(config.sensors).items()}
    return Simulation(
        times_s=np.concatenate([part.truth.times_s for part in parts]),
        chief=joined([part.truth.chief for part in parts]),
        deputy=joined([part.truth.deputy for part in parts]),
        relative=joined([part.truth.relative for part in parts]),
        z={name: joined([part.z[name] for part in parts]) for name in parts[0].z},
        inputs={
            name if form == usual[name] else f"{name}.{form}": joined([part.inputs[name][form] for part in parts])
            for name, forms in parts[0].inputs.items()
            for form in forms
        },
    )
