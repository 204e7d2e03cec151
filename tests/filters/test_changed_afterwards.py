"""What is assigned to dynamics or a measurement after a filter was made of them counts, or is refused in one sentence.

What a class says that has the same function from the start is right: `test_subclasses` holds it against the parts.
"""

from functools import partial

import numpy as np
import pytest
from every_filter import KINDS, small_options

from relnav_sim import (
    FunctionMeasurement,
    LinearDynamics,
    LinearMeasurement,
    MixtureNoise,
    Step,
    create_filter,
    dynamics,
    fit_gp_dynamics,
    measurements,
    run_filter,
)
from relnav_sim.dynamics.augmentation.augmented import AugmentedDynamics
from relnav_sim.filters import registry
from relnav_sim.filters.ekf import ExtendedKalmanFilter
from relnav_sim.filters.kalman import GaussianFilterOptions
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.measurements.converted_radar import ConvertedRadar
from relnav_sim.measurements.partial import PartialMeasurement
from relnav_sim.measurements.spherical_radar import SightNoise

MEAN0, COV0 = np.array([0.0, 5000.0, 200.0, 0.0, 0.0, 0.0]), np.diag([10.0] * 3 + [0.1] * 3) ** 2
SIGMAS = np.array([4.0, 1e-3, 1e-3])
NOISE = SightNoise(np.ones(1), SIGMAS[None], SIGMAS, np.zeros((3, 3)))
ABOUT = {"orbit": dynamics.ChiefOrbit(7.0e6, 0.02, 0.9, 0.0, 0.0, 0.0), "step_s": 1.0, "acceleration_psd_m2_s3": 1e-4}
F, Q = np.eye(6) + np.eye(6, k=3), 1e-2 * np.eye(6)

DYNAMICS = {
    "linear": lambda: LinearDynamics(F, Q),
    "cw": lambda: dynamics.cw(mean_motion_rad_s=1e-3, step_s=1.0, acceleration_psd_m2_s3=1e-4),
    **{
        name: partial(getattr(dynamics, name), **ABOUT)
        for name in ("cw_second_order", "yamanaka_ankersen", "schweighart_sedwick", "nonlinear", "nonlinear_j2")
    },
    "augmented": lambda: AugmentedDynamics(LinearDynamics(F[:3, :3], Q[:3, :3]), np.ones(3), np.ones(3)),
}
MEASUREMENTS = {
    "radar": partial(measurements.radar, range_sigma_m=4.0, angle_sigma_deg=0.05),
    "camera": partial(measurements.camera, angle_sigma_deg=0.05),
    "lidar": partial(measurements.lidar, range_sigma_m=1.0, range_sigma_m_per_km=1.0, angle_sigma_deg=0.05),
    "crosslink": partial(measurements.crosslink, range_sigma_m=1.0, range_rate_sigma_m_s=0.01),
    "gnss": partial(measurements.relative_gnss, position_sigma_m=1.0),
    "gnss in a frame": partial(
        measurements.relative_gnss, position_sigma_m=1.0, velocity_sigma_m_s=0.1, frame_sigma_deg=0.01
    ),
    "converted": lambda: ConvertedRadar(np.eye(3), NOISE),
    "function": lambda: FunctionMeasurement(lambda x, epoch: np.arctan2(x[..., :1], x[..., 1:2]), [[1e-6]], angles=[0]),
}
READING = {"camera": [0.01, 0.04], "lidar": [5001.0, 0.01, 0.04]}


def plus(function, what, *arguments):
    return function(*arguments) + what


def bent(function, states, step):
    return function(states, step) + 1e-3 * np.square(states)


def times(function, factor, *arguments):
    return factor * function(*arguments)


OF_DYNAMICS = {
    "propagate": lambda own: partial(bent, own),  # which linear formulas do not give
    "transition": lambda own: partial(times, own, 1.05),
    "process_noise": lambda own: partial(times, own, 5.0),
}
OF_MEASUREMENT = {
    "predict": lambda own: partial(plus, own, 0.01),
    "jacobian": lambda own: partial(times, own, 1.5),
    "noise": lambda own: partial(times, own, 9.0),
    "residual": lambda own: partial(times, own, 1.5),
    "log_likelihood": lambda own: partial(times, own, 0.5),
    "take": lambda own: partial(plus, own, 0.01),
}
CHANGES = OF_DYNAMICS | OF_MEASUREMENT
# Whoever goes by Jacobians, densities or what is read alone never asks for the others.
ALL_ASK = ("propagate", "process_noise", "predict", "residual", "take")


