"""Particle filters: CPU time per run-step, beside the bootstrap filter of the library `particles`.

6 states, range, azimuth and elevation; evidence and moments included. The library's filter resamples systematically at
half the particles, as relnav's, and takes one run at a time.

    python benchmarks/filters_particle.py [--quick] [--docs]
"""

import side_by_side as bench  # keeps NumPy to one thread, so it comes first

# isort: split

import numpy as np
from radar_problem import polar, radar_problem

from relnav_sim import create_filter, run_filter

RUNS = {1000: 32, 10000: 4}
STEPS = 5 if bench.QUICK else 60


def relnav(kind, problem, **options):
    def run():
        filter = create_filter(kind, problem.dynamics, problem.measurement, **options)
        return run_filter(filter, problem.z, problem.mean0, problem.cov0).mean

    return bench.Contender(run, problem.z.shape[0] * problem.z.shape[1])


def library(problem, N):
    """Return the library's filter on the first track."""
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
        filter = particles.SMC(fk=bootstrap, N=N, resampling="systematic", ESSrmin=0.5, collect=[Moments()])
        filter.run()
        return np.array([moment["mean"] for moment in filter.summaries.moments])[None]

    return bench.Contender(run, problem.z.shape[1])


def errors_of(problem):
    """Return the function that tells the two errors in position on the tracks: random filters agree in that only."""

    def errors(relnav, peer):
        rms = [
            np.sqrt(np.square(mean - problem.truth[: len(mean)])[..., :3].sum(axis=-1).mean())
            for mean in (relnav[: len(peer)], peer)
        ]
        return f"RMS errors {rms[0]:.2f} and {rms[1]:.2f} m"

    return errors


def main():
    bench.keep_to_one_core()
    # The allocator gives large arrays back to the system until it has freed one larger than they are, and asks for
    # every page again; a campaign's histories have taken it past that long before.
    history = np.zeros(4_000_000)
    del history
    rows, notes = [], []
    for N, runs in RUNS.items():
        problem = radar_problem(runs=runs, steps=STEPS, psd=1e-4)
        contenders = {
            "relnav": relnav("particle", problem, particles=N),
            "relnav without roughening": relnav("particle", problem, particles=N, roughening=0.0),
            "relnav's `unscented_particle`": relnav("unscented_particle", problem, particles=N),
        }
        try:
            contenders["particles"] = library(problem, N)
        except ImportError as error:
            notes.append(bench.missing(error))
        timings = bench.take_turns(contenders, rounds=6)
        rows += bench.beside(f"`particle`, N = {N}, per run-step", timings, errors_of(problem))
    bench.publish("particle filters", "\n\n".join([bench.side_by_side_table(rows, "us"), *dict.fromkeys(notes)]))


if __name__ == "__main__":
    main()
