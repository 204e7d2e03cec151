from functools import cache

import numpy as np
import pytest
from formation_flight import CW, STEP_S, F, flight, learned
from radar_problem import polar, polar_jacobian

from relnav_sim import FunctionMeasurement, LinearDynamics, create_filter, run_filter
from relnav_sim.campaign.entries import entry_from
from relnav_sim.dynamics.gp.options import GpOptions
from relnav_sim.filters.registry import filter_kinds

SIGMAS = np.array([0.1 / 3, np.radians(0.05 / 3), np.radians(0.05 / 3)])
MEASUREMENT = FunctionMeasurement(polar, np.diag(SIGMAS**2), polar_jacobian, angles=(1, 2))
COV0 = np.diag([10.0, 10.0, 10.0, 0.05, 0.05, 0.05]) ** 2
RUNS, STEPS, SETTLED = 6, 120, 60


def radar_track(seed=2):
    """Return truth, measurements and first estimates on the second revolution, after the training data."""
    rng = np.random.default_rng(seed)
    truth = flight()[600 : 601 + STEPS]
    z = polar(truth[1:]) + SIGMAS * rng.standard_normal((RUNS, STEPS, 3))
    return truth, z, truth[0] + rng.standard_normal((RUNS, 6)) * np.sqrt(np.diag(COV0))


def settled_errors(kind, dynamics, **options):
    truth, z, mean0 = radar_track()
    history = run_filter(create_filter(kind, dynamics, MEASUREMENT, **options), z, mean0, COV0, step_s=STEP_S)
    error = (history.mean - truth[1:])[:, SETTLED:]
    return np.sqrt(np.square(error[..., :3]).sum(axis=-1)).ravel(), np.sqrt(
        np.square(error[..., 3:]).sum(axis=-1)
    ).ravel()


@cache
def best_errors():
    """Return the errors of a filter told as process noise what CW leaves out: 1.75e-4 m and 3.5e-5 m/s a step."""
    tuned = LinearDynamics(F, np.diag([1e-4, 1e-4, 1e-4, 2e-5, 2e-5, 2e-5]) ** 2)
    return settled_errors("ukf", tuned)


@pytest.mark.parametrize(
    ("preset", "kind", "same"),
    [
        ("gp_particle", "particle", {"ess_fraction": 1.0, "mcmc_steps": 1, "roughening": 1.0}),
        ("gp_ukf", "ukf", {}),
        ("mf_upf", "unscented_particle", {}),
    ],
)
def test_presets_are_other_filters_with_their_own_defaults(preset, kind, same):
    assert issubclass(filter_kinds()[preset].factory, filter_kinds()[kind].factory)
    _, z, mean0 = radar_track()
    size = {} if kind == "ukf" else {"particles": 60}
    histories = [
        run_filter(create_filter(name, learned(), MEASUREMENT, **size, **options), z[:2, :6], mean0[:2], COV0)
        for name, options in ((preset, {}), (kind, same))
    ]
    np.testing.assert_array_equal(histories[0].mean, histories[1].mean)
    np.testing.assert_array_equal(histories[0].covariance, histories[1].covariance)


@pytest.mark.parametrize("kind", ["gp_ukf", "gp_particle", "mf_upf"])
def test_a_campaign_gives_them_learned_dynamics_by_default(kind):
    assert isinstance(entry_from({"kind": kind}).dynamics, GpOptions)
    assert filter_kinds()[kind].learned_dynamics


# Every kind and every target; the other pairs, a quarter of a minute each, with the long checks.
REACHED = [("absolute", "gp_ukf"), ("residual", "gp_ukf"), ("residual", "mf_upf")]
REACHED_SLOWLY = [("absolute", "gp_particle"), ("residual", "gp_particle"), ("absolute", "mf_upf")]


@pytest.mark.parametrize(
    ("target", "kind"), [*REACHED, *(pytest.param(*pair, marks=pytest.mark.slow) for pair in REACHED_SLOWLY)]
)
def test_learned_dynamics_reach_the_accuracy_that_the_radar_allows(kind, target):
    """From 10 m and 0.05 m/s of start error down to the level of a filter that knows the true perturbation's size."""
    size = {} if kind == "gp_ukf" else {"particles": 400}
    position, velocity = settled_errors(kind, learned(target, variance="cloud_mean"), **size)
    best = best_errors()
    assert np.median(position) < 1.7 * np.median(best[0])
    assert np.median(velocity) < 1.7 * np.median(best[1])


@pytest.mark.slow
def test_cheaper_variances_lose_little():
    """RMS over the settled part, 400 particles: the noise of the particles is larger than the loss."""
    exact = np.median(settled_errors("mf_upf", learned(), particles=400)[0])
    for variance in ("cloud_mean", "inducing"):
        cheap = np.median(settled_errors("mf_upf", learned(variance=variance), particles=400)[0])
        assert cheap < 1.25 * exact


def test_clohessy_wiltshire_without_process_noise_is_worse_than_learned_dynamics():
    learned_error = settled_errors("gp_ukf", learned())
    without = settled_errors("ukf", CW)
    assert np.median(without[0]) > 2 * np.median(learned_error[0])
    assert np.median(without[1]) > 2 * np.median(learned_error[1])


def test_bits_do_not_depend_on_the_block():
    _, z, mean0 = radar_track()
    for kind in ("gp_particle", "mf_upf"):

        def run(rows, kind=kind):
            filter = create_filter(kind, learned(), MEASUREMENT, particles=70)
            return run_filter(filter, z[rows, :4], mean0[rows], COV0, runs=rows)

        whole = run([0, 1, 2])
        for rows in ([0], [1, 2]):
            np.testing.assert_array_equal(run(rows).mean, whole.mean[rows])
            np.testing.assert_array_equal(run(rows).covariance, whole.covariance[rows])
