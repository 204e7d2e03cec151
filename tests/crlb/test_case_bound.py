"""The bound of whole campaigns: the Kalman covariance where it must be, what counts as measured, what the runs show."""

import traceback

import numpy as np

from relnav_sim import open_results, run_campaign
from relnav_sim.crlb.case_bound import case_bound, failed_bound
from relnav_sim.dynamics.clohessy_wiltshire import cw_system, cw_transition
from relnav_sim.dynamics.process_noise import process_noise_matrix
from relnav_sim.filters import registry
from relnav_sim.filters.ekf import ExtendedKalmanFilter
from relnav_sim.filters.kalman import GaussianFilterOptions
from relnav_sim.results.bound import write_bound
from relnav_sim.runner.bound_task import bound_tasks
from relnav_sim.sensors import SensorSuite, filter_inputs, reading_probability, sensor_measurement
from relnav_sim.streams import RandomSource
from relnav_sim.truth import nominal_chief, truth_trajectory

SHARED = "truth.dispersions={}"
ONE = "grid={sensors.radar.noise: [{kind: gaussian}]}"


def bound_of(campaign, *overrides, case=0):
    made = campaign(*overrides)
    return case_bound(made.cases[case], made.seed)


def test_under_gaussian_noise_it_is_the_covariance_of_a_kalman_filter_linearised_at_the_truth(campaign):
    made = campaign(SHARED, ONE, "clock.store_every_s=1")
    config = made.cases[0].config
    truth = truth_trajectory(config.truth, 40, RandomSource(made.seed, (0,))).at(np.arange(41.0)).relative[0]
    orbit = nominal_chief(config.truth)
    radar = sensor_measurement("radar", config.sensors, orbit, 1.0)
    F = cw_transition(orbit.mean_motion_rad_s, 1.0)
    Q = process_noise_matrix(config.filters["ekf"].process_noise, cw_system(orbit.mean_motion_rad_s), 1.0)
    P, found = None, []
    for k, state in enumerate(truth[:, None]):
        H, R = radar.jacobian(state, k)[0], radar.noise(state, k)[0]
        if P is None:
            J = np.linalg.inv(H[:, :3])
            P = np.zeros((6, 6))
            P[:3, :3], P[3:, 3:] = J @ R @ J.T, np.eye(3)
        else:
            P = F @ P @ F.T + Q
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            P = (np.eye(6) - K @ H) @ P @ (np.eye(6) - K @ H).T + K @ R @ K.T
        found.append(np.sqrt(np.diag(P)))
    bound = case_bound(made.cases[0], made.seed).filters["ekf"]
    np.testing.assert_allclose(bound[:, :6], found, rtol=1e-9)
    np.testing.assert_allclose(bound[:, 6:], np.sqrt(np.square(bound[:, :6]).reshape(-1, 2, 3).sum(axis=2)), rtol=1e-14)


def test_it_does_not_depend_on_the_runs_and_shares_what_filters_share(campaign):
    few, many = bound_of(campaign, "runs=2"), bound_of(campaign, "runs=30", "filters.wide={kind: kf, r_scale: 4}")
    np.testing.assert_array_equal(few.perfect, many.perfect)
    np.testing.assert_array_equal(few.filters["ekf"], many.filters["ekf"])
    np.testing.assert_array_equal(many.filters["wide"], many.filters["kf"])


def test_a_perfect_model_is_never_worse_and_noise_that_is_known_never_hurts(campaign):
    gaussian, mixture = bound_of(campaign), bound_of(campaign, case=1)
    for bound in (gaussian, mixture):
        assert (bound.perfect[1:, 6:] < bound.filters["ekf"][1:, 6:]).all()
    assert (gaussian.perfect < mixture.perfect * (1 + 1e-12)).all()  # the mixture's narrow part is the Gaussian
    total = bound_of(campaign, ONE, "sensors.radar.range_sigma_m=3.688", "sensors.radar.angle_sigma_deg=0.1844")
    assert (mixture.perfect < total.perfect * (1 + 1e-12)).all()  # one Gaussian of the mixture's variance, 3.4


