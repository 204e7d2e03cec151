"""Formulas of operations: by hand at n = 6, m = 3, and beside what kernels do on numbers that count."""

import numpy as np
import pytest
from counted_operations import RUNS, counting
from every_filter import KINDS

from relnav_sim import LinearDynamics, LinearMeasurement, create_filter
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters import registry
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.operations import Size
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.options import Options
from relnav_sim.streams import RandomSource

THEMES = {
    "kalman": (
        *(name + end for name in ("predict", "predict_linear") for end in ("", "_single")),
        *("update", "update_by_moments", "innovation"),
    ),
    "joseph": ("update", "update_single", "update_by_points"),
    "ud": ("predict", "update", "predict_single", "update_single", "factor_single"),
    "srif": ("predict", "update"),
    "roots": tuple(
        name + end
        for name in ("cholesky", "solve", "whiten", "squares", "triangular", "update")
        for end in ("", "_single")
    ),
    "sigma_points": tuple(
        name + end
        for name in ("predict", "moments", "points", "points_of_root", "weighted_deviations")
        for end in ("", "_single")
    ),
    "iekf": ("linearised_reading", "linearised_reading_single"),
    "reweighting": tuple(name + end for name in ("residuals", "scaled", "whitened") for end in ("", "_single")),
    "components": ("mix", "moment_match", "reweigh", "expected_reading"),
    "two_step": tuple(name + end for name in ("turned", "misfit", "step", "linearise") for end in ("", "_single")),
    "particles": ("affine", "add_noise", "weigh", "roots"),
    "likelihood": ("gaussian",),
    "proposal": ("propose", "draw", "sigma_points"),
}


class Dense(LinearDynamics):
    """Dynamics that count as nonlinear, and give a matrix for each run."""

    linear = False

    def propagate(self, states, step):
        return np.einsum("ij,...j->...i", super().transition(states, step), states)

    def transition(self, mean, step):
        return np.repeat(super().transition(mean, step)[None], len(mean), axis=0)

    def process_noise(self, states, step):
        return np.repeat(super().process_noise(states, step)[None], len(states), axis=0)


def counted(monkeypatch, kind, n, m, **options):
    """Return the operations of an epoch that the filter's kernels make."""
    rng = np.random.default_rng(0)
    A, B = rng.normal(size=(n, n)), rng.normal(size=(m, m))
    P = A @ A.T + np.eye(n)
    flow = Dense(np.eye(n) + 0.1 * rng.normal(size=(n, n)), 0.1 * P)
    flt = create_filter(kind, flow, LinearMeasurement(rng.normal(size=(m, n)), B @ B.T + np.eye(m)), **options)
    belief = flt.start(Gaussian(np.zeros((RUNS, n)), np.repeat(P[None], RUNS, axis=0)), RandomSource(0, (0, 1)))
    with monkeypatch.context() as patch:
        count = counting(patch, **THEMES)
        flt.update(flt.predict(belief, Step(1)), rng.normal(size=(RUNS, m)), Step(1))
        return count["operations"] / RUNS


def formula(kind, n, m, noises=2, **options):
    known = filter_kinds()[kind]
    return known.operations(Size(n, m, noises), known.options_model(**options))


EXACT = [
    *((kind, {}) for kind in ("kf", "ekf", "ud_ekf", "srif", "ukf", "ckf", "sr_ukf", "huber", "mckf", "student_t")),
    # A search on linear models is over after two iterations.
    ("iekf", {"max_iterations": 2}),
]


