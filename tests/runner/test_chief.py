"""Filters of a block that believe the same of the chief's orbit share its estimate; no bit of a result shows it."""

import numpy as np
import pytest

from relnav_sim.campaign.load import parse_campaign
from relnav_sim.models import nonlinear_j2
from relnav_sim.runner.block import simulate_block
from relnav_sim.runner.work import with_filters

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
    real, made = nonlinear_j2.OrbitFilter, []

    def counted(*args):
        made.append(real(*args))
        return made[-1]

    monkeypatch.setattr(nonlinear_j2, "OrbitFilter", counted)
    together = simulate_block(case, 1, [3]).result
    assert len(made) == 4  # wide, narrow and ukf share one
    for name in ("wide", "narrow", "higher", "untold"):
        alone = simulate_block(with_filters(case, [name]), 1, [3]).result.filters[name]
        shared = together.filters[name]
        assert np.array_equal(shared.error, alone.error)
        assert np.array_equal(shared.sigma, alone.sigma)
        assert np.isfinite(shared.error).all()
    assert not np.array_equal(together.filters["wide"].error, together.filters["untold"].error)
