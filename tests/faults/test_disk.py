"""A disk that is full or can't be written ends a campaign with a sentence and exit code 3; nothing finished is lost."""

import resource
import shutil
import subprocess
from pathlib import Path

import pytest
from relnav_process import RELNAV, Relnav
from small_campaign import assert_same_bits
from typer.testing import CliRunner

from relnav_sim import load_campaign, run_campaign
from relnav_sim.cli.app import app

SEQUENTIAL = ("run", "small.yaml", "--backend", "sequential", "--set", "bound=false")


def run_with_largest_file(relnav, size, *arguments):
    """Run with a limit on the size of files, which fails as a full disk does, in the middle of a write."""
    done = subprocess.run(
        [*RELNAV, *arguments],
        cwd=relnav.folder,
        env=relnav.environment,
        capture_output=True,
        text=True,
        timeout=120,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
    )
    return done.returncode, done.stderr


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    """The folder `results` of the whole campaign."""
    here = Relnav(tmp_path_factory.mktemp("computed"))
    run_campaign(load_campaign(here.folder / "small.yaml", ["bound=false"]), here.out, backend="sequential")
    return here.out.parent


@pytest.fixture
def reference(relnav, computed):
    whole = relnav(folder="whole")
    shutil.copytree(computed, whole.out.parent)
    return whole


@pytest.mark.parametrize("options", [(), pytest.param(("--workers", "2", "--backend", "loky"), marks=pytest.mark.slow)])
def test_a_full_disk(relnav, reference, options):
    here = relnav()
    shard = max(path.stat().st_size for path in reference.shards.glob("*.h5"))
    result = reference.out.stat().st_size
    assert 1000 < shard < result
    early = (500, 20_000, shard - 100) if options else ()
    for size in (*early, (shard + result) // 2):
        code, stderr = run_with_largest_file(here, size, *SEQUENTIAL, *options)
        assert code == 3, stderr
        assert "Traceback" not in stderr
        assert [line for line in stderr.splitlines() if line.startswith("relnav: ")] == stderr.splitlines()[-1:]
        assert stderr.rstrip().endswith(": File too large")
        assert not here.out.exists() and not list(here.out.parent.rglob("*.tmp"))
    assert len(list(here.shards.glob("*.h5"))) == 4, "every block was finished; only the result did not fit"
    run_campaign(load_campaign(here.folder / "small.yaml", ["bound=false"]), here.out, backend="sequential")
    assert_same_bits(reference.out, here.out)


@pytest.mark.slow
def test_a_finished_result_stays_when_its_extension_does_not_fit(relnav, reference):
    before = reference.out.read_bytes()
    code, stderr = run_with_largest_file(reference, len(before) - 100, *SEQUENTIAL, "--runs", "8")
    assert code == 3, stderr
    assert reference.out.read_bytes() == before
    assert reference.run(*SEQUENTIAL, "--runs", "8")[0] == 0


def test_a_target_that_cannot_be_written(relnav, monkeypatch):
    here = relnav()
    monkeypatch.chdir(here.folder)
    (here.folder / "file").write_text("in the way")
    read_only = next((str(path) for path in (Path("/proc"), Path("/sys")) if path.is_dir()), "file")
    for target, word in (("file/out.h5", "Not a directory"), (f"{read_only}/out.h5", f"{read_only}/out.h5.shards")):
        done = CliRunner().invoke(app, [*SEQUENTIAL, "--out", target])
        assert done.exit_code == 3
        assert done.stdout == "" and done.stderr.startswith("relnav: ") and done.stderr.count("\n") == 1
        assert word in done.stderr
