"""Phases of a flight, and what a budget says of them."""

import numpy as np
import pytest
from small import campaign

from relnav_sim.budget import error_budget
from relnav_sim.budget.phases import Phase, phases
from relnav_sim.budget.table import phase_rows


def found(read, *overrides):
    return phases(campaign(*overrides).cases[0].config, np.arange(61.0), read)


def reads(*spells, every=1):
    row = np.zeros(61, dtype=bool)
    for begin, end in spells:
        row[begin : end + 1 : every] = True
    return row


def test_they_end_before_manoeuvres_at_the_steady_state_and_at_hand_overs():
    read = {"gnss": reads((1, 40)), "radar": reads((35, 60), every=2)}
    assert found(read) == (
        Phase("before push", 20),
        Phase("steady state", 30),
        Phase("before radar reads", 34),
        Phase("gnss falls silent", 40),
        Phase("end", 60),
    )


def test_a_sensor_that_comes_and_goes_or_is_always_there_hands_nothing_over():
    blinking = reads(*((start, start + 1) for start in range(0, 60, 8)))
    assert found({"camera": blinking, "radar": reads((1, 60), every=5)}, "truth.manoeuvres={}") == (
        Phase("steady state", 30),
        Phase("end", 60),
    )
    assert found({"camera": reads()}, "truth.manoeuvres={}", "statistics.settle_s=0") == (Phase("end", 60),)


@pytest.fixture(scope="module")
def budget():
    return error_budget(campaign(), filter="ekf")


def test_variances_at_the_ends(budget):
    ends = [phase.epoch for phase in budget.phases]
    assert ends == [20, 30, 60]
    np.testing.assert_array_equal(budget.at_phases(), budget.variance[:, ends])
    rows = phase_rows(budget)
    assert [row[0] for row in rows[-2:]] == ["total", "formal"] and all(len(row) == 4 for row in rows)
    assert float(rows[-2][-1]) == pytest.approx(np.sqrt(budget.total[-1, :3].sum()), rel=1e-2)


def test_the_total_grows_with_the_size_of_a_source_as_its_slope_says(budget):
    """Against budgets of the campaign with the bias and the correlated error a thousandth larger."""
    noise = "[{kind: gaussian}, {kind: gauss_markov, tau_s: 20, scale: SCALE}, {kind: bias, value: [1, 0, 0]}]"
    bias, part = budget.sources.index("radar azimuth bias"), budget.sources.index("radar range correlated error, 20 s")
    assert (budget.units[bias], budget.units[part]) == ("deg", "m")
    assert budget.sizes[[bias, part]] == pytest.approx([0.02, 1.0])
    # The channels share the scale, so their relative slopes add up.
    scaled = error_budget(campaign(f"sensors.radar.noise={noise.replace('SCALE', '0.5005')}"), filter="ekf")
    channels = [place for place, name in enumerate(budget.sources) if "correlated" in name]
    slope = (budget.sensitivity() * budget.sizes[:, None, None])[channels].sum(axis=0)
    grown = (np.sqrt(scaled.total) - np.sqrt(budget.total)) / 1e-3
    np.testing.assert_allclose(grown[1:], slope[1:], rtol=2e-3, atol=1e-6)
    # Readings are taken about the biased ones, which changes the rest to second order.
    biased = error_budget(campaign("sensors.radar.azimuth_bias_deg=0.02002"), filter="ekf")
    grown = (np.sqrt(biased.total) - np.sqrt(budget.total))[5:, :3] / 2e-5
    slope = budget.sensitivity()[bias][5:, :3]
    np.testing.assert_allclose(grown, slope, atol=2e-2 * np.abs(slope).max())
