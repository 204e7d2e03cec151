"""A campaign of many cases: what every command does for it is counted, not timed."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from relnav_sim import load_campaign, open_results, regret, run_campaign
from relnav_sim.campaign.load import parse_campaign
from relnav_sim.report import write_report
from relnav_sim.results import journal, shard_files, stacks
from relnav_sim.results.comparable import same_numbers
from relnav_sim.results.contents import contents_of
from relnav_sim.results.shard_files import held_shards
from relnav_sim.results.stored_campaign import stored_campaign
from relnav_sim.runner import job
from relnav_sim.runner.merging import merge_results
from relnav_sim.runner.so_far import contents_so_far
from relnav_sim.runner.unfinished import is_unfinished, results_so_far
from relnav_sim.sensors import conformity

STACKED, ALIKE = 10, 5
CASES = STACKED + 2
TEXT = f"""name: many
seed: 5
runs: 2
bound: false
clock: {{duration_s: 10, step_s: 1, store_every_s: 5}}
truth:
  chief:
    orbit: {{a_km: 7000, e: 0, i_deg: 50, raan_deg: 0, argp_deg: 0, ta_deg: 0}}
    mass_kg: 500
    area_m2: 2
    drag_coefficient: 2.2
  deputy:
    relative: {{position_m: [0, 1000, 0], velocity_m_s: [0, 0, 0]}}
    mass_kg: 500
    area_m2: 2
    drag_coefficient: 2.2
sensors:
  radar: {{range_sigma_m: 4, angle_sigma_deg: 0.07}}
  gnss: {{position_sigma_m: 10, velocity_sigma_m_s: 0.05}}
  star_tracker: {{cross_boresight_sigma_arcsec: 10, about_boresight_sigma_arcsec: 30}}
start: {{kind: first_fix, velocity_sigma_m_s: 0.5}}
statistics: {{settle_s: 2}}
filters:
  ekf: {{kind: ekf, dynamics: {{kind: cw}}, process_noise: {{acceleration_psd_m2_s3: 1.0e-6}}}}
grid:
  sensors.radar.range_sigma_m: {[round(1 + 0.1 * i, 3) for i in range(CASES)]}
"""


@pytest.fixture(scope="module", autouse=True)
def few_are_many():
    """Let a campaign of a dozen cases count as one of many."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stacks, "STACKED_CASES", STACKED)
        patch.setattr(conformity.TriedSensors, "MOST_ALIKE", ALIKE)
        yield


