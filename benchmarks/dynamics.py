"""How far each relative dynamics goes wrong in one period, and what a step costs: docs/images/dynamics_error.png.

Deputies start at a given separation in random directions with the chief's period; every dynamics predicts one period
from the true start, with steps of 10 s and no measurement of the deputy. The truth has J2 to J4 and no drag, or
is a point mass (first panel, without the models that have J2). The perigee is at 7000 km. Errors are the root mean
square over the period and twelve deputies. "GNSS": the chief's orbit comes from its own GNSS fixes (30 m, 0.15 m/s,
every 10 s) that began one period earlier; "nonlinear_j2" alone takes the nominal orbit, which is right at the start of
the period. "J2 to J4" is nonlinear_j2 with zonals: 4.

    python benchmarks/dynamics.py
"""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from relnav_sim import ForceModel, eci_from_rtn, propagate, rtn_from_eci
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.constants import J2, J3, J4, MU_M3_S2, RADIUS_M
from relnav_sim.astro.kepler import initial_state
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.orbit_filter import OrbitFilter, OrbitFilterOptions
from relnav_sim.dynamics.process_noise import ProcessNoiseOptions
from relnav_sim.dynamics.registry import dynamics_kinds
from relnav_sim.dynamics.two_body_j2 import NonlinearJ2Options

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "dynamics_error.png"
KINDS = ("cw", "cw_second_order", "yamanaka_ankersen", "schweighart_sedwick", "nonlinear", "nonlinear_j2")
HIGHER = "nonlinear_j2, J2 to J4"
MODELS = {kind: dynamics_kinds()[kind]() for kind in KINDS} | {HIGHER: NonlinearJ2Options(zonals=4)}
WITH_GNSS = {f"{name}, GNSS": MODELS[name] for name in ("nonlinear_j2", HIGHER)}
SEPARATIONS_M = np.array([100.0, 300.0, 1e3, 3e3, 10e3, 30e3, 100e3])
ECCENTRICITIES = (0.0, 0.001, 0.01, 0.1, 0.3, 0.7)
INCLINATIONS_DEG = (0.5, 30.0, 51.6, 97.6)
PERIGEE_M, STEP_S, DEPUTIES = 7e6, 10.0, 12
FIX_SIGMAS = np.repeat([30.0, 0.15], 3)
NOISE = ProcessNoiseOptions(acceleration_psd_m2_s3=1e-8)
FULL, POINT = (J2, J3, J4), ()


def orbit_of(e, i_deg):
    return ChiefOrbit(PERIGEE_M / (1 - e), e, *np.radians([i_deg, 20.0, 40.0, 30.0]), MU_M3_S2, RADIUS_M, J2, J3, J4)


def deputies(orbit, separation_m, rng):
    """Return relative states (12, 6) of the chief's energy: random directions, speeds n / 2 times the separation."""
    chief = initial_state(orbit)
    directions = rng.normal(size=(2, DEPUTIES, 3))
    directions /= np.linalg.norm(directions, axis=2)[..., None]
    relative = np.concatenate([directions[0], 0.5 * orbit.mean_motion_rad_s * directions[1]], axis=1) * separation_m
    states = eci_from_rtn(chief, relative)
    gain = 1 / np.linalg.norm(states[:, :3], axis=1) - 1 / np.linalg.norm(chief[:3])
    speed = np.sqrt(chief[3:] @ chief[3:] + 2 * MU_M3_S2 * gain)
    states[:, 3:] *= (speed / np.linalg.norm(states[:, 3:], axis=1))[:, None]
    return states


def truth(orbit, states, zonals):
    """Return the chief (T, 6), ECI, the relative states (runs, T, 6) and their force over one period."""
    force = ForceModel(MU_M3_S2, RADIUS_M, zonals=zonals)
    times = np.arange(int(2 * np.pi / orbit.mean_motion_rad_s / STEP_S) + 1) * STEP_S
    chief = propagate(initial_state(orbit)[None], times, force)
    relative = rtn_from_eci(chief, propagate(states, times, force), force.normal_acceleration(chief))
    return chief[0], relative, force


