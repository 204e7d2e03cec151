"""The figure of the scenario: the rate of the line of sight against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from relnav_sim.plots.scenario import line_of_sight_rate, widen
from relnav_sim.plots.style import house_style, new_figure


def test_the_line_of_sight_of_a_straight_pass_turns_as_the_arc_tangent() -> None:
    """Past at 100 m and 2 m/s: the angle is atan(2 t / 100), its derivative 0.02 / (1 + (t / 50)^2)."""
    t = np.linspace(-300.0, 300.0, 61)
    states = np.stack([0 * t, 2 * t, 0 * t + 100, 0 * t, 0 * t + 2, 0 * t], axis=-1)
    assert line_of_sight_rate(states) == pytest.approx(np.degrees(0.02 / (1 + (t / 50) ** 2)), rel=1e-12)


def test_a_deputy_that_comes_straight_in_does_not_turn_and_none_at_range_zero() -> None:
    assert line_of_sight_rate(np.array([3.0, 4.0, 0.0, -0.3, -0.4, 0.0])) == pytest.approx(0.0, abs=1e-15)
    assert np.isnan(line_of_sight_rate(np.zeros(6)))


def test_a_plane_has_a_least_span_about_what_it_shows() -> None:
    with house_style():
        panel = new_figure(1.0).subplots()
        panel.set(xlim=(999.9, 1000.0), ylim=(-3.0, 5.0))
        widen(panel, 1.0, 1.0)
        assert panel.get_xlim() == pytest.approx((999.45, 1000.45))
        assert panel.get_ylim() == (-3.0, 5.0)
