"""Filters of a block that believe the same of the chief's orbit share its estimate; no bit of a result shows it."""

import time
from dataclasses import replace

import numpy as np
import pytest

from relnav_sim.campaign.load import parse_campaign
from relnav_sim.dynamics import about_chief
from relnav_sim.dynamics.motion import ZonalMotion
from relnav_sim.runner.work import with_filters
from relnav_sim.simulation.block import simulate_block

FILTERS = """
filters:
  wide: {kind: ekf, dynamics: {kind: nonlinear_j2}, process_noise: {acceleration_psd_m2_s3: 1.0e-8}}
  narrow: {kind: ekf, dynamics: {kind: nonlinear_j2}, process_noise: {acceleration_psd_m2_s3: 1.0e-12}}
  higher: {kind: ekf, dynamics: {kind: nonlinear_j2, zonals: 4}}
  stiff: {kind: ekf, dynamics: {kind: nonlinear_j2, chief_orbit: {acceleration_psd_m2_s3: 1.0e-12}}}
  untold: {kind: ekf, dynamics: {kind: nonlinear_j2}, known_thrust: none}
  ukf: {kind: ukf, dynamics: {kind: nonlinear_j2}}
"""
PUSH = {"craft": "chief", "time_s": 20.3, "delta_v_m_s": [0.5, 1.0, -1.0]}


@pytest.fixture
def case(make_campaign):
    text = make_campaign().text
    text = text[: text.index("filters:")] + FILTERS.lstrip()
    text = text.replace("truth:\n", f"truth:\n  manoeuvres: {{push: {PUSH}}}\n").replace("'", "")
    return parse_campaign(text, ["clock.duration_s=530", "statistics.settle_s=100"]).cases[0]


def test_shared_estimates_change_no_bit(case, monkeypatch):
    real, made = about_chief.OrbitFilter, []

    def counted(*args):
        made.append(real(*args))
        return made[-1]

    monkeypatch.setattr(about_chief, "OrbitFilter", counted)
    together = simulate_block(case, 1, [3]).result
    assert len(made) == 4  # wide, narrow and ukf share one
    for name in ("wide", "narrow", "higher", "untold"):
        alone = simulate_block(with_filters(case, [name]), 1, [3]).result.filters[name]
        shared = together.filters[name]
        assert np.array_equal(shared.error, alone.error)
        assert np.array_equal(shared.sigma, alone.sigma)
        assert np.isfinite(shared.error).all()
    assert not np.array_equal(together.filters["wide"].error, together.filters["untold"].error)


@pytest.mark.parametrize("gnss", [True, False])
def test_whoever_shares_the_chief_is_charged_all_of_it(case, monkeypatch, gnss):
    """By a clock that stands still but for a second whenever segments are computed."""
    clock, real = [0.0], ZonalMotion.legs

    def slow(*args):
        clock[0] += 1
        return real(*args)

    monkeypatch.setattr(ZonalMotion, "legs", slow)
    monkeypatch.setattr(time, "process_time", lambda: clock[0])
    if not gnss:
        sensors = {name: each for name, each in case.config.sensors.items() if name != "gnss"}
        case = replace(case, config=case.config.model_copy(update={"sensors": sensors}))
    for names in (["wide"], ["narrow", "wide", "ukf"]):
        before = clock[0]
        found = simulate_block(with_filters(case, names), 1, [3, 4]).result.filters
        seconds = clock[0] - before
        assert seconds > 0
        for name in names:
            assert found[name].summary["cpu_per_step"].tolist() == [pytest.approx(1e6 * seconds / (2 * 531))] * 2