def test_nothing_is_learned_where_nothing_is_measured(campaign):
    gap = "[{kind: gaussian}, {kind: outage, windows_s: [[10, 25]]}]"
    free = bound_of(campaign, ONE, "clock.store_every_s=1")
    cut = bound_of(campaign, f"grid={{sensors.radar.noise: [{gap}]}}", "clock.store_every_s=1")
    np.testing.assert_array_equal(cut.perfect[:10], free.perfect[:10])
    assert (np.diff(cut.perfect[9:25, 6]) > 0).all()
    assert cut.perfect[25, 6] < cut.perfect[24, 6]
    lost, carried = (
        bound_of(campaign, ONE, "clock.store_every_s=1", f"sensors.{name}.noise={gap}")
        for name in ("star_tracker", "gnss")
    )
    # The range stays without the star tracker; all stays while the host carries its orbit on, with hardly more error.
    assert ((free.perfect < lost.perfect) & (lost.perfect < cut.perfect))[12:, 6].all()
    np.testing.assert_allclose(carried.perfect, free.perfect, rtol=1e-4)
    seldom = bound_of(campaign, ONE, "sensors.radar.period_s=8")
    assert (seldom.perfect[2:, 6] > free.perfect[8::4, 6]).all()


def test_without_a_first_fix_there_is_no_bound(campaign):
    bound = bound_of(campaign, "sensors.radar.range_limits_m=[10, 100]")
    assert np.isnan(bound.perfect).all() and np.isnan(bound.filters["ekf"]).all()
    away = ("start={kind: dispersed, position_sigma_m: 10, velocity_sigma_m_s: 0.1}",)
    blind = bound_of(campaign, "sensors.radar.range_limits_m=[10, 100]", *away)
    assert (np.diff(blind.perfect[:, 6]) > 0).all()  # nothing but the start is known


def test_the_probability_of_a_reading_is_that_of_the_simulated_sensors(campaign):
    parts = "[{kind: gaussian}, {kind: outage, rate_per_hour: 200, mean_duration_s: 15, windows_s: [[20, 24]]}]"
    config = (
        campaign(SHARED, f"sensors.star_tracker.noise={parts}", f"grid={{sensors.radar.noise: [{parts}]}}")
        .cases[0]
        .config
    )
    source = RandomSource(1, tuple(range(2000)))
    truth = truth_trajectory(config.truth, 40, source).at(np.arange(41.0))
    z = SensorSuite(config.sensors, source, 1.0).measure(truth, 0)
    share = np.isfinite(filter_inputs(config.sensors, z, truth)["radar"]["spherical"]).mean(axis=0)
    probability = reading_probability(config.sensors, "radar", truth, 0, 1.0)[0]
    assert (np.abs(share - probability) <= 4.5 * np.sqrt(probability * (1 - probability) / 2000)).all()
    assert (
        (probability[0] == 1).all()
        and (probability[20:24] == 0).all()
        and (probability[:, 1] == probability[:, 2]).all()
    )
    assert 0.2 < probability[40, 1] < 0.5 < probability[40, 0] < 0.7  # the range does without the star tracker


def test_a_campaign_can_do_without(campaign, tmp_path):
    of_two = "runs=2", "grid={sensors.radar.range_sigma_m: [2, 3]}"
    out = run_campaign(campaign(*of_two, "bound=false"), tmp_path / "out.h5", backend="sequential")
    assert campaign(*of_two, "bound=false").hash == campaign(*of_two).hash
    with open_results(out) as results:
        assert results.bound(0) is None and results.bound(0, "ekf") is None
    run_campaign(campaign(*of_two), out, backend="sequential")
    with open_results(out) as results:
        assert results.bound(0).shape == (11, 8)
    for file in (tmp_path / "out.h5.shards").glob("*.bound"):
        file.write_bytes(file.read_bytes()[:-200])
    said = []
    run_campaign(campaign(*of_two), out, backend="sequential", say=said.append)
    assert sum("computing it again" in sentence for sentence in said) == 2


class _Raising(ExtendedKalmanFilter):
    def __init__(self, *arguments):
        raise RuntimeError("no such model")


def test_a_filter_without_a_model_costs_its_own_bound_only(campaign, tmp_path, monkeypatch):
    kind = registry.FilterKind("raising", GaussianFilterOptions, _Raising, "spherical", 3.0)
    monkeypatch.setitem(registry._KINDS, "raising", kind)
    made = campaign(
        "runs=2", ONE, "filters.bad={kind: raising, dynamics: {kind: nonlinear}}", "filters.same={kind: raising}"
    )
    said = []
    out = run_campaign(made, tmp_path / "out.h5", backend="sequential", say=said.append)
    with open_results(out) as results:
        assert results.bound(0, "bad") is None
        np.testing.assert_array_equal(results.bound(0, "same"), results.bound(0, "ekf"))
        assert np.isfinite(results.bound(0, "ekf")).all() and np.isfinite(results.bound(0)).all()
    assert any("bad: RuntimeError: no such model" in sentence for sentence in said)