@pytest.mark.parametrize("n, m", [(4, 2), pytest.param(6, 3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind, options", EXACT, ids=[kind for kind, _ in EXACT])
def test_formula_is_what_kernels_count(kind, options, n, m, monkeypatch):
    # R is the same for both runs, so that a factor of it alone counts half.
    assert formula(kind, n, m, **options).count == pytest.approx(counted(monkeypatch, kind, n, m, **options), rel=0.01)


@pytest.mark.parametrize(
    "kind, options, near",
    [
        *((kind, {}, 0.03) for kind in ("kf", "ud_ekf", "ukf", "sr_ukf", "student_t", "adaptive_alpha_kf")),
        ("iekf", {"max_iterations": 2}, 0.04),
        ("two_step", {"max_iterations": 2}, 0.1),
    ],
)
def test_in_float32_too(kind, options, near, monkeypatch):
    options = {**options, "arithmetic": "float32"}
    single, double = formula(kind, 6, 3, **options), formula(kind, 6, 3)
    found = counted(monkeypatch, "ekf" if kind == "kf" else kind, 5, 2, **options)
    assert formula(kind, 5, 2, **options).count == pytest.approx(found, rel=near)
    assert single.bytes == double.bytes / 2


@pytest.mark.parametrize(
    "kind, options, noises",
    [
        ("adaptive_alpha_kf", {}, 1),
        ("imm", {}, 1),
        ("two_step", {"max_iterations": 2}, 1),
        ("adaptive_two_step", {"max_iterations": 2}, 1),
        ("particle", {"particles": 12}, 1),
        ("unscented_particle", {"particles": 12}, 1),
    ],
)
def test_formula_is_near_what_kernels_count(kind, options, noises, monkeypatch):
    found = counted(monkeypatch, kind, 6, 3, **options)
    assert formula(kind, 6, 3, noises, **options).count == pytest.approx(found, rel=0.1)


def test_by_hand_for_six_states_and_three_channels():
    """Each line is a step on paper: products of (p, q) and (q, r) take p r (2 q - 1)."""
    prediction = 6 * 6 * 11 + 21 * 13  # F P, then a triangle of (F P) F^T + Q
    innovation = 3 * 6 * 11 + 3 * 3 * 11 + 9  # H P, H P H^T, + R
    factor = 3 + 3 + (2 * 3 + 2 * 1)  # roots, quotients, what is subtracted from what is left
    solved = 6 * 9 + 9  # L^-1 H P and L^-1 nu
    moved = 2 * 6 * 3 + 21 * 6  # mean, and a triangle of P - W^T W
    told = 2 * 3 + 3 + 4 + 3 * 3  # NIS, log-likelihood, tests of digits
    assert formula("ekf", 6, 3).count == prediction + innovation + factor + solved + moved + told == 1236
    assert formula("ekf", 6, 3).bytes == 8 * (2 * (6 + 36) + 36 + 36 + 18 + 9 + 3) == 1488

    mean = 6 * 11
    times_root = 2 * 6 * 15  # F U: column j has j products and sums in each of six rows
    noise = 12 + 15 + 2 * (1 + 3 + 6 + 10 + 15)  # tests of pivots, quotients, what is subtracted
    schmidt = 6 * (3 * 12 - 1) + 15 * 4 * 12  # six rows of twelve, fifteen pairs
    decorrelation = (6 + 3 + 2 * (1 + 3)) + 3 * (2 + 12)
    scalar = (12 + 30 + 6) + (30 + 60) + 18  # innovation, U^T h and D f; alphas, factors; gain and mean
    assert formula("ud_ekf", 6, 3).count == mean + times_root + noise + schmidt + decorrelation + 3 * scalar + 26
    assert formula("ud_ekf", 6, 3).count == 1826
    assert formula("ud_ekf", 6, 3, arithmetic="float32").bytes == 4 * (2 * (6 + 36 + 6) + 102) == 792


@pytest.mark.parametrize("kind", KINDS)
def test_every_filter_states_a_formula_that_grows(kind):
    known = filter_kinds()[kind]
    if not known.factory.__module__.startswith("relnav_sim."):
        pytest.skip("of another package")
    if known.repeats:  # over all readings of a run, as no flight computer does at an epoch
        assert known.operations is None
        return
    small, large = formula(kind, 6, 3), formula(kind, 12, 3)
    assert 0 < small.count < large.count and 0 < small.bytes < large.bytes
    assert small.count < formula(kind, 6, 6).count
    for name in ("samples", "particles"):
        if name in known.options_model.model_fields:
            fewer, more = (formula(kind, 6, 3, **{name: number}).count for number in (1000, 2000))
            assert 1.7 < more / fewer < 2.01


def test_a_plug_in_may_state_none():
    kind = registry.FilterKind("own", Options, object, "spherical", 1.0)
    assert kind.operations is None
