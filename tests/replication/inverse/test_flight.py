import numpy as np
import pytest

from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, dynamics, propagate, rtn_from_eci, run_filter
from relnav_sim.arrays import Array
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from relnav_sim.dynamics.interface import Step
from replication.inverse import alpha_kf_flight as flight
from replication.inverse import alpha_kf_truth as truth
from replication.inverse import recursion
from replication.inverse.alpha_kf_numbers import NUMBERS, numbers
from replication.inverse.alpha_kf_unknowns import COLUMNS, UNKNOWNS
from replication.inverse.prior import values

PLACE = {number.name: place for place, number in enumerate(NUMBERS)}


def _plain() -> dict[str, float]:
    """Return the setting of campaigns/alpha_kf_gaussian.yaml."""
    setting = {unknown.name: 0.0 for unknown in UNKNOWNS}
    setting |= {name: 1e-6 for name in setting if name.startswith("acceleration_psd")}
    setting |= {"period_s": 6000.4, "inclination_deg": 42.0, "ahead": 1.0, "mixture_share": 0.5, "told_r": 1.0}
    setting |= {"start_position": 1.0, "start_velocity_m_s": 1.0, "draws": 1.0, "radial_noise": 1.0, "cross_noise": 1.0}
    return setting | {"span_s": 500.0, "limit_kind": 1.0, "limit_m": 5.0, "limit_ratio": 3.0}


def _motion(setting: dict[str, float]) -> truth.Motion:
    return truth.motion({name: np.array([value]) for name, value in setting.items()})


@pytest.mark.parametrize("position_noise", [0.0, 1e-4])
def test_errors_are_those_of_relnavs_filter_on_the_same_readings(position_noise: float) -> None:
    """Truth and readings for relnav's Kalman filter are made of what the recursion is given."""
    rng = np.random.default_rng(1)
    n, h, steps = 1.047e-3, 0.2, 400
    F, q = cw_transition(n, h), 3e-6
    unit = dynamics.cw(mean_motion_rad_s=n, step_s=h, acceleration_psd_m2_s3=1.0)
    Q = np.asarray(unit.process_noise(np.zeros((1, 6)), Step(0))).reshape(6, 6)
    d = rng.normal(0, [1e-5] * 3 + [1e-4] * 3, (steps, 6))
    R = 2.0 * np.diag([196.0, 16.0, 150.0])
    w = rng.normal(0, 10.0, (1, steps, 3))
    x = [np.array([30.0, 12000.0, -20.0, 0.1, 0.2, -0.1])]
    for missed in d:
        x.append(F @ x[-1] + missed)
    states = np.array(x[1:])
    P0, e0 = np.diag([200.0, 20.0, 200.0, 1.0, 1.0, 1.0]), rng.normal(0, 1.0, (1, 6))
    told = LinearDynamics(F, q * Q + position_noise * h * np.diag([1.0, 1, 1, 0, 0, 0]))
    kalman = create_filter("kf", told, LinearMeasurement(np.eye(3, 6), R))
    history = run_filter(kalman, states[None, :, :3] + w, x[0] + e0, P0, step_s=h)
    out, formal = np.empty((1, 1, steps, 6)), np.empty((1, steps))
    spans, kinds = np.array([[h, 1.0]]), np.zeros(steps, dtype=np.int64)
    half = np.broadcast_to(R / 2, (steps, 3, 3)).copy()
    columns = np.array([[q, position_noise, 2.0, 0.0]])
    recursion.errors(F[None], Q[None], spans, kinds, d, half, w, np.zeros((1, 1, 1, 6)), columns, P0, e0, out, formal)
    np.testing.assert_allclose(out[0, 0], history.mean[0] - states, atol=1e-8, rtol=0)
    np.testing.assert_allclose(formal[0], np.sqrt(history.covariance[0].diagonal(axis1=1, axis2=2)[:, :3].sum(axis=1)))