class _Hungry(ExtendedKalmanFilter):
    starves = True

    def __init__(self, *arguments):
        if self.starves and any(frame.name == "case_bound" for frame in traceback.extract_stack()):
            raise MemoryError("no more memory")
        super().__init__(*arguments)


def test_a_bound_that_failed_for_want_of_memory_is_tried_again(campaign, tmp_path, monkeypatch):
    monkeypatch.setitem(
        registry._KINDS, "hungry", registry.FilterKind("hungry", GaussianFilterOptions, _Hungry, "spherical", 3.0)
    )
    made = campaign("runs=2", ONE, "filters.big={kind: hungry, dynamics: {kind: nonlinear}}")

    def bounds():
        said = []
        out = run_campaign(made, tmp_path / "out.h5", backend="sequential", say=said.append)
        with open_results(out) as results:
            return results.bound(0, "ekf"), results.bound(0, "big"), " ".join(said)

    before, without, said = bounds()
    assert without is None and "big: MemoryError: no more memory; the same command tries again" in said
    same, without, said = bounds()
    assert without is None and "MemoryError: no more memory); trying again" in said
    monkeypatch.setattr(_Hungry, "starves", False)
    after, big, said = bounds()
    np.testing.assert_array_equal([same, after], [before, before])
    np.testing.assert_allclose(big, before, rtol=1e-4)
    assert "; trying again" in said and "lacks" not in said.split("trying again")[1]
    assert "every run was finished already" in bounds()[2]


def test_a_bound_that_took_too_long_is_tried_again(campaign, tmp_path):
    made, out = campaign("runs=2", ONE), tmp_path / "out.h5"
    run_campaign(made, out, backend="sequential")
    (task,) = bound_tasks(made, tmp_path / "out.h5.shards")
    whole = task.path.read_bytes()
    write_bound(task.path, failed_bound(task.case, task.seed, "took longer than 0.001 s", retry=True))
    said = []
    run_campaign(made, out, backend="sequential", say=said.append)
    assert any("took longer than 0.001 s); trying again" in sentence for sentence in said)
    assert task.path.read_bytes() == whole


def test_extra_states_are_in_the_bound_of_the_filter_that_has_them(campaign, tmp_path):
    made = campaign(
        SHARED, ONE, "runs=3",
        "filters.wide={kind: ekf, augment: "
        "[{kind: range_bias, sigma_m: 0.5}, {kind: azimuth_bias, sigma_deg: 0.5, tau_s: 20}]}",
        "filters.known={kind: ekf, augment: "
        "[{kind: range_bias, sigma_m: 1e-7}, {kind: azimuth_bias, sigma_deg: 1e-7, tau_s: 20}]}",
    )  # fmt: skip
    out = run_campaign(made, tmp_path / "out.h5", backend="sequential")
    with open_results(out) as results:
        plain, wide, known = (results.bound(0, name) for name in ("ekf", "wide", "known"))
        np.testing.assert_allclose(known, plain, rtol=1e-6)
        assert (wide[:, 6] > 1.2 * plain[:, 6]).all()
        for name, bound in (("ekf", plain), ("wide", wide)):
            # The filter's own covariance is the same recursion, about its estimates instead of the truth.
            np.testing.assert_allclose(results.sigma(0, name).mean(axis=0), bound[:, :6], rtol=0.02)


def test_a_filter_with_the_right_model_comes_to_the_bound_and_not_below(campaign, tmp_path):
    made = campaign(
        SHARED, ONE, "runs=200", "block_runs=200", "clock={duration_s: 300, step_s: 1, store_every_s: 20}",
        "truth.forces={zonals: 0, drag: none}",
        "filters.ekf={kind: ekf, dynamics: {kind: nonlinear}, process_noise: {acceleration_psd_m2_s3: 1.0e-15}}",
    )  # fmt: skip
    out = run_campaign(made, tmp_path / "out.h5", backend="sequential")
    with open_results(out) as results:
        error, bound, own = results.error(0, "ekf"), results.bound(0), results.bound(0, "ekf")
    np.testing.assert_allclose(own, bound, rtol=1e-4)
    for k in (5, 10, 15):
        share = np.square(error[:, k]).mean(axis=0) / np.square(bound[k, :6])
        assert (np.abs(share - 1) < 4 * np.sqrt(2 / 200)).all()