def readings(measurement, name):
    reading = READING.get(name)
    return np.tile(measurement.predict(MEAN0[None], 0) + 1e-3 if reading is None else reading, (2, 3, 1))


def assign(model, name):
    setattr(model, name, CHANGES[name](getattr(model, name)))


def of_changed_class(model, name):
    """Return a model that is the same but of a class that has another function from the start."""
    base = type(model)

    def other(self, *arguments):
        return CHANGES[name](partial(getattr(base, name), self))(*arguments)

    changed = object.__new__(type("Changed", (base,), {name: other}))
    vars(changed).update(vars(model))
    return changed


def numbers(filter, z):
    history = run_filter(filter, z, MEAN0, COV0)
    return np.concatenate([a.ravel() for a in (history.mean, history.covariance, history.nis, history.log_likelihood)])


def check(kind, motion, sensor, name, several=False, **options):
    """Assign a function before the first run, and between two runs; return what both give, and what came before."""
    place = int(name in OF_MEASUREMENT)
    z = readings(MEASUREMENTS[sensor](), sensor)
    z = {"it": z, "other": np.tile(MEAN0[:3], (2, 3, 1))} if several else z

    def made(models):
        measured = {"it": models[1], "other": MEASUREMENTS["gnss"]()} if several else models[1]
        return create_filter(kind, models[0], measured, **small_options(kind), **options)

    models = [[DYNAMICS[motion](), MEASUREMENTS[sensor]()] for _ in range(3)]
    models[2][place] = of_changed_class(models[2][place], name)
    at_once, between, expected = map(made, models)
    before = numbers(between, z)
    assign(models[0][place], name)
    assign(models[1][place], name)
    right = numbers(expected, z)
    for each in (at_once, between):
        np.testing.assert_allclose(numbers(each, z), right, rtol=1e-7, atol=1e-9)
    return right, before


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # some of these models lose runs, which is as good a number
@pytest.mark.parametrize("name", CHANGES)
@pytest.mark.parametrize("kind", KINDS)
def test_a_function_assigned_after_the_filter_was_made_counts(kind, name):
    found, before = check(kind, "linear", "converted" if filter_kinds()[kind].linear_only else "radar", name)
    if name in ALL_ASK and (kind, name) != ("batch_least_squares", "process_noise"):  # which it takes to be 0
        assert not np.allclose(found, before, equal_nan=True)


@pytest.mark.parametrize("name", OF_MEASUREMENT)
@pytest.mark.parametrize("sensor", MEASUREMENTS)
def test_that_of_any_measurement_counts(sensor, name):
    for kind in ("ekf", "alpha_kf", "particle"):
        check(kind, "linear", sensor, name)


@pytest.mark.parametrize("name", OF_DYNAMICS)
@pytest.mark.parametrize("motion", DYNAMICS)
def test_that_of_any_dynamics_counts(motion, name):
    for kind in ("ekf", "ukf"):
        check(kind, motion, "gnss", name)


ADDED = {"acceleration_psd_m2_s3": 1e-4, "mean_motion_rad_s": 1e-3, "step_s": 1.0}
START = {f"{axis}_psd_m2_s3": 1e-4 for axis in ("radial", "along_track", "normal")}
ADAPTED = {"adaptive": {"start": START, "window": 2}, "mean_motion_rad_s": 1e-3, "step_s": 1.0}


@pytest.mark.parametrize("name", CHANGES)
@pytest.mark.parametrize(
    "options",
    [
        {"arithmetic": "float32"},
        {"editing": {"probability": 0.9999}},
        {"process_noise": ADDED},
        {"process_noise": ADAPTED},
        {"several": True},
    ],
    ids=["float32", "edited", "added noise", "adapted noise", "several"],
)
def test_it_counts_behind_what_a_filter_is_wrapped_in(options, name):
    for kind in ("ekf", "ukf") if options.get("process_noise") is ADAPTED else ("ekf", "ukf", "sr_ukf"):
        check(kind, "linear", "radar", name, **options)