def test_steps_with_the_left_out_acceleration_meet_the_propagated_truth() -> None:
    """From node to node, to a hundredth of what that acceleration does; positions between nodes by the propagator."""
    setting = _plain() | {"eccentricity": 0.01, "in_plane_share": 0.4, "cross_share": 0.3, "drift_m": 300.0}
    setting |= {"true_anomaly_deg": 70.0, "latitude_argument_deg": 200.0, "cross_phase_deg": 50.0}
    moved = _motion(setting)
    nodes, n = moved.nodes[0], moved.mean_motion_rad_s[0]
    h = flight.QUICK.steps_s
    ends = np.cumsum(h)
    d = truth.steps_left_out(moved.left_out[0], ends, h)
    for node in (1, 3, 10, 50, 99):
        x = nodes[node]
        for k in np.flatnonzero((ends > 60 * node + 1e-6) & (ends < 60 * node + 60 + 1e-6)):
            x = cw_transition(n, h[k]) @ x + d[k]
        without = np.abs(cw_transition(n, 60.0) @ nodes[node] - nodes[node + 1])
        assert np.abs(x - nodes[node + 1])[:3].max() < 0.01 * without[:3].max()
        assert np.abs(x - nodes[node + 1])[3:].max() < 0.01 * without[3:].max()
    own = {name: np.array([value]) for name, value in setting.items()}
    times = np.array([0.0, 17.0, 1234.5, 5999.0])
    start = truth._start(own, np.array([(3.986004418e14 / n**2) ** (1 / 3)]))
    flown = propagate(np.concatenate(start), times, truth.FORCE)
    known = rtn_from_eci(flown[0], flown[1], truth.FORCE.normal_acceleration(flown[0]))
    assert np.linalg.norm(nodes[0, :3]) == pytest.approx(12_000, abs=1e-3)
    np.testing.assert_allclose(truth.positions(nodes, times), known[:, :3], atol=0.01)


def test_longer_steps_leave_the_numbers_within_a_runs_scatter() -> None:
    """Against the paper's own steps, by numbers that nearly every claim rests on."""
    setting = _plain()
    moved = _motion(setting)
    found: list[Array] = []
    for steps, runs in ((flight.FULL, 4), (flight.QUICK, 40)):
        generator = np.random.default_rng(3)
        flown = flight.flights(
            setting, moved.mean_motion_rad_s[0], moved.nodes[0], moved.left_out[0], generator, runs, steps
        )
        found.append(numbers(setting, flown, steps))
    full, quick = found
    scatter = quick.std(axis=0, ddof=1)
    told = [PLACE[f"table_2 ekf {label}"] for label in ("r mean", "r std", "v mean", "z std")]
    told += [PLACE[f"table_4 alpha={alpha} r mean"] for alpha in ("0.001", "0.1", "0.999")]
    off = (full.mean(axis=0) - quick.mean(axis=0))[told]
    error_of_means = scatter[told] * np.sqrt(1 / 4 + 1 / 40)
    assert np.all(np.abs(off) < 3.5 * error_of_means)
    # docs/replication.md, Table 2: 100 runs of the campaign itself.
    published = {"r mean": 0.966, "z std": 0.7317, "vz mean": 0.0035, "vy std": 0.0051}
    for label, value in published.items():
        place = PLACE[f"table_2 ekf {label}"]
        assert quick[:, place].mean() == pytest.approx(value, abs=4 * scatter[place] / np.sqrt(40) + 0.02 * value)


def test_scatter_of_drawn_samples_is_the_closed_form() -> None:
    """sqrt(trace R / (alpha N)) where the filter doesn't know of it: docs/filters.md."""
    setting = _plain() | {"draws": 0.0}
    moved = _motion(setting)
    arguments = moved.mean_motion_rad_s[0], moved.nodes[0], moved.left_out[0]
    drawn, plain = (
        flight.flights(setting | {"draws": draws}, *arguments, np.random.default_rng(5), 30)[2].errors[2][:, 800:, :3]
        for draws in (0.0, 1.0)
    )
    added = np.sqrt(np.mean((drawn - plain) ** 2) * 3)
    assert added == pytest.approx(np.sqrt((16 + 2 * 13.96**2) / (0.5 * 10_000)), rel=0.1)


def test_shared_process_noise_is_one() -> None:
    u = np.random.default_rng(2).random((1, len(UNKNOWNS)))
    setting = {name: float(value[0]) for name, value in values(UNKNOWNS, u).items()}
    one = {flight.process_noise(setting | {"sharing": 0.0}, column) for column in COLUMNS}
    three = {flight.process_noise(setting | {"sharing": 1.0}, column) for column in COLUMNS}
    seven = {flight.process_noise(setting | {"sharing": 2.0}, column) for column in COLUMNS}
    assert [len(one), len(three), len(seven)] == [1, 3, 7]
