"""Several campaigns at once give what each gives alone, each as soon as it is complete."""

from dataclasses import replace

import pytest
from small_campaign import assert_same_bits

from relnav_sim import open_results, run_campaign
from relnav_sim.crlb.case_bound import failed_bound
from relnav_sim.results.block import RefusedError
from relnav_sim.runner import compute, job, several
from relnav_sim.runner.pool import Pool
from relnav_sim.runner.several import run_campaigns
from relnav_sim.runner.shard_folder import working_folder


@pytest.mark.slow
def test_several_campaigns_are_what_each_is_alone(campaign, tmp_path, capsys):
    first, second = campaign("runs=3"), replace(campaign("runs=5", "clock.duration_s=60"), name="longer")
    jobs = [(first, tmp_path / "first.h5"), (second, tmp_path / "second.h5")]
    # A part of the second is there already.
    run_campaign(campaign("runs=4", "clock.duration_s=60"), tmp_path / "second.h5", backend="sequential")
    said = []
    run_campaigns(jobs, progress=True, say=said.append)
    assert sorted(said) == ["longer is complete", "small is complete"]
    for one, out in jobs:
        alone = run_campaign(one, tmp_path / f"alone_{out.name}", backend="sequential")
        assert_same_bits(alone, out)
        with open_results(out) as results:
            assert results.missing() == {}
    assert "longer, sensors.radar.noise.kind=gaussian: position error" in capsys.readouterr().err
    again = [path.stat().st_mtime_ns for path in tmp_path.rglob("*.h5") if "shards" in str(path)]
    run_campaigns(jobs)
    assert again == [path.stat().st_mtime_ns for path in tmp_path.rglob("*.h5") if "shards" in str(path)]


@pytest.mark.slow
def test_an_interruption_keeps_the_campaigns_that_are_complete(campaign, tmp_path, monkeypatch):
    jobs = [(campaign(f"seed={seed}"), tmp_path / f"{seed}.h5") for seed in (1, 2)]
    alone = run_campaign(jobs[0][0], tmp_path / "alone.h5", backend="sequential")

    class Interrupted(Pool):
        def computed(self, tasks):
            for done in Pool(backend="sequential").computed(tasks):
                if done.block.seed == 2:
                    raise KeyboardInterrupt
                yield done

    monkeypatch.setattr(several, "Pool", Interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_campaigns(jobs)
    assert_same_bits(alone, tmp_path / "1.h5")
    assert not (tmp_path / "2.h5").exists()
    run_campaign(jobs[1][0], tmp_path / "2.h5", backend="sequential")  # the folder is free again


def test_a_campaign_is_complete_with_the_pieces_of_its_blocks(campaign, tmp_path, monkeypatch):
    """As a killed worker leaves them; and a campaign that lacks nothing but its file waits for no other."""
    jobs = [(campaign(f"seed={seed}"), tmp_path / f"{seed}.h5") for seed in (1, 2, 3)]
    alone = run_campaign(jobs[0][0], tmp_path / "alone.h5", backend="sequential")
    run_campaign(*jobs[1], backend="sequential").unlink()

    class Cutting(Pool):
        def computed(self, tasks):
            for task in tasks:
                if task.seed == 3:
                    raise KeyboardInterrupt
                yield from Pool(backend="sequential").computed(task.pieces() or [task])

    monkeypatch.setattr(several, "Pool", Cutting)
    with pytest.raises(KeyboardInterrupt):
        run_campaigns(jobs)
    assert_same_bits(alone, tmp_path / "1.h5")
    assert (tmp_path / "2.h5").exists() and not (tmp_path / "3.h5").exists()


@pytest.mark.slow
def test_other_settings_are_refused_before_anything_runs(campaign, tmp_path):
    run_campaign(campaign("runs=1"), tmp_path / "second.h5", backend="sequential")
    jobs = [
        (campaign("runs=1"), tmp_path / "first.h5"),
        (campaign("runs=1", "clock.duration_s=60"), tmp_path / "second.h5"),
    ]
    with pytest.raises(RefusedError, match=r"other settings .*or move second.h5 and second.h5.shards aside"):
        run_campaigns(jobs)
    assert not list(tmp_path.glob("first.h5*"))
    for name in ("second.h5", "second.h5.shards"):
        (tmp_path / name).rename(tmp_path / f"old_{name}")
    run_campaigns(jobs, workers=1)
    assert (tmp_path / "first.h5").exists() and (tmp_path / "second.h5").exists()


def test_the_folder_is_held_until_the_file_is_written_and_lacking_bounds_are_told(campaign, tmp_path, monkeypatch):
    jobs = [(campaign("runs=1", f"seed={seed}"), tmp_path / f"{seed}.h5") for seed in (1, 2)]
    write, written = job.merge_pieces, []

    def refused(pieces, header, provenance, out, **options):
        with pytest.raises(RefusedError, match="another relnav is at work"), working_folder(out):
            pass
        written.append(out)
        write(pieces, header, provenance, out, **options)

    def no_memory(case, seed):
        return failed_bound(case, seed, "no room", retry=True)

    monkeypatch.setattr(job, "merge_pieces", refused)
    monkeypatch.setattr(several, "Pool", lambda *options: Pool(backend="sequential"))
    bounds = []
    monkeypatch.setattr(compute, "bound_surviving", lambda case, seed, _: bounds.append(seed) or no_memory(case, seed))
    said = []
    run_campaigns(jobs, say=said.append)
    assert sorted(written) == [out for _, out in jobs]
    assert sorted(bounds) == [1, 1, 2, 2], "each of the two cases' bounds once"
    lacks = [sentence for sentence in said if "lacks a Cramér-Rao bound: no room; the same command" in sentence]
    assert len(lacks) == 4 and all(sentence.startswith("small: ") for sentence in lacks)
