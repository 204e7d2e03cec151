"""What every registered filter promises, those of other packages included."""

import ast
import importlib.util
import inspect
import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from every_filter import CAUSAL, KINDS, SMALLER, small_options
from pydantic import ValidationError
from radar_problem import polar, polar_jacobian, radar_problem
from taking_turns import taking_turns

import relnav_sim
from relnav_sim import (
    FunctionMeasurement,
    LinearDynamics,
    LinearMeasurement,
    MixtureNoise,
    create_filter,
    run_filter,
)
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.filters.run import advance
from relnav_sim.options import Options
from relnav_sim.streams import RandomSource

ARRAYS = ("mean", "covariance", "nis", "log_likelihood")
EACH_KIND = [(kind,) for kind in KINDS]


def build(kind, problem, **options):
    return create_filter(kind, problem.dynamics, problem.measurement, **{**small_options(kind), **options})


def assert_same_bits(part, whole, rows, note=""):
    for name in ARRAYS:
        assert np.array_equal(getattr(part, name), getattr(whole, name)[rows], equal_nan=True), (
            f"{note}{name} of runs {rows} differs from the same runs in the whole block"
        )


def assert_positive_definite(P):
    assert np.abs(P - P.swapaxes(-1, -2)).max() <= 1e-9 * np.abs(P).max()
    scale = np.sqrt(np.einsum("...ii->...i", P))
    assert np.linalg.eigvalsh(P / (scale[..., :, None] * scale[..., None, :])).min() > 0


@pytest.fixture(scope="module")
def problem():
    problem = radar_problem(runs=5, steps=19)
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
    assert_positive_definite(history.covariance)


@pytest.mark.parametrize("kind", CAUSAL)
def test_a_missing_measurement_is_a_prediction_only(kind, problem, histories):
    history = histories[kind]
    missing = np.isnan(problem.z).all(axis=2)
    assert np.isnan(history.nis[missing]).all()
    assert not np.isnan(history.nis[~missing]).any()
    assert (history.log_likelihood[missing] == 0).all()
    # A set that draws its process noise may move by Q / N; every other mean must be the prediction to rounding.
    particle_set = "particles" in small_options(kind)
    noise = np.sqrt(np.diag(problem.Q) / SMALLER["particles"])
    for k in range(4, 8):
        before, after = history.covariance[1, k - 1], history.covariance[1, k]
        assert (
            np.abs(history.mean[1, k] - problem.F @ history.mean[1, k - 1]) <= (6 * noise if particle_set else 1e-9)
        ).all()
        # Nothing was measured, so no filter is surer than its model; one that forgets may be a little less sure.
        widening = np.sqrt(np.diag(after) / np.diag(problem.F @ before @ problem.F.T + problem.Q))
        assert widening.min() >= (0.7 if particle_set else 1 - 1e-6)
        assert widening.max() <= (1.3 if particle_set else 1.05)


@pytest.mark.parametrize("kind", KINDS)
def test_same_bits_whatever_the_block(kind, problem, histories):
    for rows in ([0], [1], [2, 3], [1, 2, 4]):
        part = run_filter(build(kind, problem), problem.z[rows], problem.mean0[rows], problem.cov0, seed=3, runs=rows)
        assert_same_bits(part, histories[kind], rows)


@pytest.mark.parametrize("kind, shared", taking_turns(EACH_KIND, [True, False]))
def test_same_bits_whatever_the_block_with_mixture_noise(kind, shared, problem):
    noise = MixtureNoise(np.array([0.8, 0.2]), np.stack([problem.R, 25 * problem.R]), shared)
    measurement = FunctionMeasurement(polar, noise, polar_jacobian, angles=(1, 2))
    glint = replace(problem, measurement=measurement, z=problem.z[:, :12])
    whole = run_filter(build(kind, glint), glint.z, glint.mean0, glint.cov0, seed=3)
    assert_positive_definite(whole.covariance)
    for rows in ([1], [0, 2, 3]):
        part = run_filter(build(kind, glint), glint.z[rows], glint.mean0[rows], glint.cov0, seed=3, runs=rows)
        assert_same_bits(part, whole, rows)


