import numpy as np

from relnav_sim.arrays import Array
from replication.inverse.two_step import OUTCOMES, OWN, SHARED, UNKNOWNS, TwoStep, holds

PLACE = {unknown.name: place for place, unknown in enumerate(UNKNOWNS)}


def _quantile(name: str, value: float) -> float:
    """Return the uniform number that a log-uniform law turns into a value."""
    law = UNKNOWNS[PLACE[name]].law
    low, high = np.log(law(np.array([0.0, 1.0])))
    return float((np.log(value) - low) / (high - low))


def test_the_start_decides_where_the_prior_is_wide_and_nothing_where_it_is_not() -> None:
    """The scenario of campaigns/two_step.yaml: 10 % converge from 200 m with a linearised start, all from 1 m."""
    u = np.full((4, len(UNKNOWNS)), 0.5)
    values = {"step_s": 1, "range_sigma_m": 0.0333, "angle_sigma_deg": 0.0167, "acceleration_psd": 1e-10, "slack": 1}
    values |= {"distance_m": 620, "start_velocity_m_s": 0.3}
    for name, value in values.items():
        u[:, PLACE[name]] = _quantile(name, value)
    u[:, PLACE["start_position_m"]] = [_quantile("start_position_m", sigma) for sigma in (0.5, 0.5, 200, 200)]
    found = TwoStep().flown(u, [[1, n] for n in range(4)], 1)[:, 0]
    outcome = dict(zip(OUTCOMES, found.T, strict=True))
    assert (outcome["converged, unscented start"] == 1).all()
    assert (outcome["converged, arbitrary start"][:2] == 1).all()
    assert (outcome["converged, arbitrary start"][2:] < 0.6).all()
    np.testing.assert_allclose(outcome["settled error over the ekf's"][:2], 1, atol=0.02)
    assert (outcome["whole error over the ekf's"][2:] < 0.5).all()
    assert holds(found)["C1"].tolist() == [False, False, True, True]


def test_a_block_shares_its_first_settings_radar() -> None:
    u: Array = np.random.default_rng(1).random((200, len(UNKNOWNS)))
    acting = TwoStep().effective(u)
    shared = len(SHARED)
    assert (acting[:100, :shared] == u[0, :shared]).all()
    assert (acting[100:, :shared] == u[100, :shared]).all()
    np.testing.assert_array_equal(acting[:, shared:], u[:, shared:])
    assert shared + len(OWN) == len(UNKNOWNS)
