import numpy as np
import pytest

from relnav_sim.arrays import Array
from replication.inverse import mf_upf_learned
from replication.inverse.mf_upf import PARTICLES, UNKNOWNS, MfUpf, holds
from replication.inverse.mf_upf_scenario import STEPS_S, truth
from replication.inverse.prior import values

PLACE = {unknown.name: place for place, unknown in enumerate(mf_upf_learned.UNKNOWNS)}


def _settings(count: int, **at: float) -> Array:
    """Return settings (count, unknowns) with uniform numbers of 0 but for those given."""
    u = np.zeros((count, len(mf_upf_learned.UNKNOWNS)))
    for name, value in at.items():
        u[:, PLACE[name]] = value
    return u


def test_truth_is_that_of_the_campaign() -> None:
    """docs/replication.md: from a perfect start Clohessy-Wiltshire alone is off by up to 9.97 m in a revolution."""
    from relnav_sim.dynamics.clohessy_wiltshire import cw_transition

    times = np.arange(0.0, 6001.0, 20.0)
    states = truth(np.array([0.022]), times)[0]
    np.testing.assert_allclose(states[0], [300, -371.055, -400, -0.2, -0.646805, 0.1], atol=1e-8)
    n = np.sqrt(3.986004418e14 / 7e6**3)
    alone = np.array([cw_transition(n, time) @ states[0] for time in times])
    r = np.linalg.norm((alone - states)[times > 1000, :3], axis=1)
    assert r.max() == pytest.approx(9.97, abs=0.03)


def test_an_oscillation_that_stays_is_what_b3_says() -> None:
    transient = [0.2, 0.1, 2.8, 1.0, 0.0003, 0.01]
    sustained = [5.0, 3.0, 3.5, 3.1, 0.009, 0.011]
    quiet = [0.2, 0.1, 0.1, 0.1, 0.0003, 0.0003]
    held = holds(np.array([transient, sustained, quiet]))
    assert held["B3"].tolist() == [False, True, False]
    assert held["B4"].tolist() == [False, True, False]
    assert held["B6"].tolist() == [True, False, False]


def test_particles_of_unlike_settings_fly_in_one_block() -> None:
    paper = MfUpf()
    u = _settings(3, step=0.99, roughening=0.9)[:, : len(UNKNOWNS)]
    u[2, PLACE["particles"]] = 0.3
    seeds = [[1, n] for n in range(3)]
    found = paper.flown(u, seeds, 1)[:, 0]
    np.testing.assert_allclose(paper.flown(u[1:2], seeds[1:2], 1)[:, 0], found[1:2], rtol=1e-9)
    assert (found[:, 0] < 2.0).all()  # from 1 cm and with the radar's own sigma
    assert (STEPS_S[-1], PARTICLES[1]) == (20.0, 100)


def test_what_clohessy_wiltshire_leaves_over_is_learned_best() -> None:
    """Off the learned orbit the next state falls back to its mean, the residual to the base dynamics."""
    u = _settings(2, step=0.99, lengths=0.9, standardised=0.9, calibrated=0.9, start_position_m=0.5, added_psd=0.7)
    u[1, PLACE["target"]] = 0.9
    setting = values(mf_upf_learned.UNKNOWNS, u)
    absolute, residual = mf_upf_learned.learned_outcomes(setting, [[1, 0], [1, 1]])
    assert residual[0] < absolute[0]
    assert residual[0] < 0.5
    assert absolute[2] < 100
    found = np.concatenate([residual, [5.0, 3.0, 3.5, 3.1, 0.009, 0.011]])[None]
    held = mf_upf_learned.holds(found)
    assert held["B1"][0]
    assert held["B5"][0]
    assert held["B3"][0]
    assert not mf_upf_learned.holds(np.array([[0.6, 0.002, 2.0, 5.0, 3.0, 3.5, 3.1, 0.009, 0.011]]))["B5"][0]