class Bent:
    """What `LinearDynamics` with another `propagate` are, as a user's class that promises nothing."""

    dimension, linear = 6, False

    def propagate(self, states, step):
        return states @ F.T + 1e-3 * states**2

    def transition(self, mean, step):
        return F

    def process_noise(self, states, step):
        return Q


@pytest.mark.parametrize("arithmetic", ["float64", "float32"])
@pytest.mark.parametrize("kind", ["ukf", "sr_ukf"])
def test_linear_dynamics_with_another_propagate_are_not_taken_as_linear(kind, arithmetic):
    class Derived(LinearDynamics):
        propagate = Bent.propagate

    sensor = MEASUREMENTS["gnss"]()
    z = readings(sensor, "gnss")
    given = LinearDynamics(F, Q)
    filters = [create_filter(kind, each, sensor, arithmetic=arithmetic) for each in (Bent(), Derived(F, Q), given)]
    given.propagate = partial(Bent.propagate, None)
    expected, *found = (numbers(each, z) for each in filters)
    for each in found:
        np.testing.assert_array_equal(each, expected)


@pytest.mark.parametrize("options", [{}, {"process_noise": ADDED}])
@pytest.mark.parametrize("made", [lambda: LinearDynamics(F, Q), Bent])
def test_a_function_assigned_to_the_dynamics_of_a_filter_counts(made, options):
    z, sensor = readings(MEASUREMENTS["gnss"](), "gnss"), MEASUREMENTS["gnss"]()
    for name in OF_DYNAMICS:
        models = made(), made()
        inside, outside = (create_filter("ekf", each, sensor, **options) for each in models)
        before = numbers(inside, z)
        setattr(inside.dynamics, name, CHANGES[name](getattr(made(), name)))
        assign(models[1], name)
        found = numbers(inside, z)
        np.testing.assert_array_equal(found, numbers(outside, z))
        assert np.abs(found - before).max() > 1e-6


CONSIDERING = [(kind, {}) for kind in KINDS if filter_kinds()[kind].considers]
IN_SINGLE = [(kind, {"arithmetic": "float32"}) for kind, _ in CONSIDERING if filter_kinds()[kind].in_single]


@pytest.mark.parametrize("places", [(1, 2), (0,)])
@pytest.mark.parametrize(("kind", "options"), CONSIDERING + IN_SINGLE)
def test_states_that_are_considered_afterwards_count(kind, options, places):
    z, options = readings(MEASUREMENTS["gnss"](), "gnss") + 3.0, small_options(kind) | options
    models = [DYNAMICS["augmented"]() for _ in range(3)]
    models[2].considered = places
    filters = [create_filter(kind, each, MEASUREMENTS["gnss"](), **options) for each in models]
    models[0].considered = np.array(places)  # in whatever form
    found, plain, expected = (numbers(each, z) for each in filters)
    np.testing.assert_array_equal(found, expected)
    assert np.abs(found - plain).max() > 1e-6


@pytest.mark.parametrize(("name", "value"), [("angles", ()), ("depends_on", (0, 1)), ("states", 7), ("dimension", 2)])
@pytest.mark.parametrize("several", [False, True])
@pytest.mark.parametrize("inside", [False, True])
def test_what_a_filter_is_made_for_is_not_changed_afterwards(name, value, several, inside):
    radar = MEASUREMENTS["radar"]()
    z = readings(radar, "radar")
    given = {"it": radar, "other": MEASUREMENTS["gnss"]()} if several else radar
    filter = create_filter("alpha_kf", LinearDynamics(F, Q), given, samples=64)
    if several and inside:
        with pytest.raises(AttributeError, match=f"several sensors; assign {name} to that of one of them"):
            setattr(filter.measurement, name, value)
        return
    setattr(filter.measurement if inside else radar, name, value)
    with pytest.raises(ValueError, match=f"^{name} of the measurement is .*, and was .*; make it again by"):
        run_filter(filter, {"it": z, "other": np.tile(MEAN0[:3], (2, 3, 1))} if several else z, MEAN0, COV0)
    run_filter(create_filter("ekf", LinearDynamics(F, Q), MEASUREMENTS["radar"]()), z, MEAN0, COV0)


EDITED = [(kind, {"editing": {"probability": 0.999}}) for kind in KINDS if filter_kinds()[kind].edits]
MATCHED = [(kind, {"process_noise": ADAPTED}) for kind in KINDS if filter_kinds()[kind].matches_covariance]


