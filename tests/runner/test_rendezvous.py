"""The shipped rendezvous: its plan meets the way points, and every filter flies a hop of it."""

from pathlib import Path

import numpy as np
import pytest

from relnav_sim import load_campaign
from relnav_sim.campaign.manoeuvres import manoeuvre_times
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.simulation.block import simulate_block
from relnav_sim.streams import RandomSource
from relnav_sim.truth import nominal_chief, truth_trajectory

FILE = Path(__file__).parents[2] / "campaigns" / "rendezvous.yaml"
HOPS = [(12000, 3000), (3000, 800), (800, 200)]


@pytest.fixture(scope="module")
def config():
    return load_campaign(FILE).cases[0].config


def test_the_plan_leads_from_rest_to_rest_along_the_way_points(config):
    """Without execution errors, under J2 to J4 and drag: within half a metre of each point, at rest within 1 mm/s."""
    planned = config.truth.model_copy(update={"execution_errors": type(config.truth.execution_errors)()})
    ends = [each.end_s for each in manoeuvre_times(config)][1::2]
    path = truth_trajectory(planned, config.clock.duration_s, RandomSource(0, (0,)))
    relative = path.at([0.0, *(end + 0.5 for end in ends)]).relative[0]
    a = nominal_chief(config.truth).semi_major_axis_m
    for state, along in zip(relative, [12000, 3000, 800, 200], strict=True):
        point = [a * (np.cos(along / a) - 1), -a * np.sin(along / a), 0]
        np.testing.assert_allclose(state[:3], point, atol=0.5)
        np.testing.assert_allclose(state[3:], 0, atol=1e-3)


def test_the_plan_is_clohessy_and_wiltshires_but_for_some_percent(config):
    n = nominal_chief(config.truth).mean_motion_rad_s
    step = cw_transition(n, 2400.0)
    manoeuvres = list(config.truth.manoeuvres.values())
    for (here, there), start, stop in zip(HOPS, manoeuvres[::2], manoeuvres[1::2], strict=True):
        first = np.linalg.solve(step[:3, 3:], [0, here - there, 0])
        middle = [(each.time_s + each.end_s) / 2 for each in (start, stop)]
        assert middle[1] - middle[0] == pytest.approx(2400)
        np.testing.assert_allclose(start.delta_v, first, atol=0.01 * np.linalg.norm(first))
        np.testing.assert_allclose(stop.delta_v, -step[3:, 3:] @ first, atol=0.01 * np.linalg.norm(first))


SHORT = (
    "clock.duration_s=40",
    "statistics.settle_s=4",
    "truth.manoeuvres={burn: {time_s: 10, duration_s: 8, delta_v_m_s: [-0.4, 0.05, 0]}, "
    "kick: {time_s: 25.5, delta_v_m_s: [0.4, 0.1, 0]}, "
    "evade: {craft: chief, time_s: 31, delta_v_m_s: [0, 0.1, 0.1]}}",
    # So large that runs thrust in different steps, and no reading of noise is taken for thrust.
    "truth.execution_errors.timing_sigma_s=2",
    "sensors.accelerometer.deadband_m_s2=1e-2",
)


QUICK = ("ekf", "imm", "particle", "sr_ukf", "srif", "two_step")


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(name, marks=[] if name in QUICK else pytest.mark.slow)
        for name in sorted(name for name in filter_kinds() if not name.startswith("test_"))
    ],
)
def test_every_filter_flies_a_hop_and_no_bit_depends_on_the_block(kind):
    """Measured and planned thrust, latency, glint; a block of three runs, and one of them alone."""
    fields = filter_kinds()[kind].options_model.model_fields
    smaller = "".join(f", {name}: 100" for name in ("samples", "particles") if name in fields)
    motion = "" if kind.startswith(("gp_", "mf_")) else ", dynamics: {kind: cw_second_order}"
    entry = f"kind: {kind}{smaller}{motion}"
    told = f"filters={{measured: {{{entry}}}, planned: {{{entry}, known_thrust: planned}}}}"
    campaign = load_campaign(FILE, (*SHORT, told))
    together, alone = (simulate_block(campaign.cases[0], campaign.seed, runs) for runs in ((0, 1, 2), (1,)))
    assert not together.broken and not together.result.failures
    for name, found in together.result.filters.items():
        assert np.isfinite(found.error).all()
        assert np.array_equal(found.error[1:2], alone.result.filters[name].error)
