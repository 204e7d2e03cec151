"""Epochs that a Kalman filter takes in one go give what it gives from epoch to epoch, to the last bit."""

import warnings

import numpy as np
import pytest
from radar_problem import MEAN_MOTION, SIGMAS

from relnav_sim import LinearDynamics, create_filter, run_filter
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.dynamics.by_epoch import LinearByEpoch
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from relnav_sim.dynamics.white_noise import AddedNoise
from relnav_sim.filters.adaptive_alpha_kf import AdaptiveAlphaFilter, AdaptiveAlphaOptions
from relnav_sim.filters.alpha_kf import AlphaKalmanFilter, AlphaOptions
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.ekf import ExtendedKalmanFilter, ExtendedOptions
from relnav_sim.filters.kalman import GaussianFilter, KalmanFilter, KalmanOptions
from relnav_sim.filters.run import advance
from relnav_sim.filters.ukf import UnscentedKalmanFilter, UnscentedOptions
from relnav_sim.measurements.converted_radar import ConvertedRadar
from relnav_sim.measurements.partial import PartialMeasurement
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar
from relnav_sim.streams import RandomSource

F, Q = cw_transition(MEAN_MOTION, 2.0), np.diag([1e-4] * 3 + [1e-6] * 3)
P0 = np.diag([10.0] * 3 + [0.1] * 3) ** 2
RUNS, EPOCHS = 35, 30


class ByStep(ExtendedKalmanFilter):
    """The same filter with an update that others may count."""

    updates = 0

    def update(self, belief, z, step):
        self.updates += 1
        return super().update(belief, z, step)


class ByStepLinear(KalmanFilter):
    """The linear filter, likewise."""

    def correct(self, belief, z, step):
        return super().correct(belief, z, step)


class ByStepPoints(UnscentedKalmanFilter):
    """The unscented filter, likewise."""

    def correct(self, belief, z, step):
        return super().correct(belief, z, step)


class ByStepSamples(AlphaKalmanFilter):
    """The alpha-divergence filter, likewise."""

    def correct(self, belief, z, step):
        return super().correct(belief, z, step)


class ByStepStudent(AdaptiveAlphaFilter):
    """The adaptive filter, likewise."""

    def correct(self, belief, z, step):
        return super().correct(belief, z, step)


class Counting:
    """What counts how often a measurement is asked for compiled epochs."""

    def __init__(self, *given):
        super().__init__(*given)
        self.taken = []

    def filtered(self, *given):
        self.taken.append(super().filtered(*given))
        return self.taken[-1]


class Counted(Counting, SphericalRadar):
    """A radar so."""


class CountedConverted(Counting, ConvertedRadar):
    """A radar whose readings are converted."""


def radar(attitude=1e-3, kind=Counted, host=()):
    noise = SightNoise(np.ones(1), SIGMAS[None], SIGMAS, attitude**2 * np.eye(3))
    return kind(np.eye(3), noise, *host)


def readings(measurement, seed=3, sigmas=SIGMAS):
    rng = np.random.default_rng(seed)
    x = np.array([0.0, 5000.0, 200.0, 0.0, 0.0, 0.0])
    z = measurement.predict(np.broadcast_to(x, (RUNS, EPOCHS, 6)), 0) + sigmas * rng.normal(size=(RUNS, EPOCHS, 3))
    return z, x + rng.normal(size=(RUNS, 6)) * np.sqrt(np.diag(P0))


EXTENDED = (ExtendedKalmanFilter, ByStep), ExtendedOptions()
UNSCENTED = (UnscentedKalmanFilter, ByStepPoints), UnscentedOptions(alpha=0.7, beta=1.5, kappa=0.5)
SAMPLED = (AlphaKalmanFilter, ByStepSamples), AlphaOptions(samples=200, sampling="fixed", alpha=0.3)
STUDENT = (AdaptiveAlphaFilter, ByStepStudent), AdaptiveAlphaOptions(iterations=3, alpha_min=0.05)
OTHERS = [UNSCENTED, SAMPLED, STUDENT]