@pytest.fixture(scope="module")
def many(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("many")
    (folder / "many.yaml").write_text(TEXT)
    return run_campaign(load_campaign(folder / "many.yaml"), folder / "many.h5", backend="sequential")


@pytest.fixture
def again(many: Path, tmp_path: Path):
    """A copy of the result with its shards, and its campaign."""
    shutil.copy(many, tmp_path / "many.h5")
    shutil.copytree(f"{many}.shards", tmp_path / "many.h5.shards")
    return load_campaign(many.parent / "many.yaml"), tmp_path / "many.h5"


def test_sensors_that_differ_in_a_number_are_tried_a_few_times(monkeypatch) -> None:
    tried: list[str] = []
    before = conformity.complaints
    monkeypatch.setattr(conformity, "complaints", lambda name, *rest: tried.append(name) or before(name, *rest))
    campaign = parse_campaign(TEXT)
    assert len(campaign.cases) == CASES and len({case.id for case in campaign.cases}) == CASES
    assert tried.count("gnss") == tried.count("star_tracker") == 1
    assert tried.count("radar") == ALIKE < CASES


def test_nothing_to_do_merges_nothing_and_verifies_every_shard(again, monkeypatch) -> None:
    campaign, out = again
    before = out.read_bytes()
    monkeypatch.setattr(job, "merge_pieces", lambda *arguments, **named: pytest.fail("it is merged already"))
    run_campaign(campaign, out, backend="sequential")
    assert out.read_bytes() == before and not is_unfinished(out)


def test_a_damaged_result_is_merged_again(again) -> None:
    campaign, out = again
    content = bytearray(out.read_bytes())
    content[len(content) // 2] ^= 1
    out.write_bytes(content)
    run_campaign(campaign, out, backend="sequential")
    with open_results(out) as results:
        assert not results.missing()


def test_shards_are_packed_and_the_campaign_goes_on_from_them(many, again, monkeypatch) -> None:
    campaign, out = again
    folder = Path(f"{out}.shards")
    out.unlink()
    assert shard_files.pack(folder, 0)
    (folder / journal.JOURNAL).write_bytes((folder / journal.JOURNAL).read_bytes()[:-30])
    assert is_unfinished(out) and len(held_shards(folder)[0]) == CASES - 1
    with results_so_far(out) as so_far, open_results(so_far) as results:
        assert len(results.missing()) == 1
        assert contents_so_far(out) == contents_of(results)
    run_campaign(campaign, out, backend="sequential")
    with open_results(out) as results, open_results(many) as reference:
        assert same_numbers(results, reference)
    merged = merge_results(out.with_name("merged.h5"), [folder])
    with open_results(merged) as results, open_results(many) as reference:
        assert same_numbers(results, reference)


def test_a_campaign_packs_as_it_goes(many, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(job, "MOST_LOOSE", 5)
    packs: list[int] = []
    pack = shard_files.pack
    monkeypatch.setattr(job, "pack", lambda folder, most_loose=5: packs.append(pack(folder, most_loose)))
    out = run_campaign(load_campaign(many.parent / "many.yaml"), tmp_path / "many.h5", backend="sequential")
    assert sum(packs) >= CASES // 6 - 1
    assert not list(Path(f"{out}.shards").glob("*.h5")), "the last ones are packed at the end"
    with open_results(out) as results, open_results(many) as reference:
        assert same_numbers(results, reference)


@pytest.mark.usefixtures("unrendered")
def test_a_report_shows_closely_what_is_asked_for(many, tmp_path) -> None:
    page = write_report(many, tmp_path / "out", formats=["md"], cases=[3, 7], most_figures=0, workers=1)
    text = page.read_text()
    assert f"2 of {CASES} cases are shown closely" in text and "--case CASE" in text
    assert "Case 3:" in text and "Case 7:" in text and "Case 4:" not in text


def test_stressed_cases_turn_groups_of_cases_into_stacks(tmp_path) -> None:
    """A stress takes a result over the border between the layouts; what was there stays, bit for bit."""
    few = CASES // 2
    text = TEXT.replace(f"{[round(1 + 0.1 * i, 3) for i in range(CASES)]}", f"{list(range(1, few + 1))}")
    text = text.replace("runs: 2", "runs: 1")
    campaign = parse_campaign(text + "stress:\n  noisy: {sensors.radar.range_sigma_m: {times: 3}}\n")
    out = run_campaign(campaign, tmp_path / "few.h5", backend="sequential")
    before = shutil.copy(out, tmp_path / "before.h5")
    run_campaign(campaign.with_stress(), out, backend="sequential")
    assert not is_unfinished(out)
    with open_results(before) as nominal, open_results(out) as results:
        assert nominal.headers == results.headers[:few]
        assert len(results.headers) == 2 * few > STACKED and not results.missing()
        assert results.nominal == tuple(range(few)) and results.stressed(3) == {"noisy": few + 3}
        assert [header.stress for header in results.headers] == [""] * few + ["noisy"] * few
        assert results.headers[few + 3].nominal == results.headers[3].id
        for case in range(few):
            assert nominal.error(case, "ekf").tobytes() == results.error(case, "ekf").tobytes()
        # The truth and the draws are the same, the noise is three times that which the filter is told of.
        assert results.truth(few).tobytes() == results.truth(0).tobytes()
        assert results.error(few, "ekf").tobytes() != results.error(0, "ekf").tobytes()
        stress = results.summary()["stress"]
        assert stress.tolist() == [""] * few + ["noisy"] * few
        against = regret(results, 3)
        assert against.indices == (3, few + 3)
        assert [case.id for case in stored_campaign(results).cases] == [header.id for header in results.headers]
