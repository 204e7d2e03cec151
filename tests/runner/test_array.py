"""A campaign as a job array: parts by element, some killed and started again, merged to the bits of one machine."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from small_campaign import TEXT, assert_same_bits

from relnav_sim import run_campaign
from relnav_sim.cli.failures import UserError
from relnav_sim.cli.part import part_of
from relnav_sim.runner.job import Job
from relnav_sim.runner.merging import merge_results

SCRIPT = Path(__file__).parents[2] / "examples" / "slurm" / "campaign.sbatch"


def variables(task: int, first: int, last: int, step: int = 1) -> dict[str, str]:
    """Return what SLURM sets for an element of ``--array=first-last:step``."""
    count = len(range(first, last + 1, step))
    numbers = {"ID": task, "MIN": first, "MAX": last, "STEP": step, "COUNT": count}
    return {f"SLURM_ARRAY_TASK_{name}": str(number) for name, number in numbers.items()}


@pytest.mark.parametrize(("first", "last", "step"), [(1, 20, 1), (0, 19, 1), (0, 9, 3), (7, 7, 1)])
def test_elements_are_the_parts(first, last, step):
    tasks = range(first, last + 1, step)
    parts = [part_of("slurm", variables(task, first, last, step)) for task in tasks]
    assert parts == [(i + 1, len(tasks)) for i in range(len(tasks))]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"ID": None}, "no SLURM_ARRAY_TASK_ID here; submit it with sbatch --array"),
        ({"COUNT": None}, "SLURM_ARRAY_TASK_COUNT is not set"),
        ({"MAX": "x"}, "SLURM_ARRAY_TASK_MAX is 'x', which is no number"),
        ({"COUNT": "2"}, "from 1 to 4 in steps of 1 has 4 elements, but SLURM_ARRAY_TASK_COUNT is 2"),
        ({"STEP": "0"}, "has 0 elements"),
        ({"ID": "9"}, "SLURM_ARRAY_TASK_ID is 9, which is none of the elements from 1 to 4"),
    ],
)
def test_variables_that_do_not_fit_are_refused(change, words):
    environment = variables(3, 1, 4)
    for name, value in change.items():
        environment.pop(f"SLURM_ARRAY_TASK_{name}")
        environment |= {} if value is None else {f"SLURM_ARRAY_TASK_{name}": value}
    with pytest.raises(UserError, match=words):
        part_of("slurm", environment)


def test_an_element_off_the_steps_is_refused():
    with pytest.raises(UserError, match="which is none of the elements from 0 to 8 in steps of 4"):
        part_of("slurm", variables(3, 0, 8, 4))


def test_an_array_of_four_with_one_interrupted_and_one_twice(campaign, tmp_path, monkeypatch):
    ours = campaign("block_runs=1", "runs=4", "bound=false")
    whole = run_campaign(ours, tmp_path / "whole.h5", backend="sequential")

    def element(task: int, name: str = "") -> Path:
        part = part_of("slurm", variables(task, 0, 3))
        return run_campaign(ours, tmp_path / f"{name or task}.h5", backend="sequential", part=part)

    accept, accepted = Job.accept, []

    def interrupted(job, done):
        accept(job, done)
        accepted.append(done)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Job, "accept", interrupted)
        with pytest.raises(KeyboardInterrupt):
            element(2)
    assert len(accepted) == 1 and not (tmp_path / "2.h5").exists()
    parts = [*map(element, range(4)), element(1, "once_more")]
    assert_same_bits(whole, merge_results(tmp_path / "merged.h5", parts))


LONGER = ["duration_s: 40", "duration_s: 600"], ["runs: 6", "runs: 40"], ["block_runs: 4", "block_runs: 1"]
ELEMENTS = 20


@pytest.fixture
def played(tmp_path):
    """Return a player of the script: starts one element as SLURM would, in a process group of its own."""
    text = TEXT
    for old, new in LONGER:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "small.yaml").write_text(text)
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "scontrol").write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/requeued\n')
    (tools / "scontrol").chmod(0o755)

    def start(task: int, folder: str = "results") -> subprocess.Popen[bytes]:
        environment = {
            **os.environ,
            **variables(task, 1, ELEMENTS),
            "SLURM_ARRAY_JOB_ID": "4711",
            "SLURM_CPUS_PER_TASK": "1",
            "PATH": os.pathsep.join([str(tools), str(Path(sys.executable).parent), os.environ["PATH"]]),
        }
        command = ["bash", SCRIPT, "small.yaml", folder]
        return subprocess.Popen(
            command, cwd=tmp_path, env=environment, stderr=subprocess.DEVNULL, start_new_session=True
        )

    return start


def part_file(folder: Path, task: int) -> Path:
    return folder / f"small.part_{task}_of_{ELEMENTS}.h5"


def wait_for_a_shard(result: Path, process: subprocess.Popen[bytes]) -> None:
    shards = result.with_name(f"{result.name}.shards")
    while not list(shards.glob("*.h5")):
        assert process.poll() is None, "it ended before it was killed"
        time.sleep(0.005)


@pytest.mark.slow
def test_an_array_of_twenty_with_two_killed_one_out_of_time_and_two_twice(played, tmp_path):
    results = tmp_path / "results"
    for task, number in ((5, signal.SIGKILL), (11, signal.SIGKILL), (17, signal.SIGUSR1)):
        process = played(task)
        wait_for_a_shard(part_file(results, task), process)
        if number is signal.SIGKILL:
            os.killpg(process.pid, number)  # a node that goes down takes the script and relnav with it
        else:
            os.kill(process.pid, number)  # --signal=B: the script alone
        process.wait(300)
        assert not part_file(results, task).exists(), "it was ended in the middle"
    assert (tmp_path / "requeued").read_text() == "requeue 4711_17\n"
    elements = [(task, "results") for task in range(1, ELEMENTS + 1)] + [(task, "twice") for task in (3, 4)]
    with ThreadPoolExecutor(2) as two:
        assert set(two.map(lambda element: played(*element).wait(300), elements)) == {0}
    parts = [*results.glob("*.h5"), *(part_file(tmp_path / "twice", task) for task in (3, 4))]
    assert len(parts) == ELEMENTS + 2
    relnav = Path(sys.executable).parent / "relnav"
    subprocess.run([relnav, "run", "small.yaml", "--out", "whole.h5"], cwd=tmp_path, check=True)
    subprocess.run([relnav, "merge", "merged.h5", *parts], cwd=tmp_path, check=True)
    assert_same_bits(tmp_path / "whole.h5", tmp_path / "merged.h5")
    command = [relnav, "status", *results.glob("*.h5")]
    states = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert states.returncode == 0 and states.stdout.count("finished") == ELEMENTS
