"""How far each relative dynamics goes wrong in one period in the real field: docs/images/dynamics_real_field.png.

Deputies start at a given separation in random directions with the chief's period; every dynamics predicts one period
from the true start, with steps of 10 s and no measurement of the deputy, about the chief's orbit as its own GNSS fixes
tell it (30 m, 0.15 m/s, every 10 s, from one period earlier on) where it takes one, else about the osculating orbit at
the start. The truth is GGM05S to degree and order 20 or 60, without Sun, Moon and drag; the orbit is circular at
622 km, i = 51.6 deg. Errors are the root mean square over the period, four deputies and
six nodes of the orbit. Beside them stand the errors
against J2 to J4 alone: what a campaign sees whose truth is `zonals: 4`.

    python benchmarks/dynamics_real_field.py
"""

import dynamics as zonal  # keeps NumPy to one thread, so it comes first

# isort: split

from dataclasses import astuple, replace
from math import radians
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from relnav_sim import ForceModel, GravityField, eci_from_rtn, propagate, rtn_from_eci
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.kepler import initial_state
from relnav_sim.astro.orbits import elements_from_state
from relnav_sim.dynamics.context import Arrival, ChiefFixes, DynamicsContext
from relnav_sim.dynamics.field_motion import about
from relnav_sim.dynamics.two_body_field import NonlinearFieldOptions

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "dynamics_real_field.png"
EPOCH = Epoch.parse("2010-07-27T00:00:00 GPS")
SEPARATIONS_M = np.array([100.0, 300.0, 1e3, 3e3, 10e3, 30e3, 100e3, 300e3])
DEGREES = (4, 10, 20, 40, 60)
MODELS = zonal.MODELS | {f"nonlinear_field, {n} x {n}": NonlinearFieldOptions(degree=n) for n in DEGREES}
STEP_S, DEPUTIES = zonal.STEP_S, 4
NODES_DEG = (0.0, 60.0, 120.0, 180.0, 240.0, 300.0)
CONSTANTS = ("mu_m3_s2", "equatorial_radius_m", "j2", "j3", "j4")


def force_of(degree):
    """Return the truth: the field to a degree, or, degree 0, its J2 to J4 about the frame's z axis."""
    field = GravityField.load("ggm05s", max(degree, 4))
    orbit = about(field, zonal.orbit_of(0.0, 51.6))
    if not degree:
        return ForceModel(orbit.mu_m3_s2, orbit.equatorial_radius_m, zonals=(orbit.j2, orbit.j3, orbit.j4))
    return ForceModel(orbit.mu_m3_s2, orbit.equatorial_radius_m, zonals=(), gravity=field, epoch=EPOCH)


def deputies(orbit, chief, separation_m, rng):
    """Return relative states (12, 6) of the chief's energy: random directions, speeds n / 2 times the separation."""
    directions = rng.normal(size=(2, DEPUTIES, 3))
    directions /= np.linalg.norm(directions, axis=2)[..., None]
    relative = np.concatenate([directions[0], 0.5 * orbit.mean_motion_rad_s * directions[1]], axis=1) * separation_m
    states = eci_from_rtn(chief, relative)
    gain = 1 / np.linalg.norm(states[:, :3], axis=1) - 1 / np.linalg.norm(chief[:3])
    speed = np.sqrt(chief[3:] @ chief[3:] + 2 * orbit.mu_m3_s2 * gain)
    states[:, 3:] *= (speed / np.linalg.norm(states[:, 3:], axis=1))[:, None]
    return states


def errors(degree):
    """Return the RMS error in m by dynamics, one per separation, over all nodes."""
    by_node = [errors_at(degree, radians(node)) for node in NODES_DEG]
    return {name: np.sqrt(np.mean([np.square(each[name]) for each in by_node], axis=0)) for name in by_node[0]}