@pytest.mark.parametrize(("kind", "options"), [*((kind, {}) for kind in KINDS), *EDITED, *MATCHED])
def test_a_filter_keeps_its_models(kind, options):
    known = filter_kinds()[kind]
    sensor = MEASUREMENTS["converted" if known.linear_only else "radar"]()
    filter = create_filter(kind, LinearDynamics(F, Q), sensor, **small_options(kind), **options)
    for name, other in (("dynamics", LinearDynamics(F, Q)), ("measurement", sensor)):
        with pytest.raises(AttributeError, match=f"keeps the {name} .* make another one with create_filter"):
            setattr(filter, name, other)
        setattr(filter, name, getattr(filter, name))


def test_a_derived_filter_may_choose_its_measurement_while_it_is_made(monkeypatch):
    monkeypatch.setattr(registry, "_KINDS", filter_kinds())
    chosen = LinearMeasurement(np.eye(3, 6), 4 * np.eye(3))

    @registry.register_filter("chooses", GaussianFilterOptions)
    class Chooses(ExtendedKalmanFilter):
        def __init__(self, dynamics, measurement, options):
            super().__init__(dynamics, measurement, options)
            self.measurement = PartialMeasurement(chosen)

    z, given = readings(chosen, "gnss"), LinearMeasurement(np.eye(3, 6), np.eye(3))
    made, other = (
        create_filter("chooses", LinearDynamics(F, Q), given),
        create_filter("ekf", LinearDynamics(F, Q), chosen),
    )
    np.testing.assert_array_equal(numbers(made, z), numbers(other, z))
    with pytest.raises(AttributeError, match="keeps the measurement"):
        made.measurement = given


class Straight(LinearDynamics):
    def propagate(self, states, step):
        return states @ F.T


@pytest.mark.parametrize(("of", "linear"), [(LinearDynamics, True), (Straight, False)])
def test_what_is_promised_of_propagate_goes_with_it_and_comes_back(of, linear):
    motion = of(F, Q)
    assert motion.linear == motion.moves_by_transition == linear == (motion.known_steps(0, 3) is not None)
    own = motion.propagate
    motion.propagate = partial(bent, own)
    assert not motion.linear and not motion.moves_by_transition and motion.known_steps(0, 3) is None
    motion.propagate = own
    assert motion.linear == motion.moves_by_transition == linear == (motion.known_steps(0, 3) is not None)
    motion.propagate = of(F, Q).propagate  # of another object
    assert not motion.linear
    del motion.propagate
    assert motion.linear == linear
    motion.linear = not linear  # a user's own promise
    assert motion.linear != linear and motion.moves_by_transition == linear
    assert type("Promised", (of,), {"linear": True, "propagate": Straight.propagate})(F, Q).linear


def test_a_mixin_s_propagate_takes_the_promise_back():
    class Moves:
        def propagate(self, states, step):
            return states

    assert not type("Mixed", (Moves, LinearDynamics), {})(F, Q).linear


def test_augmented_dynamics_with_another_transition_are_not_linear():
    motion = DYNAMICS["augmented"]()
    assert motion.linear and motion.moves_by_transition
    motion.transition = partial(times, motion.transition, 1.05)
    assert not motion.linear and not motion.moves_by_transition


@pytest.mark.parametrize("kind", ["particle", "unscented_particle"])
def test_the_residual_of_a_second_object_wraps_its_own_angles(kind):
    def found(residual):
        turning, plain = (FunctionMeasurement(lambda x, epoch: x[..., :1], [[1.0]], angles=a) for a in ([0], []))
        plain.residual = residual(turning)
        filter = create_filter(kind, LinearDynamics(np.eye(1), np.eye(1)), plain, **small_options(kind))
        return run_filter(filter, np.full((2, 3, 1), 6.2), [0.0], [[4.0]]).mean

    as_it_is, asked = found(lambda other: other.residual), found(lambda other: lambda z, h: other.residual(z, h))
    np.testing.assert_array_equal(as_it_is, asked)


class Unguarded:
    """A user's measurement of one number, with an attribute that its functions go by."""

    dimension, sigma = 1, 1.0

    def __init__(self):
        self.angles = []

    def predict(self, states, epoch):
        return states[..., :1]

    def jacobian(self, states, epoch):
        return np.eye(1, 6)

    def noise(self, mean, epoch):
        return np.array([[self.sigma**2]])

    def residual(self, z, predicted):
        return z - predicted

    def mixture(self, mean, epoch):
        return None