def fixes_of(chief, runs, force, rng):
    """Return GNSS fixes (runs, T', 6) of the chief over the period before and this one."""
    before = propagate((chief[0] * np.repeat([1.0, -1.0], 3))[None], np.arange(len(chief)) * STEP_S, force)[0, :0:-1]
    track = np.concatenate([before * np.repeat([1.0, -1.0], 3), chief])
    return track + rng.normal(size=(runs, len(track), 6)) * FIX_SIGMAS


def error_of(dynamics, relative):
    """Return the RMS position error over the period, (runs,)."""
    x, total = relative[:, 0], np.zeros(len(relative))
    for k in range(1, relative.shape[1]):
        x = dynamics.propagate(x, Step(k, STEP_S))
        total += np.square(x - relative[:, k])[:, :3].sum(axis=1)
    return np.sqrt(total / (relative.shape[1] - 1))


def errors(e, i_deg, separations_m, zonals):
    """Return the RMS error in m by dynamics, one per separation."""
    rng = np.random.default_rng(1)
    orbit = orbit_of(e, i_deg)
    # The same directions in all cases.
    states = np.concatenate([deputies(orbit, s, np.random.default_rng(1)) for s in separations_m])
    chief, relative, force = truth(orbit, states, zonals)
    models = {name: options.build(DynamicsContext(orbit, NOISE, STEP_S)) for name, options in MODELS.items()}
    if zonals:
        fixes = fixes_of(chief, len(states), force, rng)
        for name, options in WITH_GNSS.items():
            filter = OrbitFilter(OrbitFilterOptions(), orbit.up_to(options.zonals), FIX_SIGMAS, STEP_S, len(states))
            estimates = filter.advance(fixes)[:, -len(chief) :]
            models[name] = options.build(DynamicsContext(orbit, NOISE, STEP_S)).with_chief(estimates, 0)
    found = {}
    for name, model in models.items():
        with np.errstate(all="ignore"):  # a model far outside its range may run away
            each = error_of(model, relative).reshape(len(separations_m), DEPUTIES)
        found[name] = np.sqrt(np.square(each).mean(axis=1))
    return found


def cost_us(name, runs=200, step_s=1.0, steps=100, rounds=10):
    """Return microseconds per run and step of one prediction, mean and Jacobian."""
    orbit = orbit_of(0.001, 51.6)
    rng = np.random.default_rng(0)
    x = rng.normal(size=(runs, 6)) * np.repeat([1e4, 10.0], 3)
    model = MODELS[name].build(DynamicsContext(orbit, NOISE, step_s))
    if isinstance(MODELS[name], NonlinearJ2Options):
        chief = propagate(initial_state(orbit)[None], np.arange(steps + 1) * step_s, ForceModel(MU_M3_S2, RADIUS_M))
        model = model.with_chief(np.repeat(chief, runs, axis=0), 0)
    spent = []
    for _ in range(rounds):
        began = time.process_time()
        for k in range(1, steps + 1):
            model.propagate(x, Step(k))
            model.transition(x, Step(k))
        spent.append(time.process_time() - began)
    return 1e6 * min(spent) / steps / runs


def orbit_filter_us(zonals, runs=200, step_s=1.0, steps=100, rounds=3):
    orbit = orbit_of(0.001, 51.6).up_to(zonals)
    fixes = initial_state(orbit) + np.zeros((runs, steps, 6))
    spent = []
    for _ in range(rounds):
        filter = OrbitFilter(OrbitFilterOptions(), orbit, FIX_SIGMAS, step_s, runs)
        began = time.process_time()
        filter.advance(fixes)
        spent.append(time.process_time() - began)
    return 1e6 * min(spent) / steps / runs


def number(value):
    return "-" if not value < 1e7 else f"{value:.1e}" if value < 0.01 else f"{value:.3g}"


def table(header, rows):
    print("| " + " | ".join(header) + " |\n|" + "---|" * len(header))
    for name, values in rows.items():
        print("| " + " | ".join([f"`{name}`", *map(number, values)]) + " |")
    print()


