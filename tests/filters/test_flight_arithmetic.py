"""Forms of the covariance in float64 and float32: beside 128 bits, beside `ekf`, and where they can't go on."""

import itertools
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from joseph_128 import distance, of_filter, of_form, problem, reference
from radar_problem import radar_problem

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.dynamics.augmentation.augmented import AugmentedDynamics
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.streams import RandomSource

LINEARISED = ("kf", "ekf", "ud_ekf", "srif")
I2 = np.eye(2)


@pytest.fixture(scope="module")
def hard():
    given = problem(1e8)
    return given, reference(given)


@pytest.mark.parametrize("kind", ["ud_ekf", "srif", "sr_ukf"])
@pytest.mark.parametrize("arithmetic, bound", [("float64", 1e-10), ("float32", 1e-3)])
def test_condition_1e8_is_met_to(bound, arithmetic, kind, hard):
    """Of sigma, in every direction of the state for the covariance, state by state for the mean.

    A mean can't be nearer than numbers of its size are to one another, which is 0.001 for 1e4 in float32.
    """
    given, exact = hard
    answers, sound = of_filter(kind, given, arithmetic)
    found = distance(answers, exact)
    assert sound and found.definite
    assert found.covariance < bound
    if arithmetic == "float64":
        assert found.mean < bound
    for (x, _), (x_ref, P_ref) in zip(answers, exact, strict=True):
        sigma = np.array([float(P_ref[i, i]) for i in range(6)]) ** 0.5
        mean = np.array([float(value) for value in x_ref])
        spacing = np.spacing(np.abs(mean).max().astype(arithmetic))
        assert (np.abs(x - mean) < bound * sigma + spacing).all()


def test_at_1e8_corrections_about_a_reference_are_met_in_every_direction(hard):
    """The state of `ud_ekf` in float32 is a correction of a float64 reference: it is what float32 has lost, not more.

    A mean of 1e4 itself is rounded by 0.0005, beside a least sigma of 1: see the table of the page.
    """
    given, exact = hard
    flt, reference_state, answers = given.filter("ud_ekf", arithmetic="float32"), np.zeros(6), []
    belief = flt.start(Gaussian(np.zeros((1, 6)), given.cov0[None]), RandomSource(0, (0,)))
    for k, z in enumerate(given.z):
        belief = replace(flt.predict(belief, Step(k)), x=np.zeros((1, 6), np.float32))
        reference_state = given.F @ reference_state
        belief, _ = flt.update(belief, (z - given.H @ reference_state)[None], Step(k))
        reference_state = reference_state + belief.mean[0]
        answers.append((reference_state, belief.covariance[0]))
    assert distance(answers, exact).mean < 1e-3 < distance(of_filter("ud_ekf", given, "float32")[0], exact).mean


def test_at_1e8_the_covariance_itself_has_lost_what_its_factors_hold(hard):
    given, exact = hard
    for arithmetic in ("float64", "float32"):
        lost = distance(of_filter("ekf", given, arithmetic)[0], exact).covariance
        kept = distance(of_filter("ud_ekf", given, arithmetic)[0], exact).covariance
        assert lost > 1e3 * kept


def test_float32_that_has_lost_its_covariance_or_its_state_fails_and_says_so():
    given = problem(1e12)
    assert not distance(of_form("joseph", given, "float32"), reference(given)).definite
    z = given.z[None]
    with pytest.warns(RuntimeWarning, match="not positive definite any more in float32; take ud_ekf"):
        history = run_filter(given.filter("ekf", arithmetic="float32"), z, np.zeros(6), given.cov0)
    assert np.isnan(history.mean[:, -1]).all()
    assert not run_filter(given.filter("ud_ekf", arithmetic="float32"), z, np.zeros(6), given.cov0).failures
    with pytest.warns(RuntimeWarning, match="float32 holds state . more coarsely than its sigma"):
        given = problem(1e16)
        run_filter(given.filter("ud_ekf", arithmetic="float32"), given.z[None], np.zeros(6), given.cov0)


@pytest.fixture(scope="module")
def radar():
    problem = radar_problem(runs=5, steps=20)
    problem.z[1, 4:8] = problem.z[2, 10, 1] = problem.z[:, 15] = np.nan
    return problem


def history(radar, kind, rows=slice(None), **options):
    flt = create_filter(kind, radar.dynamics, radar.measurement, **options)
    return run_filter(flt, radar.z[rows], radar.mean0[rows], radar.cov0)


