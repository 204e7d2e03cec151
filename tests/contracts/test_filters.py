"""What every registered filter promises, those of other packages included."""

import json

import numpy as np
import pytest
from radar_problem import radar_problem

from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.filters.registry import filter_kinds

KINDS = sorted(filter_kinds())

# What it takes to run each filter in a test's time; the algorithm stays the same.
SMALLER = {"samples": 200, "particles": 200}


def small_options(kind):
    fields = filter_kinds()[kind].options_model.model_fields
    return {name: value for name, value in SMALLER.items() if name in fields}


def build(kind, problem, **options):
    return create_filter(kind, problem.dynamics, problem.measurement, **{**small_options(kind), **options})


@pytest.fixture(scope="module")
def problem():
    problem = radar_problem(runs=5, steps=25)
    problem.z[1, 4:8] = np.nan
    problem.z[2, 10, 1] = np.nan
    problem.z[:, 15] = np.nan
    return problem


@pytest.fixture(scope="module")
def histories(problem):
    return {kind: run_filter(build(kind, problem), problem.z, problem.mean0, problem.cov0, seed=3) for kind in KINDS}


@pytest.mark.parametrize("kind", KINDS)
def test_shapes_types_and_positive_definite_covariances(kind, problem, histories):
    history = histories[kind]
    runs, steps, _ = problem.z.shape
    for array, shape in (
        (history.mean, (runs, steps, 6)),
        (history.covariance, (runs, steps, 6, 6)),
        (history.nis, (runs, steps)),
        (history.log_likelihood, (runs, steps)),
        *((extra, (runs, steps)) for extra in history.extras.values()),
    ):
        assert array.shape == shape
        assert array.dtype == np.float64
    assert np.isfinite(history.mean).all()
    assert np.isfinite(history.log_likelihood).all()
    P = history.covariance
    assert np.abs(P - P.swapaxes(-1, -2)).max() <= 1e-9 * np.abs(P).max()
    scale = np.sqrt(np.einsum("bkii->bki", P))
    correlation = P / (scale[..., :, None] * scale[..., None, :])
    assert np.linalg.eigvalsh(correlation).min() > 0


@pytest.mark.parametrize("kind", KINDS)
def test_a_missing_measurement_is_a_prediction_only(kind, problem, histories):
    history = histories[kind]
    missing = np.isnan(problem.z).any(axis=2)
    assert np.isnan(history.nis[missing]).all()
    assert not np.isnan(history.nis[~missing]).any()
    assert (history.log_likelihood[missing] == 0).all()
    # Drawn process noise moves a cloud's mean by Q / N; everything else must be F m to rounding.
    noise = np.sqrt(np.diag(problem.Q) / SMALLER["particles"])
    allowed = 6 * noise if "particles" in small_options(kind) else 1e-9
    for k in range(4, 8):
        moved = problem.F @ history.mean[1, k - 1]
        assert (np.abs(history.mean[1, k] - moved) <= allowed).all()


@pytest.mark.parametrize("kind", KINDS)
def test_same_bits_whatever_the_block(kind, problem, histories):
    for rows in ([0], [1], [2, 3], [1, 2, 4]):
        part = run_filter(build(kind, problem), problem.z[rows], problem.mean0[rows], problem.cov0, seed=3, runs=rows)
        for name in ("mean", "covariance", "nis", "log_likelihood"):
            assert np.array_equal(getattr(part, name), getattr(histories[kind], name)[rows], equal_nan=True), (
                f"{name} of runs {rows} differs from the same runs in the whole block"
            )


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_seed_gives_the_same_numbers(kind, problem, histories):
    again = run_filter(build(kind, problem), problem.z, problem.mean0, problem.cov0, seed=3)
    assert np.array_equal(again.mean, histories[kind].mean)


@pytest.mark.parametrize("kind", KINDS)
def test_inputs_are_not_changed(kind, problem):
    z, mean0, cov0 = problem.z.copy(), problem.mean0.copy(), problem.cov0.copy()
    run_filter(build(kind, problem), z, mean0, cov0)
    assert np.array_equal(z, problem.z, equal_nan=True)
    assert np.array_equal(mean0, problem.mean0)
    assert np.array_equal(cov0, problem.cov0)


@pytest.mark.parametrize("kind", KINDS)
def test_linear_gaussian_problem_is_solved_within_its_own_uncertainty(kind):
    """The mean over runs of the error, against the filter's own covariance and its Monte Carlo error.

    Robust and tempered filters are less efficient than the Kalman filter but must stay unbiased and stable.
    """
    rng = np.random.default_rng(8)
    runs, steps = 40, 30
    F, Q = np.array([[1.0, 1.0], [0.0, 1.0]]), np.diag([0.02, 0.01])
    H, R, cov0 = np.array([[1.0, 0.0]]), np.array([[1.0]]), np.diag([4.0, 1.0])
    x = rng.standard_normal((runs, 2)) @ np.sqrt(cov0)
    truth, z = np.empty((runs, steps, 2)), np.empty((runs, steps, 1))
    for k in range(steps):
        x = x @ F.T + rng.standard_normal((runs, 2)) @ np.sqrt(Q)
        truth[:, k] = x
        z[:, k] = x @ H.T + rng.standard_normal((runs, 1))
    filter = create_filter(kind, LinearDynamics(F, Q), LinearMeasurement(H, R), **small_options(kind))
    error = run_filter(filter, z, np.zeros(2), cov0).mean - truth
    reference = (
        run_filter(create_filter("kf", LinearDynamics(F, Q), LinearMeasurement(H, R)), z, np.zeros(2), cov0).mean
        - truth
    )
    last = error[:, -10:].mean(axis=1)
    assert (np.abs(last.mean(axis=0)) < 4 * last.std(axis=0) / np.sqrt(runs)).all()
    assert np.sqrt(np.square(error[:, 10:]).mean()) < 1.35 * np.sqrt(np.square(reference[:, 10:]).mean())


@pytest.mark.parametrize("kind", KINDS)
def test_unknown_and_wrong_options_are_refused(kind, problem):
    with pytest.raises(ValueError, match="no_such_option"):
        create_filter(kind, problem.dynamics, problem.measurement, no_such_option=1)


@pytest.mark.parametrize("kind", KINDS)
def test_documented(kind):
    entry = filter_kinds()[kind]
    first, _, rest = entry.description.partition("\n\n")
    assert len(first) > 20 and len(rest) > 80, "the docstring says what it is, where it is from, when to use it"
    for name, field in entry.options_model.model_fields.items():
        assert field.description, f"option {name} has no description"
    json.dumps(entry.options_model.model_json_schema())
