"""Ctrl-C and SIGTERM end a campaign promptly, in one sentence, with nothing left behind."""

import os
import signal
import time

import pytest
from relnav_process import members, wait_until
from small_campaign import assert_same_bits

from relnav_sim import load_campaign, run_campaign

LONG = (("runs: 6", "runs: 8"), ("duration_s: 40", "duration_s: 4000"))


@pytest.mark.parametrize(
    "number, to_all, code, options",
    [
        (signal.SIGINT, True, 130, ("--workers", "1", "--set", "bound=false")),
        pytest.param(signal.SIGTERM, False, 143, ("--backend", "sequential"), marks=pytest.mark.slow),
        pytest.param(signal.SIGINT, True, 130, (), marks=pytest.mark.slow),
        pytest.param(signal.SIGTERM, True, 143, (), marks=pytest.mark.slow),
    ],
)
def test_ends_within_two_seconds_and_says_how_to_resume(relnav, number, to_all, code, options):
    here = relnav(*LONG)
    process = here.start("run", "small.yaml", *options)
    assert wait_until(lambda: list(here.shards.glob("*.busy")) or process.poll() is not None)
    time.sleep(0.3)
    (os.killpg if to_all else os.kill)(process.pid, number)
    begin = time.monotonic()
    _, stderr = process.communicate(timeout=20)
    assert time.monotonic() - begin < 2
    assert process.returncode == code
    command = " ".join(["relnav run small.yaml", *options])
    assert stderr.splitlines()[-1] == f"relnav: interrupted; what is finished is kept, and this continues it: {command}"
    assert "Traceback" not in stderr and "Warning" not in stderr
    assert wait_until(lambda: not members(process.pid), 3), members(process.pid)
    assert not list(here.out.parent.rglob(".*"))
    assert not here.out.exists()


@pytest.mark.slow
def test_goes_on_where_it_stopped(relnav):
    small = (("runs: 6", "runs: 8"), ("block_runs: 4", "block_runs: 1"), ("duration_s: 40", "duration_s: 100"))
    whole, here = relnav(*small, folder="whole"), relnav(*small)
    run_campaign(load_campaign(whole.folder / "small.yaml"), whole.out, backend="sequential")
    process = here.start("run", "small.yaml", "--backend", "sequential")
    assert wait_until(lambda: len(list(here.shards.glob("*.h5"))) >= 3 or process.poll() is not None)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=20)
    assert process.returncode == 130
    done = len(list(here.shards.glob("*.h5")))
    code, _, stderr = here.run("run", "small.yaml", "--backend", "sequential")
    assert code == 0
    assert f"{done} finished blocks found; {16 - done} left to compute" in stderr
    assert f"{16 - done} of {16 - done} runs done" in stderr
    assert_same_bits(whole.out, here.out)


@pytest.mark.slow
def test_a_second_relnav_on_the_same_result_is_refused(relnav):
    here = relnav(*LONG)
    process = here.start("run", "small.yaml")
    assert wait_until(lambda: list(here.shards.glob("*.busy")) or process.poll() is not None)
    code, _, stderr = here.run("run", "small.yaml", "--fresh")
    assert code == 2
    assert stderr.strip() == (
        "relnav: another relnav is at work on results/small.h5; wait for its end, or give another --out"
    )
    assert process.poll() is None and here.shards.exists()
