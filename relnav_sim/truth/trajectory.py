"""The truth of a block of runs: both spacecraft, their relative state, and what varies between runs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.astro.atmosphere import LayeredAtmosphere
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.frames import eci_from_rtn, own_from_inertial, rtn_from_eci
from relnav_sim.astro.orbits import Elements
from relnav_sim.streams import RandomSource
from relnav_sim.truth.dispersion_options import DispersionsOptions
from relnav_sim.truth.distributions import FactorDispersion, PositionDispersion, VelocityDispersion
from relnav_sim.truth.force_options import ConstantsOptions, ForcesOptions
from relnav_sim.truth.forces import ExponentialAtmosphere, ForceModel
from relnav_sim.truth.manoeuvres import ExecutionErrors
from relnav_sim.truth.options import TruthOptions
from relnav_sim.truth.propagation import RTOL, DenseTrajectory
from relnav_sim.truth.states import Truth
from relnav_sim.truth.thrust import CRAFT, schedule, step_forces, thrusts_of


class TruthTrajectory:
    """The truth of a block of runs, evaluated a chunk of epochs at a time.

    Attributes:
        force: The force model of both craft.
        ballistic_m2_kg: Cd A / m times the density's factor, (2, b): chief and deputy.
        radiation_m2_kg: Cr A / m, (2, b).
        failures: Why the truth of a run of the block (its index, from 0) ends before the run does.
    """

    def __init__(self, options: TruthOptions, duration_s: float, source: RandomSource, rtol: float = RTOL) -> None:
        runs = len(source.runs) if options.is_dispersed else 1
        dispersions = options.dispersions
        # The density is a factor on the drag of both craft, as their own ballistic coefficients are.
        density = _factors(dispersions.density, "truth.density", source, runs)
        chief_factor = _factors(dispersions.chief_ballistic, "truth.chief_ballistic", source, runs)
        deputy_factor = _factors(dispersions.deputy_ballistic, "truth.deputy_ballistic", source, runs)
        self.force = force_model(options)
        self.ballistic_m2_kg = np.stack(
            [
                options.chief.ballistic_m2_kg * chief_factor * density,
                options.deputy.ballistic_m2_kg * deputy_factor * density,
            ]
        )
        chief_radiation = _factors(dispersions.chief_radiation, "truth.chief_radiation", source, runs)
        deputy_radiation = _factors(dispersions.deputy_radiation, "truth.deputy_radiation", source, runs)
        self.radiation_m2_kg = np.stack(
            [options.chief.radiation_m2_kg * chief_radiation, options.deputy.radiation_m2_kg * deputy_radiation]
        )
        self.failures: dict[int, str] = {}
        self._duration_s = duration_s
        self._asked_s = 0.0

        chief = np.broadcast_to(options.chief_state, (runs, 6))
        relative = np.tile(nominal_relative(options), (runs, 1))
        relative[:, :3] += _offsets(dispersions.relative_position, "truth.relative_position", source, runs)
        relative[:, 3:] += _offsets(dispersions.relative_velocity, "truth.relative_velocity", source, runs)
        normal = self.force.normal_acceleration(chief, self.ballistic_m2_kg[0], 0.0, self.radiation_m2_kg[0])
        deputy = eci_from_rtn(chief, relative, normal)
        self._thrusts = thrusts_of(options.manoeuvres, options.execution_errors, source, runs)
        self._both = DenseTrajectory(
            np.concatenate([chief, deputy]),
            self.force,
            self.ballistic_m2_kg.ravel(),
            rtol,
            schedule=schedule(self._thrusts, runs) if self._thrusts else None,
            surface_m=self.force.radius_m,
            radiation_m2_kg=self.radiation_m2_kg.ravel(),
        )

    def at(self, times_s: ArrayLike) -> Truth:
        """Return the truth at times (K,) in s, increasing, from 0 to the duration.

        Raises:
            ValueError: The times are not increasing, negative or beyond the duration.
        """
        times = np.asarray(times_s, dtype=float)
        # Epochs are multiples of a step, so the last may round past the duration.
        if times.size and times.max() > self._duration_s * (1 + 1e-9):
            raise ValueError(f"times_s goes to {times.max():g} s; the truth ends at {self._duration_s:g} s")
        states = self._both.at(times).reshape(2, -1, len(times), 6)
        self._note_ends(times)
        chief, deputy = states
        normal = self.force.normal_acceleration(
            chief, self.ballistic_m2_kg[0, :, None], times, self.radiation_m2_kg[0, :, None]
        )
        return Truth(times, chief, deputy, rtn_from_eci(chief, deputy, normal), normal)

    def felt(self, truth: Truth, step_s: float) -> Array:
        """Return the specific force that each craft feels in the steps that end at some epochs.

        Thrust, drag and the pressure of sunlight are felt, gravity is not. All but thrust is taken where the step ends.

        Args:
            truth: From `at`; b runs, K epochs.
            step_s: Time between epochs, s.

        Returns:
            (b, K, 2, 2, 3) in m/s^2: chief and deputy; the mean over the step and the one weighted with the time that
            is left (`step_forces`); RTN axes of the craft's own orbit.
        """
        felt = np.zeros((truth.chief.shape[0], len(truth.times_s), len(CRAFT), 2, 3))
        for thrust in self._thrusts:
            felt[:, :, thrust.craft] += step_forces(thrust, truth.times_s, step_s)
        if self.force.atmosphere is not None or self.force.radiation:
            for craft, states in enumerate((truth.chief, truth.deputy)):
                areas = self.ballistic_m2_kg[craft, :, None], self.radiation_m2_kg[craft, :, None]
                pull = self.force.acceleration(states, 0.0, truth.times_s)
                surface = self.force.acceleration(states, areas[0], truth.times_s, areas[1]) - pull
                felt[:, :, craft] += own_from_inertial(states, surface)[:, :, None]
        return felt

    def _note_ends(self, times: Array) -> None:
        """Say which runs have ended by the last of the times: a craft reached the surface."""
        self._asked_s = max(self._asked_s, times.max(initial=0.0))
        runs = self.ballistic_m2_kg.shape[1]
        # The later of two craft first, so that the earlier one is the reason.
        for row, ending in sorted(self._both.failures.items(), key=lambda item: -item[1].time_s):
            if ending.time_s <= self._asked_s:
                craft = "deputy" if row >= runs else "chief"
                self.failures[row % runs] = f"the {craft} falls to the Earth at {ending.time_s:g} s: it {ending.why}"


def truth_trajectory(
    options: TruthOptions, duration_s: float, source: RandomSource, rtol: float = RTOL
) -> TruthTrajectory:
    """Return the truth of the runs of `source`; where nothing is dispersed, one that all share.

    Args:
        options: The `truth:` section of a campaign.
        duration_s: Length of a run, s.
        source: Seed and run numbers; a run's truth does not depend on the other runs.
        rtol: Error of the integration per radian of an orbit, as a share of its radius.
    """
    return TruthTrajectory(options, duration_s, source, rtol)


def force_model(options: TruthOptions) -> ForceModel:
    """Return the force model that the options describe."""
    values, forces = options.constants, options.forces
    return ForceModel(
        mu_m3_s2=values.mu_m3_s2,
        radius_m=values.radius_m,
        zonals=(values.j2, values.j3, values.j4)[: max((forces.zonals or 0) - 1, 0)],
        atmosphere=_atmosphere(forces),
        rotation_rad_s=values.rotation_rad_s,
        gravity=None if forces.gravity is None else forces.gravity.field,
        epoch=options.start_epoch,
        third_bodies=forces.third_bodies,
        radiation=forces.radiation_pressure,
        orientation=options.orientation,
    )


def _atmosphere(forces: ForcesOptions) -> ExponentialAtmosphere | LayeredAtmosphere | None:
    air = forces.atmosphere
    match forces.drag:
        case "exponential":
            return ExponentialAtmosphere(air.base_altitude_m, air.density_kg_m3, air.scale_height_m)
        case "layers":
            return LayeredAtmosphere()
        case _:
            return None


def nominal_chief(options: TruthOptions) -> ChiefOrbit:
    """Return what a filter is told of the chief's orbit: the nominal one, the same in all runs."""
    return chief_orbit(options.chief_elements, options.constants)


