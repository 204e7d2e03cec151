"""CPU time per trajectory: relnav's batched propagation beside scipy (and heyoka where installed), in one run.

1000 dispersed low orbits over 6000 s with a state every second, under J2 to J4 and drag. scipy and heyoka take one
trajectory at a time, so they get fewer. One core, one BLAS thread. The rounds take turns and the smallest time of each
counts, so that a busy machine does not favour anyone; the first round also pays for the first use of memory.

    python benchmarks/propagation.py
"""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import time
from math import exp, sqrt

import numpy as np
from scipy.integrate import solve_ivp

from relnav_sim import ExponentialAtmosphere, ForceModel, propagate
from relnav_sim.astro import constants
from relnav_sim.astro.orbits import Elements, state_from_elements

ROWS, PEER_ROWS, ROUNDS = 1000, 5, 4
TIMES = np.arange(6001.0)
BALLISTIC = 0.011
MU, RADIUS, TURN = constants.MU_M3_S2, constants.RADIUS_M, constants.ROTATION_RAD_S
AIR = ExponentialAtmosphere(constants.BASE_ALTITUDE_M, constants.DENSITY_KG_M3, constants.SCALE_HEIGHT_M)
FORCE = ForceModel(MU, RADIUS, (constants.J2, constants.J3, constants.J4), AIR)


def dispersed_states():
    """Return 1000 states within some km and m/s of a circular orbit at 7000 km."""
    nominal = state_from_elements(Elements(7e6, 0.0, 0.9, 0.0, 0.0, 0.0), MU)
    return nominal + np.random.default_rng(0).normal(size=(ROWS, 6)) * np.repeat([1000.0, 1.0], 3)


def slope(t, y):
    """Return the derivative for scipy: plain floats, which for one trajectory are faster than small arrays."""
    x, y, z, vx, vy, vz = y.tolist()
    r2 = x * x + y * y + z * z
    r = sqrt(r2)
    s2, q = z * z / r2, RADIUS / r
    u2, u3, u4 = 1.5 * constants.J2 * q * q, 2.5 * constants.J3 * q**3 * z / r, 0.625 * constants.J4 * q**4
    planar = 1 + u2 * (1 - 5 * s2) + u3 * (3 - 7 * s2) + u4 * (-3 + 42 * s2 - 63 * s2 * s2)
    polar = 1 + u2 * (3 - 5 * s2) + u3 * (6 - 7 * s2) + u4 * (-15 + 70 * s2 - 63 * s2 * s2)
    pull, extra = -MU / (r2 * r), 1.5 * constants.J3 * q**3 * MU / r2
    wx, wy = vx + TURN * y, vy - TURN * x
    speed = sqrt(wx * wx + wy * wy + vz * vz)
    drag = -0.5 * BALLISTIC * speed * AIR.density_kg_m3 * exp((AIR.base_altitude_m + RADIUS - r) / AIR.scale_height_m)
    return [
        vx, vy, vz,
        pull * x * planar + drag * wx, pull * y * planar + drag * wy, pull * z * polar + extra + drag * vz,
    ]  # fmt: skip


def relnav(states):
    return propagate(states, TIMES, FORCE, BALLISTIC)


def scipy_each(states, rtol=1e-12):
    scale = np.repeat([7e6, 7.5e3], 3)
    return np.stack(
        [
            solve_ivp(slope, (0, TIMES[-1]), y, method="DOP853", rtol=rtol, atol=rtol * scale, t_eval=TIMES).y.T
            for y in states
        ]
    )


def heyoka_each():
    """Return the propagation of states by heyoka's Taylor integrator, compiled before the clock starts."""
    import heyoka as hy

    x, y, z, vx, vy, vz = hy.make_vars("x", "y", "z", "vx", "vy", "vz")
    r2 = x * x + y * y + z * z
    s, q = z / hy.sqrt(r2), RADIUS / hy.sqrt(r2)
    legendre = [(3 * s**2 - 1) / 2, (5 * s**3 - 3 * s) / 2, (35 * s**4 - 30 * s**2 + 3) / 8]
    series = sum(j * q**n * p for n, j, p in zip((2, 3, 4), FORCE.zonals, legendre, strict=True))
    potential = MU / hy.sqrt(r2) * (1.0 - series)
    wx, wy = vx + TURN * y, vy - TURN * x
    height = (AIR.base_altitude_m + RADIUS - hy.sqrt(r2)) / AIR.scale_height_m
    drag = -0.5 * BALLISTIC * AIR.density_kg_m3 * hy.exp(height) * hy.sqrt(wx * wx + wy * wy + vz * vz)
    gravity = [hy.diff(potential, c) for c in (x, y, z)]
    slopes = [vx, vy, vz, *(g + drag * w for g, w in zip(gravity, (wx, wy, vz), strict=True))]
    system = list(zip((x, y, z, vx, vy, vz), slopes, strict=True))
    # Its default tolerance, 2.2e-16: at 1e-12 it is no faster and 3e-3 m off.
    integrator = hy.taylor_adaptive(system, [7e6, 0.0, 0.0, 0.0, 7.5e3, 0.0])

    def run(states):
        paths = []
        for state in states:
            integrator.time = 0.0
            integrator.state[:] = state
            paths.append(integrator.propagate_grid(TIMES)[-1])
        return np.stack(paths)

    return run


def main():
    states = dispersed_states()
    tools = {"relnav, 1000 at once": (relnav, ROWS), "scipy solve_ivp DOP853": (scipy_each, PEER_ROWS)}
    try:
        tools["heyoka taylor_adaptive"] = (heyoka_each(), 200)
    except ImportError:
        print("heyoka is not installed: left out")
    reference = scipy_each(states[:PEER_ROWS], rtol=3e-14)
    spent = {name: [] for name in tools}
    error = {}
    for _ in range(ROUNDS):
        for name, (run, rows) in tools.items():
            began = time.process_time()
            paths = run(states[:rows])
            spent[name].append((time.process_time() - began) / rows)
            error[name] = np.abs(paths[:PEER_ROWS] - reference)[..., :3].max()
            del paths
    print(f"{'':24}  ms per trajectory (first round)   largest difference from scipy at rtol 3e-14")
    for name, seconds in spent.items():
        print(f"{name:24}  {min(seconds) * 1e3:6.3f}  ({seconds[0] * 1e3:.3f}) {error[name]:26.1e} m")
    ratio = min(spent["scipy solve_ivp DOP853"]) / min(spent["relnav, 1000 at once"])
    print(f"relnav is {ratio:.0f} times faster than scipy")


if __name__ == "__main__":
    main()
