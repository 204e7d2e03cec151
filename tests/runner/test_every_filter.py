"""Every registered filter goes through a campaign: its options arrive, it starts, its results are stored."""

import pytest

from relnav_sim import open_results, run_campaign
from relnav_sim.filters.registry import filter_kinds

SMALLER = {"samples": 200, "particles": 200}
LEARNED_FROM_LITTLE = ", dynamics: {kind: gp, training_points: 50, training_span_s: 200, calibration_span_s: 60}"
KINDS = sorted(name for name in filter_kinds() if not name.startswith("test_"))


@pytest.fixture(scope="module")
def results(make_campaign, tmp_path_factory):
    """The results of one campaign with a filter of each kind, named after it."""
    filters = ", ".join(f"{kind}: {{kind: {kind}{_options(kind)}}}" for kind in KINDS)
    parsed = make_campaign(f"filters={{{filters}}}", "runs=2", "clock.duration_s=12", "grid={}", "bound=false")
    with open_results(run_campaign(parsed, tmp_path_factory.mktemp("all") / "out.h5", backend="sequential")) as found:
        yield found


def _options(kind):
    entry = filter_kinds()[kind]
    fields = entry.options_model.model_fields
    options = "".join(f", {name}: {value}" for name, value in SMALLER.items() if name in fields)
    return options + (LEARNED_FROM_LITTLE if entry.learned_dynamics else "")


@pytest.mark.parametrize("kind", KINDS)
def test_runs_in_a_campaign(results, kind):
    assert not [failure for _, failure in results.failures() if failure.filter in ("", kind)]
    assert (results.statistic(0, kind, "rms") > 0).all()
