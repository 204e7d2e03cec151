"""Learned dynamics: what predicting costs beside scikit-learn, and what cheaper variances save and lose.

500 training points of one revolution, mean and variance.

    python benchmarks/learned.py [--quick] [--docs]
"""

import side_by_side as bench  # keeps NumPy to one thread, so it comes first

# isort: split

import numpy as np
from formation_flight import STEP_S, STEPS_PER_REVOLUTION, flight, learned
from radar_problem import polar, polar_jacobian
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel

from relnav_sim import FunctionMeasurement, create_filter, run_filter
from relnav_sim.dynamics.interface import Step

QUERIES = 1000
TRAINING = 500


def beside_scikit_learn():
    """Return the row of the prediction at 1000 points, both with the hyperparameters that relnav fitted."""
    process = learned().process
    kernel = process.kernel
    rng = np.random.default_rng(0)
    # Next to the orbit, where the variance is neither that of the noise nor that of the prior.
    points = flight()[rng.integers(0, STEPS_PER_REVOLUTION, QUERIES)]
    points = points + rng.standard_normal((QUERIES, 6)) * 0.05 * flight().std(axis=0)
    peer = GaussianProcessRegressor(
        ConstantKernel(kernel.signal_variance) * RBF(np.ones(6)),
        alpha=kernel.noise_ratio * kernel.signal_variance,
        optimizer=None,
    )
    correlation = kernel.correlation(process.inputs) + kernel.noise_ratio * np.eye(len(process.inputs))
    peer.fit(process.inputs, correlation @ process.weights)

    def scikit_learn():
        mean, deviation = peer.predict(kernel.scaled(points), return_std=True)
        return mean * kernel.output_scale + kernel.output_mean, np.square(deviation[:, 0])

    def relnav():
        mean, variance = process.predict_with_variance(points[None])
        return mean[0], variance[0] - kernel.signal_variance * kernel.noise_ratio  # scikit-learn's is without noise

    def apart(relnav, peer):
        mean = np.abs((relnav[0] - peer[0]) / kernel.output_scale).max()
        variance = np.abs(relnav[1] - peer[1]).max() / kernel.signal_variance
        return f"mean {mean:.0e} of the outputs' size, variance {variance:.0e} of the prior's"

    timings = bench.take_turns(
        {"relnav": bench.Contender(relnav, QUERIES), "scikit-learn": bench.Contender(scikit_learn, QUERIES)}, rounds=10
    )
    return bench.beside("mean and variance, 500 training points, per point", timings, apart)


def cheaper_variances(N=1000, runs=4, steps=6):
    """Return rows of the costs and errors of the filters with exact and cheaper variances."""
    if bench.QUICK:
        N, steps = 100, 2
    rng = np.random.default_rng(0)
    sigmas = np.array([0.1 / 3, np.radians(0.05 / 3), np.radians(0.05 / 3)])
    measurement = FunctionMeasurement(polar, np.diag(sigmas**2), polar_jacobian, angles=(1, 2))
    truth = flight()[STEPS_PER_REVOLUTION : STEPS_PER_REVOLUTION + 121]
    mean0, cov0 = truth[0], np.diag([10.0, 10.0, 10.0, 0.05, 0.05, 0.05]) ** 2
    z = polar(truth[1:]) + sigmas * rng.standard_normal((runs, 120, 3))
    states = truth[5] + rng.standard_normal((runs, N, 6)) * np.array([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3])

    rows = []
    for variance in ("exact", "cloud_mean", "inducing"):
        dynamics = learned(variance=variance)

        def predict(dynamics=dynamics):
            np.add(states, 1e-6, out=states)  # new states: nothing is known about them from the last call
            dynamics.process_noise(states, Step(1, STEP_S))
            dynamics.propagate(states, Step(1, STEP_S))

        def run(kind, dynamics=dynamics):
            filter = create_filter(kind, dynamics, measurement, particles=N)
            return bench.Contender(lambda: run_filter(filter, z[:, :steps], mean0, cov0, step_s=STEP_S), runs * steps)

        timings = bench.take_turns(
            {
                "prediction": bench.Contender(predict, runs * N),
                "gp_particle": run("gp_particle"),
                "mf_upf": run("mf_upf"),
            }
        )
        cells = [bench.significant(timing.us) for timing in timings.values()]
        for kind in ("gp_particle", "mf_upf", "gp_ukf"):
            options = {} if kind == "gp_ukf" else {"particles": 300}
            filter = create_filter(kind, dynamics, measurement, **options)
            readings = z[:, : 20 if bench.QUICK else 120]
            history = run_filter(filter, readings, mean0, cov0, step_s=STEP_S)
            error = (history.mean - truth[1 : readings.shape[1] + 1])[:, readings.shape[1] // 2 :]
            position, velocity = (np.sqrt(np.square(error[..., i : i + 3]).sum(axis=-1).mean()) for i in (0, 3))
            cells.append(f"{position:.4f}, {1e3 * velocity:.3f}")
        rows.append(f"| `{variance}` | " + " | ".join(cells) + " |")
    return rows


def main():
    bench.keep_to_one_core()
    bench.publish("learned dynamics", bench.side_by_side_table(beside_scikit_learn(), "us"))
    errors = [f"RMS of `{kind}`, m, mm/s" for kind in ("gp_particle", "mf_upf", "gp_ukf")]
    header = ["`variance`", "mean and variance, us per particle", "`gp_particle`, us", "`mf_upf`, us", *errors]
    bench.publish("cheaper variances", bench.table(header, cheaper_variances()))


if __name__ == "__main__":
    main()