def chief_orbit(orbit: Elements, constants: ConstantsOptions) -> ChiefOrbit:
    """Return the orbit of some elements about the Earth of some constants."""
    return ChiefOrbit(
        semi_major_axis_m=float(orbit.semi_major_axis_m),
        eccentricity=float(orbit.eccentricity),
        inclination_rad=float(orbit.inclination_rad),
        raan_rad=float(orbit.raan_rad),
        argument_of_perigee_rad=float(orbit.argument_of_perigee_rad),
        true_anomaly_rad=float(orbit.true_anomaly_rad),
        mu_m3_s2=constants.mu_m3_s2,
        equatorial_radius_m=constants.radius_m,
        j2=constants.j2,
        j3=constants.j3,
        j4=constants.j4,
    )


def nominal_truth(options: TruthOptions) -> TruthOptions:
    """Return the truth in which nothing is dispersed and every manoeuvre is carried out as planned."""
    planned = {name: each.model_copy(update={"errors": None}) for name, each in options.manoeuvres.items()}
    return options.model_copy(
        update={
            "dispersions": DispersionsOptions(),
            "execution_errors": ExecutionErrors(),
            "manoeuvres": planned,
        }
    )


def rough_truth(options: TruthOptions) -> TruthOptions:
    """Return the nominal truth under zonal harmonics and drag alone, for a quick look at geometry.

    Sun, Moon, sunlight and the rest of a gravity field move relative positions by some 2e-4 of themselves a revolution.
    """
    zonals = {"gravity": None, "zonals": options.forces.highest_zonal, "third_bodies": (), "radiation_pressure": False}
    return nominal_truth(options).model_copy(update={"forces": options.forces.model_copy(update=zonals)})


def nominal_relative(options: TruthOptions) -> Array:
    """Return the deputy's nominal state relative to the chief at the start, (6,), RTN, m and m/s."""
    deputy = options.deputy_state
    if deputy is None:
        assert options.deputy.relative is not None  # the options hold exactly one way to start
        return options.deputy.relative.rtn
    chief = options.chief_state
    areas = options.chief.ballistic_m2_kg, options.chief.radiation_m2_kg
    normal = force_model(options).normal_acceleration(chief, areas[0], 0.0, areas[1])
    return rtn_from_eci(chief, deputy, normal)


def _factors(dispersion: FactorDispersion | None, name: str, source: RandomSource, runs: int) -> Array:
    return np.ones(runs) if dispersion is None else dispersion.draw(source.streams(name))


def _offsets(
    dispersion: PositionDispersion | VelocityDispersion | None, name: str, source: RandomSource, runs: int
) -> Array:
    return np.zeros((runs, 3)) if dispersion is None else dispersion.draw(source.streams(name))
