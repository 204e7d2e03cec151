"""Every registered filter goes through a campaign: its options arrive, it starts, its results are stored."""

import pytest

from relnav_sim import open_results, run_campaign
from relnav_sim.filters.registry import filter_kinds

SMALLER = {"samples": 200, "particles": 200}
LEARNED_FROM_LITTLE = ", dynamics: {kind: gp, training_points: 50, training_span_s: 200, calibration_span_s: 60}"


@pytest.mark.parametrize("kind", sorted(name for name in filter_kinds() if not name.startswith("test_")))
def test_runs_in_a_campaign(campaign, tmp_path, kind):
    entry = filter_kinds()[kind]
    fields = entry.options_model.model_fields
    options = "".join(f", {name}: {value}" for name, value in SMALLER.items() if name in fields)
    options += LEARNED_FROM_LITTLE if entry.learned_dynamics else ""
    parsed = campaign(
        f"filters={{this: {{kind: {kind}{options}}}}}", "runs=2", "clock.duration_s=12", "grid={}", "bound=false"
    )
    out = run_campaign(parsed, tmp_path / "out.h5", backend="sequential")
    with open_results(out) as results:
        assert not results.failures()
        assert (results.statistic(0, "this", "rms") > 0).all()