def compare(z, mean0, cov0=P0, dynamics=None, measurement=None, filters=EXTENDED):
    """Filter in one go and epoch by epoch; return what the radar took."""
    dynamics, measurement = dynamics or LinearDynamics(F, Q), measurement or radar()
    kinds, options = filters
    made = [kind(dynamics, PartialMeasurement(measurement), options) for kind in kinds]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of runs that fail
        found, expected = (run_filter(filter, z, mean0, cov0) for filter in made)
    for name in ("mean", "covariance", "nis", "log_likelihood", "dof"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    assert found.extras.keys() == expected.extras.keys()
    for name, extra in expected.extras.items():
        np.testing.assert_array_equal(found.extras[name], extra)
    assert found.failures == expected.failures
    return measurement.taken, found


@pytest.mark.parametrize("attitude", [0.0, 1e-3])
def test_all_epochs_are_taken_at_once(attitude):
    measurement = radar(attitude)
    z, mean0 = readings(measurement)
    assert compare(z, mean0, measurement=measurement)[0] == [EPOCHS]


@pytest.mark.parametrize("filters", OTHERS)
@pytest.mark.parametrize("kind", [Counted, CountedConverted])
@pytest.mark.parametrize("attitude", [0.0, 1e-3])
def test_other_filters(filters, kind, attitude):
    measurement = radar(attitude, kind)
    z, mean0 = readings(measurement, sigmas=SIGMAS if kind is Counted else 5.0)
    gaps = np.random.default_rng(4).random((RUNS, EPOCHS)) < 0.3
    gaps[:, 7] = True
    z = np.where(gaps[..., None], np.nan, z)
    z[2, 10] *= 1.5  # an outlier
    taken, many = compare(z, mean0, measurement=measurement, filters=filters)
    assert taken == [EPOCHS]
    for run in (0, 2, 34):
        one, alone = compare(z[run : run + 1], mean0[run : run + 1], measurement=measurement, filters=filters)
        assert one == [EPOCHS, EPOCHS]
        taken.pop()
        for name in ("mean", "covariance", "nis", "log_likelihood"):
            np.testing.assert_array_equal(getattr(alone, name)[0], getattr(many, name)[run])


@pytest.mark.parametrize("filters", OTHERS)
def test_other_filters_where_runs_fail_or_need_more(filters):
    z, mean0 = readings(radar())
    mean0[4] = 1e300
    mean0[9, :3] = 0.0  # on the radar itself
    wide = np.broadcast_to(P0, (RUNS, 6, 6)).copy()
    wide[20] *= 1e12
    wide[33] *= 1e16
    taken, history = compare(z, mean0, wide, filters=filters)
    assert {failure.run for failure in history.failures} >= {4}
    assert 0 < sum(taken) < EPOCHS
    known = np.broadcast_to(P0, (RUNS, 6, 6)).copy()
    known[3, 2] = known[3, :, 2] = 0.0  # a state that is known, so that there is no Cholesky factor
    still = LinearDynamics(np.eye(6), np.zeros((6, 6)))
    taken, _ = compare(z, mean0, known, dynamics=still, filters=filters)
    assert taken[0] == 0 and (filters == STUDENT or sum(taken) == 0)


@pytest.mark.parametrize("r_scale", [1.0, 2.0])
def test_converted_readings(r_scale):
    measurement = radar(kind=CountedConverted)
    z, mean0 = readings(measurement, sigmas=5.0)
    z[np.random.default_rng(4).random((RUNS, EPOCHS)) < 0.3] = np.nan
    z[3, 20, 0] = np.nan  # such a reading counts as missing
    filters = (KalmanFilter, ByStepLinear), KalmanOptions(r_scale=r_scale)
    assert compare(z, mean0, measurement=measurement, filters=filters)[0] == [EPOCHS]


def test_readings_with_gaps():
    z, mean0 = readings(radar())
    gaps = np.random.default_rng(4).random((RUNS, EPOCHS)) < 0.3
    gaps[:, 7] = True
    assert compare(np.where(gaps[..., None], np.nan, z), mean0)[0] == [EPOCHS]
    z[3, 20, 0] = np.nan  # the range alone is missing
    assert compare(z, mean0)[0] == []


def test_an_epoch_that_needs_more_is_taken_by_itself():
    z, mean0 = readings(radar())
    wide = np.broadcast_to(P0, (RUNS, 6, 6)).copy()
    wide[33] *= 1e16
    taken, _ = compare(z, mean0, wide)
    assert taken == [0, 0, 16, EPOCHS - 19]  # at the epochs 0 and 1, and after a pause at 3; few at first


def test_it_is_tried_less_often_where_every_epoch_needs_more():
    z, mean0 = readings(radar())
    taken, history = compare(z, mean0, dynamics=LinearDynamics(F, 1e8 * Q), filters=SAMPLED)
    assert (history.extras["fallback"].sum(axis=0) > 0).all()
    assert taken == [0] * 5  # at the epochs 0, 1, 3, 7 and 15


@pytest.mark.parametrize("every", [3, 50])
def test_it_asks_for_a_few_times_as_many_matrices_as_there_are_epochs(every):
    """Where an epoch needs more now and again, each stretch after it is asked for anew."""
    epochs, asked = 600, []

    class Asked(LinearDynamics):
        def known_steps(self, first_epoch, count):
            asked.append(count)
            return super().known_steps(first_epoch, count)

    noise = np.stack([Q * (1e14 if k % every == 0 else 1.0) for k in range(epochs)])
    rng = np.random.default_rng(5)
    x = np.array([0.0, 5000.0, 200.0, 0.0, 0.0, 0.0])
    z = radar().predict(np.broadcast_to(x, (2, epochs, 6)), 0) + SIGMAS * rng.normal(size=(2, epochs, 3))
    dynamics = Asked(np.broadcast_to(np.eye(6), (epochs, 6, 6)).copy(), noise)
    taken, _ = compare(z, np.broadcast_to(x, (2, 6)), dynamics=dynamics)
    # Every stop costs one try that is in vain and one that is not: 16 each, or twice what the last one gave.
    assert taken.count(0) > 1 and sum(taken) > epochs / 3
    assert sum(asked) <= epochs + 2 * 16 * taken.count(0) + 2 * sum(taken)


def test_runs_that_fail():
    z, mean0 = readings(radar())
    mean0[4] = 1e300
    mean0[9, :3] = 0.0  # on the radar itself, where there are no angles
    taken, history = compare(z, mean0)
    assert {failure.run for failure in history.failures} >= {4}
    assert sum(taken) > 0


@pytest.mark.parametrize("shared", [True, False])
def test_matrices_by_epoch(shared):
    each = np.stack([cw_transition(MEAN_MOTION, 2.0 + 0.01 * k) for k in range(EPOCHS)])
    z, mean0 = readings(radar())
    noise = Q if shared else np.stack([Q * (1 + k) for k in range(EPOCHS)])
    assert compare(z, mean0, dynamics=LinearDynamics(each, noise))[0] == [EPOCHS]
    by_epoch = LinearByEpoch(lambda epochs: np.stack([cw_transition(MEAN_MOTION, 2.0 + 0.01 * k) for k in epochs]), Q)
    assert compare(z, mean0, dynamics=by_epoch)[0] == [EPOCHS]


def test_matrices_in_any_order_in_memory():
    z, mean0 = readings(radar())
    other = LinearDynamics(np.asfortranarray(F), np.asfortranarray(Q + 1e-7))
    assert compare(z, mean0, dynamics=other)[0] == [EPOCHS]
    each = np.broadcast_to(Q, (EPOCHS, 6, 6)).transpose(0, 2, 1)
    assert compare(z, mean0, dynamics=LinearDynamics(F.T, each))[0] == [EPOCHS]
    added = AddedNoise(LinearDynamics(F, Q), np.asfortranarray(Q + 1e-7))
    assert compare(z, mean0, dynamics=added)[0] == [EPOCHS]


def test_added_process_noise_is_in_it():
    z, mean0 = readings(radar())
    added = {"acceleration_psd_m2_s3": 1e-3, "mean_motion_rad_s": MEAN_MOTION, "step_s": 2.0}
    plain, more = (
        run_filter(create_filter("ekf", LinearDynamics(F, Q), radar(), process_noise=noise), z, mean0, P0)
        for noise in (None, added)
    )
    assert (
        np.diagonal(more.covariance[:, -1], axis1=1, axis2=2) > np.diagonal(plain.covariance[:, -1], axis1=1, axis2=2)
    ).all()


def test_what_a_derived_class_has_of_its_own_is_heard():
    measurement = radar()
    z, mean0 = readings(measurement)
    filter = ByStep(LinearDynamics(F, Q), PartialMeasurement(measurement), ExtendedOptions())
    run_filter(filter, z, mean0, P0)
    assert filter.updates == EPOCHS and measurement.taken == []

    class Noisier(LinearDynamics):
        def process_noise(self, states, step):
            return 4.0 * super().process_noise(states, step)

    taken, history = compare(z, mean0, dynamics=Noisier(F, Q))
    assert taken == []
    np.testing.assert_array_equal(history.mean, compare(z, mean0, dynamics=LinearDynamics(F, 4.0 * Q))[1].mean)

    class Poorer(SphericalRadar):
        def noise(self, mean, epoch):
            return 4.0 * super().noise(mean, epoch)

    own, doubled = (
        run_filter(create_filter("ekf", LinearDynamics(F, Q), one), z, mean0, P0)
        for one in (radar(kind=Poorer), radar(kind=SphericalRadar))
    )
    assert (own.covariance[:, -1, 0, 0] > doubled.covariance[:, -1, 0, 0]).all()


def counting(base, name, called):
    """Return a class derived from a base that takes down the calls of one of its functions."""

    def counted(self, *given, **named):
        called.append(name)
        return getattr(super(derived, self), name)(*given, **named)

    derived = type(base.__name__, (base,), {name: counted})
    return derived


def functions(kind):
    return [name for name in dir(kind) if not name.startswith("__") and callable(getattr(kind, name))]


ALL = [EXTENDED, *OTHERS]


@pytest.mark.parametrize("kind", [SphericalRadar, ConvertedRadar])
@pytest.mark.parametrize("filters", ALL)
def test_whatever_a_derived_radar_replaces_is_heard_as_often_as_step_by_step(filters, kind):
    (in_one_go, by_step), options = filters
    z, mean0 = readings(radar(kind=kind), sigmas=SIGMAS if kind is SphericalRadar else 5.0)
    heard = 0
    for name in [name for name in functions(kind) if not name.startswith("_")]:
        counts = []
        for each in (in_one_go, by_step):
            measurement = radar(kind=counting(kind, name, called := []))
            run_filter(each(LinearDynamics(F, Q), PartialMeasurement(measurement), options), z[:2], mean0[:2], P0)
            counts.append(len(called))
        if name != "filtered":
            assert counts[0] == counts[1], name
            heard += counts[1] >= EPOCHS
    assert heard > 0


@pytest.mark.parametrize("filters", ALL)
def test_whatever_a_derived_filter_replaces_is_heard_as_often_as_step_by_step(filters):
    (in_one_go, by_step), options = filters
    z, mean0 = readings(radar())
    heard = 0
    for name in functions(in_one_go):
        counts = []
        for each in (in_one_go, by_step):
            filter = counting(each, name, called := [])(LinearDynamics(F, Q), PartialMeasurement(radar()), options)
            run_filter(filter, z[:2], mean0[:2], P0)
            counts.append(len(called))
        if name not in ("compiled_epochs", "epochs_by"):
            assert counts[0] == counts[1], name
            heard += counts[1] >= EPOCHS
    assert heard > 2


@pytest.mark.parametrize("filters", ALL)
def test_what_another_base_replaces_is_heard(filters):
    (kind, _), options = filters
    z, mean0 = readings(radar())
    other = counting(GaussianFilter, "update", called := [])

    class Both(kind, other):
        """Its update comes after the filter's own, which calls it by `super` where there is one."""

    filter = Both(LinearDynamics(F, Q), PartialMeasurement(measurement := radar()), options)
    run_filter(filter, z, mean0, P0)
    assert len(called) == EPOCHS and measurement.taken == []


@pytest.mark.parametrize(("preset", "options"), [("ckf", {}), ("mkf", {"samples": 200, "sampling": "fixed"})])
def test_presets_take_all_epochs_at_once(preset, options):
    measurement = radar()
    z, mean0 = readings(measurement)
    run_filter(create_filter(preset, LinearDynamics(F, Q), measurement, **options), z, mean0, P0)
    assert sum(measurement.taken) >= EPOCHS - 1  # the samples may not tell a covariance of the first


@pytest.mark.parametrize("filters", ALL)
@pytest.mark.parametrize("kind", [Counted, CountedConverted])
@pytest.mark.parametrize("size", [1e155, 1e160, 1e300])
def test_a_run_is_said_to_fail_when_and_why_it_does_step_by_step(filters, kind, size):
    """A transition takes all numbers of the runs beyond what can be held, after any epoch of the first chunk."""
    (in_one_go, by_step), options = filters
    rng = np.random.default_rng(8)
    z, mean0 = readings(radar(kind=kind), sigmas=SIGMAS if kind is Counted else 5.0)
    z, mean0 = z[:4, :8], mean0[:4]
    correlated = 100 * np.ones((6, 6)) + 1e-2 * np.eye(6)
    failed = 0
    for lost in range(1, 4):
        each = np.broadcast_to(F, (8, 6, 6)).copy()
        each[lost] = rng.normal(size=(6, 6)) * size
        said = []
        for each_kind in (in_one_go, by_step):
            filter = each_kind(LinearDynamics(each, Q), PartialMeasurement(radar(kind=kind)), options)
            belief = filter.start(Gaussian(mean0, np.broadcast_to(correlated, (4, 6, 6)).copy()), RandomSource(0, (0,)))
            failures = []
            for first in range(0, 8, 4):
                belief, history = advance(filter, belief, z[:, first : first + 4], first, 2.0)
                failures.append(history.failures)
            said.append((failures, belief.mean, belief.covariance))
        (found, *numbers), (expected, *others) = said
        assert found == expected
        for one, other in zip(numbers, others, strict=True):
            np.testing.assert_array_equal(one, other)
        failed += len(expected[0])
    assert failed > 0


def test_a_radar_on_the_deputy_goes_from_epoch_to_epoch():
    measurement = radar(host=("deputy", ChiefOrbit(7.0e6, 0.001, 0.9, 0.0, 0.0, 0.0), 2.0))
    z, mean0 = readings(measurement)
    assert compare(z, mean0, measurement=measurement)[0] == [None]


@pytest.mark.parametrize("options", [{"arithmetic": "float32"}, {"underweighting": {"above_m": 1.0}}])
def test_other_arithmetic_goes_from_epoch_to_epoch(options):
    measurement = radar()
    z, mean0 = readings(measurement)
    run_filter(create_filter("ekf", LinearDynamics(F, Q), measurement, **options), z, mean0, P0)
    assert measurement.taken == []
