"""CPU time per filter step of the particle filters, and what learned dynamics cost and lose with cheaper variances.

6 states, range, azimuth and elevation, one core, one BLAS thread, NIS, evidence and moments included. The rounds take
turns and the smallest time of each counts, so that a busy machine does not favour anyone. Where the library `particles`
is installed its bootstrap filter (systematic resampling at half the particles, weighted mean) runs beside.

    python benchmarks/filters_particle.py
"""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import importlib.util
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "filters"))
from formation_flight import STEP_S, STEPS_PER_REVOLUTION, flight, learned
from radar_problem import polar, polar_jacobian, radar_problem

from relnav_sim import FunctionMeasurement, create_filter, run_filter
from relnav_sim.dynamics.interface import Step

ROUNDS = 8
TRAINING = 500
LIMITS_US = {("particle", 1000): 180.0, ("particle", 10000): 1100.0}
RUNS = {1000: 32, 10000: 4}


def cpu_us(run, units):
    begin = time.process_time()
    run()
    return 1e6 * (time.process_time() - begin) / units


def fastest(contenders, rounds=ROUNDS):
    """Return the smallest cost of each contender, (run, units) by name, taking turns."""
    best = dict.fromkeys(contenders, np.inf)
    for _ in range(rounds):
        for name, (run, units) in contenders.items():
            best[name] = min(best[name], cpu_us(run, units))
    return best


def relnav(kind, problem, **options):
    def run():
        filter = create_filter(kind, problem.dynamics, problem.measurement, **options)
        run_filter(filter, problem.z, problem.mean0, problem.cov0)

    return run, problem.z.shape[0] * problem.z.shape[1]


def library(problem, N):
    """Return the run of the library's filter on the first track."""
    import particles
    from particles import distributions, state_space_models
    from particles.collectors import Moments

    root_R = np.sqrt(np.diag(problem.R))

    class Model(state_space_models.StateSpaceModel):
        def PX0(self):  # noqa: N802 - the library's name
            return distributions.MvNormal(loc=problem.mean0[0], cov=problem.cov0)

        def PX(self, t, xp):  # noqa: N802 - the library's name
            return distributions.MvNormal(loc=xp @ problem.F.T, cov=problem.Q)

        def PY(self, t, xp, x):  # noqa: N802 - the library's name
            range_m, azimuth, elevation = polar(x).T
            return distributions.IndepProd(
                distributions.Normal(loc=range_m, scale=root_R[0]),
                distributions.Normal(loc=azimuth, scale=root_R[1]),
                distributions.Normal(loc=elevation, scale=root_R[2]),
            )

    def run():
        bootstrap = state_space_models.Bootstrap(ssm=Model(), data=problem.z[0])
        particles.SMC(fk=bootstrap, N=N, resampling="systematic", ESSrmin=0.5, collect=[Moments()]).run()

    return run, problem.z.shape[1]


def particle_filters():
    for N in (1000, 10000):
        problem = radar_problem(runs=RUNS[N], steps=60, psd=1e-4)
        contenders = {
            "particle": relnav("particle", problem, particles=N),
            "particle, no roughening": relnav("particle", problem, particles=N, roughening=0.0),
            "unscented_particle": relnav("unscented_particle", problem, particles=N),
        }
        if importlib.util.find_spec("particles"):
            contenders["library particles"] = library(problem, N)
        best = fastest(contenders)
        for name, cost in best.items():
            limit = LIMITS_US.get((name, N), 15 * best["particle"] if name.startswith("unscented") else np.nan)
            print(
                f"N = {N:5d}  {name:24s} {cost:8.0f} us per run-step  {cost / best['particle']:5.1f} x particle"
                + (f"   at most {limit:.0f}" if np.isfinite(limit) else "")
            )


def learned_dynamics(N=1000, runs=4, steps=6):
    rng = np.random.default_rng(0)
    sigmas = np.array([0.1 / 3, np.radians(0.05 / 3), np.radians(0.05 / 3)])
    measurement = FunctionMeasurement(polar, np.diag(sigmas**2), polar_jacobian, angles=(1, 2))
    truth = flight()[STEPS_PER_REVOLUTION : STEPS_PER_REVOLUTION + 121]
    mean0, cov0 = truth[0], np.diag([10.0, 10.0, 10.0, 0.05, 0.05, 0.05]) ** 2
    z = polar(truth[1:]) + sigmas * rng.standard_normal((runs, 120, 3))
    states = truth[5] + rng.standard_normal((runs, N, 6)) * np.array([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3])

    for variance in ("exact", "cloud_mean", "inducing"):
        dynamics = learned(variance=variance)

        def predict(dynamics=dynamics):
            np.add(states, 1e-6, out=states)  # new states: nothing is known about them from the last call
            dynamics.process_noise(states, Step(1, STEP_S))
            dynamics.propagate(states, Step(1, STEP_S))

        def run(kind, dynamics=dynamics):
            return lambda: run_filter(
                create_filter(kind, dynamics, measurement, particles=N), z[:, :steps], mean0, cov0, step_s=STEP_S
            )

        best = fastest(
            {
                "GP mean and variance": (predict, runs),
                "gp_particle": (run("gp_particle"), runs * steps),
                "mf_upf": (run("mf_upf"), runs * steps),
            },
            rounds=5,
        )
        prediction = best["GP mean and variance"]
        print(f"{TRAINING} training points, N = {N}, variance {variance}")
        print(f"  GP mean and variance     {prediction / N:8.2f} us per particle-step   at most 30")
        for kind in ("gp_particle", "mf_upf"):
            print(f"  {kind:24s} {best[kind]:8.0f} us per run-step   {best[kind] / prediction:.2f} x the prediction")
        for kind in ("gp_particle", "mf_upf", "gp_ukf"):
            options = {} if kind == "gp_ukf" else {"particles": 300}
            history = run_filter(create_filter(kind, dynamics, measurement, **options), z, mean0, cov0, step_s=STEP_S)
            error = (history.mean - truth[1:])[:, 60:]
            position, velocity = (np.sqrt(np.square(error[..., i : i + 3]).sum(axis=-1).mean()) for i in (0, 3))
            print(f"  {kind:24s} {position:8.4f} m, {velocity:.6f} m/s RMS, 300 particles, after 60 of 120 steps")


if __name__ == "__main__":
    # The allocator gives large arrays back to the system until it has freed one larger than they are, and asks for
    # every page again; a campaign's histories have taken it past that long before.
    history = np.zeros(4_000_000)
    del history
    particle_filters()
    learned_dynamics()
