"""The formation of Wei, Song and Zhang (2012): what the shipped campaigns must reach, in few runs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relnav_sim import load_campaign, open_results, run_campaign

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
# Mean position and velocity error after 1000 s, m and m/s.
MOST = {
    "ekf_j2": (0.02, 6e-5),
    "ekf_j2_drag": (0.02, 6e-5),
    "gp_ukf_residual_radar": (0.06, 4e-4),
    "mf_upf_residual_radar": (0.06, 4e-4),
}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "runs"), [("mf_upf", 6), ("mf_upf_particles", 1)])
def test_errors_after_1000_s(tmp_path, name, runs):
    whole = load_campaign(CAMPAIGNS / f"{name}.yaml", (f"runs={runs}", "bound=false", f"block_runs={runs}"))
    (case,) = whole.cases
    wanted = {filter: entry for filter, entry in case.config.filters.items() if filter in MOST}
    few = replace(case, config=case.config.model_copy(update={"filters": wanted}))
    out = run_campaign(replace(whole, cases=(few,)), tmp_path / "out.h5", backend="sequential")
    with open_results(out) as results:
        summary = results.summary()
    assert wanted and not summary["failed"].any()
    for filter in wanted:
        rows = summary["filter"] == filter
        position, velocity = MOST[filter]
        assert np.mean(summary["settled_r_mean_m"][rows]) < position
        assert np.mean(summary["settled_v_mean_m_s"][rows]) < velocity
        assert 0.5 < np.mean(summary["settled_anees"][rows]) < 2