def errors_at(degree, node_rad):
    """Return the same for one node, about the chief of fixes and about the true one."""
    first = replace(about(GravityField.load("ggm05s", 4), zonal.orbit_of(0.0, 51.6)), raan_rad=node_rad)
    force = force_of(degree)
    steps = int(2 * np.pi / first.mean_motion_rad_s / STEP_S)
    times = np.arange(2 * steps + 1) * STEP_S
    track = propagate(initial_state(first)[None], times, force)[0]
    # The period that counts is the second one; the field goes on turning, so time does not start anew.
    chief, begun = track[steps:], EPOCH.later(steps * STEP_S)
    there = elements_from_state(chief[0], first.mu_m3_s2)
    orbit = ChiefOrbit(*map(float, astuple(there)), *(getattr(first, name) for name in CONSTANTS))
    states = np.concatenate([deputies(orbit, chief[0], s, np.random.default_rng(1)) for s in SEPARATIONS_M])
    later = (
        force
        if not degree
        else ForceModel(force.mu_m3_s2, force.radius_m, zonals=(), gravity=force.gravity, epoch=begun)
    )
    deputy = propagate(states, times[: steps + 1], later)
    normal = later.normal_acceleration(chief, times_s=times[: steps + 1])
    relative = rtn_from_eci(chief, deputy, normal)
    fixes = track + np.random.default_rng(2).normal(size=(len(states), len(track), 6)) * zonal.FIX_SIGMAS
    found = {}
    for name, options in MODELS.items():
        context = DynamicsContext(orbit, zonal.NOISE, STEP_S, epoch=begun)
        model = options.build(context)
        if hasattr(model, "with_chief"):
            found[f"{name}, true chief"] = rms_of(model.with_chief(chief[None], 0), relative)
            model = estimated(options, first, fixes, steps)
        found[name] = rms_of(model, relative)
    return found


class Later:
    """Dynamics whose epochs count from a later one."""

    def __init__(self, dynamics, epochs):
        self._dynamics, self._epochs = dynamics, epochs

    def propagate(self, states, step):
        return self._dynamics.propagate(states, zonal.Step(step.epoch + self._epochs, step.duration_s))


def estimated(options, first, fixes, steps):
    """Return the dynamics about the chief as fixes (runs, 2 steps + 1, 6) tell it, the first half being over."""
    runs = len(fixes)
    context = DynamicsContext(first, zonal.NOISE, STEP_S, ChiefFixes(zonal.FIX_SIGMAS, runs), epoch=EPOCH)
    model = options.build(context)
    model.feed(Arrival(0, fixes))
    return Later(model, steps)


def rms_of(model, relative):
    with np.errstate(all="ignore"):  # a model far outside its range may run away
        each = zonal.error_of(model, relative).reshape(len(SEPARATIONS_M), DEPUTIES)
    return np.sqrt(np.square(each).mean(axis=1))


def figure(against):
    drawn, axes = plt.subplots(1, 2, figsize=(12, 5.2), sharey=True, layout="constrained")
    shown = ["cw", "nonlinear", "nonlinear_j2", zonal.HIGHER, *(f"nonlinear_field, {n} x {n}" for n in (4, 10, 20, 40))]
    km = SEPARATIONS_M / 1e3
    for axis, degree in zip(axes, (20, 60), strict=True):
        for number, name in enumerate(shown):
            colour = f"C{number}"
            axis.plot(km, against[degree][name], "-", marker="osv^DxpP"[number], ms=5, lw=1.2, color=colour, label=name)
        label = f"{zonal.HIGHER}, against a truth of J2 to J4"
        axis.plot(km, against[0][zonal.HIGHER], "k--", lw=1.0, label=label)
        axis.set(title=f"truth: GGM05S, {degree} x {degree}", xlabel="separation, km", xscale="log", yscale="log")
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("RMS position error over one period, m")
    drawn.legend(*axes[1].get_legend_handles_labels(), fontsize=8, loc="outside lower center", ncols=3)
    PICTURE.parent.mkdir(parents=True, exist_ok=True)
    drawn.savefig(PICTURE, dpi=130)


def main():
    against = {degree: errors(degree) for degree in (0, 20, 60)}
    for degree, found in against.items():
        title = f"GGM05S, {degree} x {degree}" if degree else "J2 to J4 about the frame's z axis"
        print(f"Truth: {title}:\n")
        zonal.table(["dynamics", *(f"{s / 1e3:g} km" for s in SEPARATIONS_M)], found)
    figure(against)


if __name__ == "__main__":
    main()
