"""Under the real field a process noise tuned without it makes a filter far too sure, and one tuned with it does not."""

from dataclasses import replace
from pathlib import Path

import pytest

from relnav_sim import load_campaign, open_results, run_campaign
from relnav_sim.statistics.intervals import mean_interval

FILE = Path(__file__).parents[2] / "campaigns" / "limit_real_field.yaml"
WANTED = ("kf", "kf_zonal_noise", "kf_field_20")


@pytest.mark.slow
def test_consistency_of_the_scenario_taken_furthest(tmp_path):
    whole = load_campaign(FILE, ("runs=20", "block_runs=20"))
    case = whole.cases[0]
    few = case.config.model_copy(update={"filters": {name: case.config.filters[name] for name in WANTED}})
    out = run_campaign(
        replace(whole, cases=(replace(case, config=few),)), tmp_path / "out.h5", workers=1, backend="sequential"
    )
    with open_results(out) as results:
        summary = results.summary()
    of = {name: summary["filter"] == name for name in WANTED}
    anees = {name: summary["settled_anees"][rows] for name, rows in of.items()}
    error = {name: summary["settled_r_mean_m"][rows] for name, rows in of.items()}
    for name in ("kf", "kf_field_20"):
        found = mean_interval(anees[name])
        assert found.low < 1.1 and found.high > 0.9, name
    assert mean_interval(anees["kf_zonal_noise"]).low > 10
    # What the tuned process noise costs is what the field is worth: paired, on the same runs.
    assert mean_interval(error["kf"] - error["kf_field_20"]).low > 0