def figure(panels):
    drawn, axes = plt.subplots(1, len(panels), figsize=(13, 5), sharey=True, layout="constrained")
    markers = dict(zip((*MODELS, *WITH_GNSS), "osv^Dxp*P", strict=True))
    colours = {name: f"C{i}" for i, name in enumerate(markers)}
    for axis, (title, label, x, curves) in zip(axes, panels, strict=True):
        for name, values in curves.items():
            style = "--" if name in ("yamanaka_ankersen", *WITH_GNSS) else "-"
            axis.plot(x, values, style, marker=markers[name], ms=5, lw=1.2, color=colours[name], label=name)
        axis.set(title=title, xlabel=label, yscale="log", ylim=(1e-8, 3e6))
        axis.grid(alpha=0.3)
    for axis in axes[:2]:
        axis.set_xscale("log")
    axes[2].set_xscale("symlog", linthresh=1e-3)
    axes[2].set(xlim=(-3e-4, 1.0), xticks=[0, 1e-3, 1e-2, 0.1, 0.7], xticklabels=["0", "0.001", "0.01", "0.1", "0.7"])
    axes[0].set_ylabel("RMS position error over one period, m")
    drawn.legend(*axes[1].get_legend_handles_labels(), fontsize=8, loc="outside lower center", ncols=5)
    PICTURE.parent.mkdir(parents=True, exist_ok=True)
    drawn.savefig(PICTURE, dpi=130)


def main():
    point = errors(0.0, 51.6, SEPARATIONS_M, POINT)
    full = errors(0.0, 51.6, SEPARATIONS_M, FULL)
    by_e = {e: errors(e, 51.6, [10e3], FULL) for e in ECCENTRICITIES}
    point_by_e = {e: errors(e, 51.6, [10e3], POINT) for e in ECCENTRICITIES}
    by_i = {i: errors(0.0, i, [10e3], FULL) for i in INCLINATIONS_DEG}
    far = {i: errors(0.7, i, [100e3], FULL) for i in INCLINATIONS_DEG}
    km = [f"{s / 1e3:g} km" for s in SEPARATIONS_M]
    print("Point-mass truth, e = 0:\n")
    table(["dynamics", *km], point)
    print("Truth with J2 to J4, e = 0, i = 51.6 deg:\n")
    table(["dynamics", *km], full)

    def across(cases):
        return {name: [float(case[name][0]) for case in cases.values()] for name in next(iter(cases.values()))}

    print("Point-mass truth, 10 km:\n")
    table(["dynamics", *(f"e = {e:g}" for e in ECCENTRICITIES)], across(point_by_e))
    print("Truth with J2 to J4, 10 km, i = 51.6 deg:\n")
    table(["dynamics", *(f"e = {e:g}" for e in ECCENTRICITIES)], across(by_e))
    print("Truth with J2 to J4, 10 km, e = 0:\n")
    table(["dynamics", *(f"i = {i:g} deg" for i in INCLINATIONS_DEG)], across(by_i))
    print("Truth with J2 to J4, 100 km, e = 0.7:\n")
    table(["dynamics", *(f"i = {i:g} deg" for i in INCLINATIONS_DEG)], across(far))
    without_j2 = {
        name: values for name, values in point.items() if name != "schweighart_sedwick" and "J2" not in name.upper()
    }
    figure(
        [
            ("point-mass truth, e = 0", "separation, km", SEPARATIONS_M / 1e3, without_j2),
            ("truth with J2 to J4, e = 0", "separation, km", SEPARATIONS_M / 1e3, full),
            ("truth with J2 to J4, 10 km", "eccentricity", ECCENTRICITIES, across(by_e)),
        ]
    )
    print("Prediction (mean and Jacobian) of 200 runs, microseconds per run and step of 1 s / 60 s:\n")
    table(["dynamics", "1 s", "60 s"], {name: [cost_us(name), cost_us(name, step_s=60.0)] for name in MODELS})
    each = " / ".join(f"{orbit_filter_us(zonals):.1f}" for zonals in (2, 4))
    print(f"orbit filter with J2 / J2 to J4, per fix: {each} us at steps of 1 s")


if __name__ == "__main__":
    main()
