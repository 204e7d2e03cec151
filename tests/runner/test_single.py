"""One run by itself has the bits that it has in the campaign, also at full rate and whatever the store interval."""

import numpy as np
import pytest
from taking_turns import taking_turns

from relnav_sim import open_results, run_campaign
from relnav_sim.results import layout
from relnav_sim.results.block import RefusedError
from relnav_sim.runner.single import run_single


@pytest.fixture(scope="module")
def whole(make_campaign, tmp_path_factory):
    return run_campaign(make_campaign(), tmp_path_factory.mktemp("whole") / "whole.h5", backend="sequential")


@pytest.mark.parametrize(
    "case, run, trace",
    taking_turns([("0", 3), ("case_001", 5), ("sensors.radar.noise.kind=mixture", 0)], [True, False]),
)
def test_same_bits_as_in_the_campaign(campaign, tmp_path, whole, case, run, trace):
    every = 1 if trace else 4
    out = run_single(campaign(), case, run, tmp_path / "one.h5", trace=trace, backend="sequential")
    with open_results(out) as one, open_results(whole) as many:
        (header,) = one.headers
        original = many.case_index(header.id)
        assert one.missing() == {} and one.runs == (run,)
        assert one.time_s(0).tolist() == list(range(0, 41, every))
        assert one.campaign_content["clock"]["store_every_s"] == every
        stride = slice(None, None, 4 // every)
        for name in ("kf", "ekf"):
            for spec in layout.SUMMARY:
                if not spec.timing:
                    mine, theirs = one.statistic(0, name, spec.name), many.statistic(original, name, spec.name)
                    assert mine[0].tobytes() == theirs[run].tobytes(), spec.name
            mine, theirs = one.series(0, name, run), many.series(original, name, run)
            for series in ("error", "sigma", "nis", "nees", "truth"):
                assert getattr(mine, series)[stride].tobytes() == getattr(theirs, series).tobytes(), series


def test_its_own_file_by_default(campaign, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out = run_single(campaign(), 1, 2, backend="sequential")
    assert str(out) == "results/small.case_001.run_2.h5"
    assert [path.name for path in out.parent.iterdir()] == [out.name]


@pytest.mark.parametrize("case, run, word", [(2, 0, "no case 2"), ("x", 0, "no case 'x'"), (0, 6, "0 to 5")])
def test_what_is_not_there_is_refused(campaign, tmp_path, case, run, word):
    with pytest.raises(RefusedError, match=word):
        run_single(campaign(), case, run, tmp_path / "one.h5", backend="sequential")


def test_a_single_truth_for_all_runs(campaign, tmp_path):
    parsed = campaign("truth.dispersions={}")
    whole = run_campaign(parsed, tmp_path / "whole.h5", backend="sequential")
    out = run_single(parsed, 0, 4, tmp_path / "one.h5", trace=True, backend="sequential")
    with open_results(out) as one, open_results(whole) as many:
        assert np.array_equal(one.truth(0)[:, ::4], many.truth(0))


@pytest.mark.parametrize("many", [False, True], ids=["one run", "all runs"])
def test_the_warnings_of_its_case_are_said_once(campaign, tmp_path, many):
    short = campaign("statistics.convergence_hold_s=60", "sensors.radar.range_sigma_m=200000", "bound=false")
    said: list[str] = []
    if many:
        run_campaign(short, tmp_path / "all.h5", backend="sequential", say=said.append)
    else:
        run_single(short, 0, 1, tmp_path / "one.h5", backend="sequential", say=said.append)
    warned = [sentence for sentence in said if sentence.startswith("warning: ")]
    assert len(warned) == len(set(warned))
    assert "would not be positive" in warned[0] and "convergence cannot be judged" in warned[-1]
    assert all("not observable" in sentence for sentence in warned[1:-1])  # by so coarse a range