@pytest.mark.parametrize("kind, sizes", taking_turns(EACH_KIND, [(1, 1), (2, 3), (10, 9)]))
def test_any_number_of_states_and_measurements(kind, sizes):
    """Nine and more: sums over so many numbers are taken in another order than over a few."""
    n, m = sizes
    rng = np.random.default_rng(n)
    runs, steps = 4, 10
    F, H = np.eye(n) + 0.05 * rng.standard_normal((n, n)), rng.standard_normal((m, n))
    dynamics, measurement = LinearDynamics(F, 0.02 * np.eye(n)), LinearMeasurement(H, np.eye(m))
    x, z = rng.standard_normal((runs, n)), np.empty((runs, steps, m))
    for k in range(steps):
        x = x @ F.T + np.sqrt(0.02) * rng.standard_normal((runs, n))
        z[:, k] = x @ H.T + rng.standard_normal((runs, m))
    z[1, 4], z[:, 6] = np.nan, np.nan

    def run(rows):
        filter = create_filter(kind, dynamics, measurement, **small_options(kind))
        return run_filter(filter, z[rows], np.zeros(n), np.eye(n), seed=3, runs=rows)

    whole = run(list(range(runs)))
    assert whole.mean.shape == (runs, steps, n) and whole.covariance.shape == (runs, steps, n, n)
    assert np.isfinite(whole.mean).all() and np.isfinite(whole.log_likelihood).all()
    # In ten dimensions 200 particles are few; a particle set may then be flat to rounding.
    if n < 10 or "particles" not in small_options(kind):
        assert_positive_definite(whole.covariance)
    for rows in ([0], [1], [1, 3]):
        assert_same_bits(run(rows), whole, rows)


@pytest.mark.parametrize("kind", CAUSAL)
def test_a_run_that_breaks_down_leaves_the_others_alone(kind, problem, histories):
    others, steps = [0, 2, 3, 4], 8
    cov0 = np.broadcast_to(problem.cov0, (5, 6, 6)).copy()
    cov0[1] = -1e6 * np.eye(6)
    z = problem.z[:, :steps].copy()
    z[1, 2] = 1e200
    for measured, covariance in ((problem.z[:, :steps], cov0), (z, np.broadcast_to(problem.cov0, cov0.shape).copy())):
        # run_filter refuses such a covariance; a filter that loses its own on the way meets it here.
        filter = build(kind, problem)
        with np.errstate(all="ignore"):
            belief = filter.start(Gaussian(problem.mean0, covariance), RandomSource(3, tuple(range(5))))
        history = advance(filter, belief, measured, 0, 1.0)[1]
        assert {failure.run for failure in history.failures} <= {1}
        for failure in history.failures:
            assert (
                np.isnan(history.mean[1, failure.epoch :]).all() and np.isfinite(history.mean[1, : failure.epoch]).all()
            )
        for name in ARRAYS:
            before, after = getattr(histories[kind], name)[others, :steps], getattr(history, name)[others]
            assert np.array_equal(before, after, equal_nan=True), f"{name} of the other runs has changed"


@pytest.mark.parametrize("kind", [kind for kind in KINDS if small_options(kind)])
def test_same_bits_with_more_samples_than_a_buffer_of_numpy_holds(kind, problem):
    """NumPy cuts some sums where its buffer of 8192 numbers ends, which depends on what lies before."""
    many = dict.fromkeys(SMALLER.keys() & small_options(kind).keys(), 9001 if kind != "unscented_particle" else 1000)
    z = problem.z[:, 8:11]
    whole = run_filter(build(kind, problem, **many), z, problem.mean0, problem.cov0, seed=3)
    for row in (0, 3, 4):
        rows = [row]
        part = run_filter(build(kind, problem, **many), z[rows], problem.mean0[rows], problem.cov0, seed=3, runs=rows)
        assert np.array_equal(part.mean, whole.mean[rows])
        assert np.array_equal(part.covariance, whole.covariance[rows])


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_seed_gives_the_same_numbers(kind, problem, histories):
    again = run_filter(build(kind, problem), problem.z, problem.mean0, problem.cov0, seed=3)
    assert np.array_equal(again.mean, histories[kind].mean)


@pytest.mark.parametrize("kind", KINDS)
def test_inputs_are_not_changed(kind, problem):
    z, mean0, cov0 = problem.z[:, :8].copy(), problem.mean0.copy(), problem.cov0.copy()
    run_filter(build(kind, problem), z, mean0, cov0)
    assert np.array_equal(z, problem.z[:, :8], equal_nan=True)
    assert np.array_equal(mean0, problem.mean0)
    assert np.array_equal(cov0, problem.cov0)


