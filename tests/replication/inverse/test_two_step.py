import numpy as np

from replication.inverse.two_step import OUTCOMES, SLACKS, UNKNOWNS, TwoStep, holds

PLACE = {unknown.name: place for place, unknown in enumerate(UNKNOWNS)}


def _quantile(name: str, value: float) -> float:
    """Return the uniform number that a log-uniform law turns into a value."""
    law = UNKNOWNS[PLACE[name]].law
    low, high = np.log(law(np.array([0.0, 1.0])))
    return float((np.log(value) - low) / (high - low))


def test_the_start_decides_where_the_prior_is_wide_and_nothing_where_it_is_not() -> None:
    """The scenario of campaigns/two_step.yaml: 10 % converge from 200 m with a linearised start, all from 1 m."""
    u = np.full((4, len(UNKNOWNS)), 0.5)
    values = {"step_s": 1, "range_sigma_m": 0.0333, "angle_sigma_deg": 0.0167, "acceleration_psd": 1e-10}
    values |= {"distance_m": 620, "start_velocity_m_s": 0.3}
    for name, value in values.items():
        u[:, PLACE[name]] = _quantile(name, value)
    u[:, PLACE["slack"]] = (SLACKS.index(1.0) + 0.5) / len(SLACKS)
    u[:, PLACE["start_position_m"]] = [_quantile("start_position_m", sigma) for sigma in (0.5, 0.5, 200, 200)]
    found = TwoStep().flown(u, [[1, n] for n in range(4)], 1)[:, 0]
    outcome = dict(zip(OUTCOMES, found.T, strict=True))
    assert (outcome["converged, unscented start"] == 1).all()
    assert (outcome["converged, arbitrary start"][:2] == 1).all()
    assert (outcome["converged, arbitrary start"][2:] < 0.6).all()
    np.testing.assert_allclose(outcome["steady-state error over the ekf's"][:2], 1, atol=0.02)
    assert (outcome["whole error over the ekf's"][2:] < 0.5).all()
    assert holds(found)["C1"].tolist() == [False, False, True, True]


def test_a_settings_outcomes_do_not_depend_on_the_others_of_its_block() -> None:
    u = np.random.default_rng(1).random((5, len(UNKNOWNS)))
    seeds = [[1, n] for n in range(5)]
    whole = TwoStep().flown(u, seeds, 1)
    np.testing.assert_allclose(TwoStep().flown(u[3:], seeds[3:], 1), whole[3:], rtol=1e-9)
    assert len(np.unique(whole[:, 0, 2])) == 5