def test_what_is_assigned_to_the_measurement_of_a_filter_reaches_the_user_s():
    z = np.ones((2, 3, 1))
    inside, outside = Unguarded(), Unguarded()
    filters = [create_filter("ekf", LinearDynamics(F, Q), each) for each in (inside, outside)]
    filters[0].measurement.sigma = outside.sigma = 5.0
    assert inside.sigma == 5.0
    np.testing.assert_array_equal(*(numbers(each, z) for each in filters))
    inside.angles.append(0)
    with pytest.raises(ValueError, match="angles of the measurement is"):
        run_filter(filters[0], z, MEAN0, COV0)


def test_between_two_runs_a_filter_s_measurement_is_asked_anew():
    radar = MEASUREMENTS["radar"]()
    filter = create_filter("ekf", LinearDynamics(F, Q), radar)
    run_filter(filter, readings(radar, "radar"), MEAN0, COV0)
    radar.noise = lambda mean, epoch: 9 * np.eye(3)
    np.testing.assert_array_equal(filter.measurement.noise(MEAN0[None], 0), 9 * np.eye(3))


def test_a_function_for_several_sensors_at_once_is_refused():
    filter = create_filter("ekf", LinearDynamics(F, Q), {"a": MEASUREMENTS["radar"](), "b": MEASUREMENTS["gnss"]()})
    with pytest.raises(AttributeError, match="several sensors; assign noise to that of one of them"):
        filter.measurement.noise = lambda mean, epoch: np.eye(6)


def test_arrays_that_were_given_are_copied():
    H, R, F_, Q_ = np.eye(3, 6), np.eye(3), F.copy(), Q.copy()
    weights, parts = np.array([0.5, 0.5]), np.stack([np.eye(3), 4 * np.eye(3)])
    chief = np.tile([7.0e6, 0.0, 0.0, 0.0, 7546.0, 0.0], (4, 1))
    mixture = MixtureNoise(weights, parts)
    made = [
        (LinearDynamics(F_, Q_), LinearMeasurement(H, R)),
        (LinearDynamics(F_, Q_), LinearMeasurement(H, mixture)),
        (dynamics.nonlinear_j2(**ABOUT, chief=chief), FunctionMeasurement(lambda x, epoch: x[..., :3], R)),
    ]
    filters = [create_filter("ekf", *each) for each in made]
    z = readings(made[0][1], "gnss")
    before = [numbers(each, z) for each in filters]
    for given in (H, R, F_, Q_, weights, parts, chief):
        given *= 1.5
    for each, was in zip(filters, before, strict=True):
        np.testing.assert_array_equal(numbers(each, z), was)


def test_arrays_that_are_told_can_not_be_written_to():
    mixture = MixtureNoise([0.5, 0.5], [np.eye(3), 4 * np.eye(3)])
    told = [mixture.weights, mixture.covariances, mixture.covariance]
    states = np.tile(MEAN0, (2, 1))
    told += [MEASUREMENTS[name]().noise(states, 0) for name in ("gnss", "camera", "crosslink", "function")]
    told += [DYNAMICS[name]().process_noise(states, Step(0)) for name in DYNAMICS if name != "augmented"]
    for array in told:
        assert not array.flags.writeable


def test_another_process_or_calibration_of_learned_dynamics_counts():
    now = np.random.default_rng(1).normal(size=(40, 2))
    learned, other = (fit_gp_dynamics(now, now @ M, 1.0, restarts=0) for M in ([[1, 0], [1, 1]], [[1, 0], [2, 1]]))
    states, step = np.array([[0.3, -0.2]]), Step(0)

    def said(gp):
        return np.concatenate([gp.process_noise(states, step).ravel(), gp.propagate(states, step).ravel()])

    before = said(learned)
    learned.calibration = 3 * learned.calibration
    np.testing.assert_allclose(said(learned)[:4], 9 * before[:4])
    learned.process, learned.calibration = other.process, other.calibration
    assert learned.propagate(states, step) == pytest.approx(other.propagate(states, step))
    np.testing.assert_array_equal(said(learned), said(other))