@pytest.mark.parametrize("kind", CAUSAL)
def test_linear_gaussian_problem_is_solved_within_its_own_uncertainty(kind):
    """Bias, error and claimed covariance beside those of the Kalman filter.

    Robust, tempered and sampling filters lose up to 7 % here (200 samples); the bound on the bias is 4 sigma of the
    mean over the runs. The normalised errors are those of the middle run, so that a single unlucky set is no failure.
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
    dynamics, measurement = LinearDynamics(F, Q), LinearMeasurement(H, R)
    history = run_filter(create_filter(kind, dynamics, measurement, **small_options(kind)), z, np.zeros(2), cov0)
    best = run_filter(create_filter("kf", dynamics, measurement), z, np.zeros(2), cov0)
    error, reference = history.mean - truth, best.mean - truth
    last = error[:, -10:].mean(axis=1)
    assert (np.abs(last.mean(axis=0)) < 4 * last.std(axis=0) / np.sqrt(runs)).all()
    assert np.sqrt(np.square(error[:, 10:]).mean()) < 1.15 * np.sqrt(np.square(reference[:, 10:]).mean())
    nees = np.einsum("bki,bkij,bkj->bk", error, np.linalg.inv(history.covariance), error)[:, 10:] / 2
    assert 0.5 < np.median(nees.mean(axis=1)) < 1.5
    assert 0.7 < history.nis[:, 10:].mean() < 1.3


def wrong_values(schema):
    """Values that an option's own JSON schema excludes."""
    for form in schema.get("anyOf", [schema]):
        yield from (form[bound] - 1 for bound in ("minimum", "exclusiveMinimum") if bound in form)
        yield from (form[bound] + 1 for bound in ("maximum", "exclusiveMaximum") if bound in form)
        yield from (form[bound] for bound in ("exclusiveMinimum", "exclusiveMaximum") if bound in form)
    yield {"no": "such section"}
    types = {form.get("type") for form in schema.get("anyOf", [schema])}
    if "number" in types or "integer" in types:
        yield from (float("nan"), float("inf"), "3")
    if "integer" in types and "number" not in types:
        yield 2.5
    if "boolean" in types:
        yield from (1, "yes")
    if "enum" in schema:
        yield "no_such_word"


@pytest.mark.parametrize("kind", KINDS)
def test_unknown_and_wrong_options_are_refused(kind, problem):
    with pytest.raises(ValueError, match="no_such_option"):
        create_filter(kind, problem.dynamics, problem.measurement, no_such_option=1)
    model = filter_kinds()[kind].options_model
    assert issubclass(model, Options), "options are frozen, strict and without unknown keys: subclass Options"
    for name, schema in model.model_json_schema()["properties"].items():
        for value in wrong_values(schema):
            with pytest.raises(ValueError, match=name):
                create_filter(kind, problem.dynamics, problem.measurement, **{name: value})
                pytest.fail(f"option {name} takes {value!r}")


@pytest.mark.parametrize("kind", KINDS)
def test_options_have_valid_defaults_that_survive_a_file(kind):
    model = filter_kinds()[kind].options_model
    defaults = model()
    assert model.model_validate_json(defaults.model_dump_json()) == defaults
    assert model.model_validate(defaults.model_dump()) == defaults, "a default breaks its own rule"
    for name in model.model_fields:
        with pytest.raises(ValidationError, match="frozen"):
            setattr(defaults, name, None)
    shared = model.model_fields.keys() & FilterEntry.model_fields.keys()
    assert not shared, f"the options {sorted(shared)} have the names of keys that every filter of a campaign has"


@pytest.mark.parametrize("kind", KINDS)
def test_documented(kind):
    entry = filter_kinds()[kind]
    first, _, rest = entry.description.partition("\n\n")
    assert len(first) > 20 and len(rest) > 80, "the docstring says what it is, where it is from, when to use it"
    assert re.search(r"\b(19|20)\d\d\b", entry.description), "the docstring names its source, with the year"
    assert re.search(r"\b(use|take|trust|prefer|baseline)\b", entry.description, re.IGNORECASE), "when to use it"
    schema = entry.options_model.model_json_schema()
    json.dumps(schema)
    for section in (schema, *schema.get("$defs", {}).values()):
        for name, option in section.get("properties", {}).items():
            assert option.get("description"), f"option {name} has no description"


# A filter knows its models and its measurements; everything about the simulated world is out of its reach.
OUT_OF_REACH = ("truth", "sensors", "campaign", "runner", "results", "statistics", "report", "cli")


@cache
def imports(module):
    """The modules that a module's source names in import statements, wherever they stand; none if it is not Python."""
    spec = importlib.util.find_spec(module)
    if spec is None or not (spec.origin or "").endswith(".py"):
        return frozenset()
    package = module if spec.submodule_search_locations is not None else module.rpartition(".")[0]
    found = set()
    for node in ast.walk(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            for alias in node.names:
                # The public names of relnav_sim load from the modules that they live in.
                home = relnav_sim._HOME.get(alias.name) if base == "relnav_sim" else None
                found |= {base, f"relnav_sim.{home}" if home else f"{base}.{alias.name}"}
    return frozenset(found)


def is_module(name):
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False


@pytest.mark.parametrize("kind", KINDS)
def test_the_truth_is_out_of_reach(kind):
    home = inspect.getmodule(filter_kinds()[kind].factory).__name__
    followed = ("relnav_sim", home.partition(".")[0])
    seen, waiting = set(), [home]
    while waiting:
        module = waiting.pop()
        if module in seen or module.partition(".")[0] not in followed or not is_module(module):
            continue
        seen.add(module)
        # relnav_sim itself only says where its public names live; each of them is followed where it is imported.
        waiting.extend(imports(module) if module != "relnav_sim" else ())
    forbidden = {module for module in seen if module.startswith(tuple(f"relnav_sim.{part}" for part in OUT_OF_REACH))}
    assert not forbidden, f"{home} reaches {sorted(forbidden)}"