def apart(one, other):
    sigma = np.sqrt(np.einsum("...ii->...i", other.covariance))
    return (
        np.abs((one.mean - other.mean) / sigma).max(),
        np.abs((one.covariance - other.covariance) / (sigma[..., :, None] * sigma[..., None, :])).max(),
        np.nanmax(np.abs(one.nis - other.nis)),
        np.abs(one.log_likelihood - other.log_likelihood).max(),
    )


@pytest.mark.parametrize("kind", ["ud_ekf", "srif"])
def test_is_the_extended_kalman_filter(kind, radar):
    assert max(apart(history(radar, kind), history(radar, "ekf"))) < 1e-9


@pytest.mark.parametrize("kind", [kind for kind in LINEARISED if kind != "kf"])
def test_float32_is_near_and_independent_of_the_block(kind, radar):
    whole, double = history(radar, kind, arithmetic="float32"), history(radar, "ekf")
    mean, covariance, nis, log_likelihood = apart(whole, double)
    # 5 km are held to 0.5 mm, a range is read to 4 m.
    assert 1e-7 < mean < 0.01 and covariance < 1e-3 and nis < 0.02 and log_likelihood < 0.01
    assert np.array_equal(whole.mean.astype(np.float32), whole.mean)
    for rows in ([1], [2, 4]):
        part = history(radar, kind, rows, arithmetic="float32")
        assert np.array_equal(part.mean, whole.mean[rows]) and np.array_equal(part.covariance, whole.covariance[rows])


def plain_joseph(F, Q, H, R, z, mean, P):
    """One epoch by Joseph's form in the order of the kernels, every operation rounded to float32.

    The reading is predicted in float64, as functions of models are, and then rounded.
    """
    f, exact = np.float32, np.array(H[0])
    F, Q, H, R, z, x, P = (np.asarray(A, dtype=f) for A in (F, Q, H, R, z, mean, P))
    x = f(F[:, 0] * x[0]) + f(F[:, 1] * x[1])
    FP = F[:, :1] * P[:1] + F[:, 1:] * P[1:]
    P = (Q + FP[:, :1] * F[:, 0]) + FP[:, 1:] * F[:, 1]
    P = np.tril(P) + np.tril(P, -1).T
    h = H[0]
    HP = h[0] * P[0] + h[1] * P[1]
    S = (HP[0] * h[0] + HP[1] * h[1]) + R[0, 0]
    L = np.sqrt(S)
    W = HP / L
    w = (z[0] - f(exact @ x.astype(float))) / L
    x = x + W * w
    K = W / L
    A = np.eye(2, dtype=f) - np.outer(K, h)
    M = A[:, :1] * P[:1] + A[:, 1:] * P[1:]
    T = R[0, 0] * K
    P = (M[:, :1] * A[:, 0] + M[:, 1:] * A[:, 1]) + np.outer(K, T)
    assert x.dtype == P.dtype == f
    return x, np.tril(P) + np.tril(P, -1).T


def test_float32_has_the_bits_of_numpys_float32():
    rng = np.random.default_rng(2)
    F, Q, H, R = [[1, 0.7], [0, 0.9]], [[0.3, 0.1], [0.1, 0.2]], [[1.0, 0.3]], [[0.37]]
    flt = create_filter("ekf", LinearDynamics(F, Q), LinearMeasurement(H, R), arithmetic="float32")
    z, mean, P = rng.normal(size=(1, 30, 1)), np.array([0.3, -0.2]), np.array([[2.0, 0.3], [0.3, 1.0]])
    found = run_filter(flt, z, mean, P)
    for k in range(30):
        mean, P = plain_joseph(F, Q, H, R, z[0, k], mean, P)
        np.testing.assert_array_equal(found.mean[0, k], mean)
        np.testing.assert_array_equal(found.covariance[0, k], P)


def test_considered_states_stay_as_predicted_in_float32():
    flow = AugmentedDynamics(LinearDynamics(np.eye(1), 0.1 * np.eye(1)), [1.0], [0.0], considered=(0,))
    z = np.random.default_rng(0).normal(size=(1, 10, 1))
    each = {}
    for kind, options in (("ekf", {}), ("ekf", {"arithmetic": "float32"}), ("ud_ekf", {"arithmetic": "float32"})):
        flt = create_filter(kind, flow, LinearMeasurement([[1.0, 1.0]], [[0.5]]), **options)
        each[kind, len(options)] = run_filter(flt, z, [0.0, 0.0], I2)
    for found in each.values():
        np.testing.assert_allclose(found.covariance, each["ekf", 0].covariance, rtol=1e-5, atol=1e-6)
        np.testing.assert_array_equal(found.mean[..., 1], 0.0)
        np.testing.assert_allclose(found.covariance[..., 1, 1], 1.0, rtol=1e-6)
    with pytest.raises(ValueError, match="'srif' can't account for states without estimating them"):
        create_filter("srif", flow, LinearMeasurement([[1.0, 1.0]], [[0.5]]))


@pytest.mark.parametrize(
    "F, R, cov0, missing",
    [
        (I2, [[0.0]], I2, "measurement noise in every channel"),
        ([[1.0, 1.0], [1.0, 1.0]], [[1.0]], I2, "a transition matrix that can be inverted"),
        (I2, [[1.0]], np.diag([1.0, 0.0]), "a prior with variance in every state"),
    ],
)
@pytest.mark.parametrize("arithmetic", ["float64", "float32"])
def test_srif_says_what_it_needs(arithmetic, F, R, cov0, missing):
    flow, sensor, z = LinearDynamics(F, 0.1 * I2), LinearMeasurement([[1.0, 0.2]], R), np.ones((1, 3, 1))
    with pytest.warns(RuntimeWarning, match=missing):
        found = run_filter(create_filter("srif", flow, sensor, arithmetic=arithmetic), z, [0.0, 0.0], cov0)
    assert found.failures[0].epoch == 0
    assert not run_filter(create_filter("ud_ekf", flow, sensor, arithmetic=arithmetic), z, [0, 0], cov0).failures


def test_only_these_filters_have_float32():
    have = {name for name, kind in filter_kinds().items() if kind.in_single}
    particles = {"particle", "unscented_particle", "mf_upf", "gp_particle"}
    own = {name for name, kind in filter_kinds().items() if kind.factory.__module__.startswith("relnav_sim.")}
    assert own - have == {*particles, "gaussian_sum", "imm", "batch_least_squares"}
    with pytest.raises(ValueError, match="'float64' or 'float32'"):
        create_filter("ekf", LinearDynamics(I2, I2), LinearMeasurement(I2, I2), arithmetic="float16")


def test_readings_and_what_they_are_compared_with_are_rounded():
    """A range of 7000 km is held to half a metre: what is left of a residual of 0.1 m is 0 or 0.5 m."""
    sensor = FunctionMeasurement(lambda x, epoch: 7e6 + x[..., :1], [[1.0]])
    flt = create_filter("ekf", LinearDynamics([[1.0]], [[0.0]]), sensor, arithmetic="float32")
    found = run_filter(flt, np.array([[[7e6 + 0.1]], [[7e6 + 0.4]]]), [0.0], [[1.0]])
    np.testing.assert_allclose(found.mean[:, 0, 0], [0.0, 0.25], rtol=1e-6)


PAGE = Path(__file__).parents[2] / "docs" / "flight-arithmetic.md"
BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "flight_arithmetic.py"


def rows_of(page, mark):
    lines = page.partition(f"<!-- {mark} -->\n")[2].partition("\n\n")[0].splitlines()[2:]
    return {float(cells[0]): cells[1:] for cells in ([c.strip() for c in line.split("|")[1:-1]] for line in lines)}


@pytest.mark.slow
def test_the_page_shows_what_is_measured():
    """Indefinite where it says so, errors within a factor of three of those shown."""
    measure = runpy.run_path(str(BENCHMARK))
    page = PAGE.read_text(encoding="utf-8")
    for arithmetic, which in itertools.product(measure["ARITHMETICS"], measure["TABLES"]):
        shown = [rows_of(page, f"{arithmetic} {what}{which}") for what in ("covariance", "mean")]
        assert list(shown[0]) == list(shown[1]) == measure["CONDITIONS"]
        for condition in shown[0]:
            for place, (covariance, mean, broken) in enumerate(measure["worst"](condition, arithmetic, which).values()):
                said = shown[0][condition][place]
                assert (said.endswith(f" in {broken} of 5")) == bool(broken)
                if not broken:
                    assert 1 / 3 < covariance / float(said) < 3
                    assert 1 / 3 < mean / float(shown[1][condition][place]) < 3
