"""Worker processes start whatever lies in the working folder; where they can't, the command ends with a sentence."""

import subprocess
import sys

import pytest
from relnav_process import RELNAV
from small_campaign import assert_same_bits

from relnav_sim import load_campaign, open_results, run_campaign

SMALL = ("--runs", "2", "--set", "bound=false")
SCRIPT = [sys.executable, "-P", *RELNAV[1:]]
MODULE = [sys.executable, "-m", "relnav_sim"]


@pytest.mark.parametrize(
    "command",
    [pytest.param(SCRIPT, id="relnav", marks=pytest.mark.slow), pytest.param(MODULE, id="python -m relnav_sim")],
)
@pytest.mark.slow
def test_modules_of_the_working_folder_are_the_users(relnav, tmp_path, command):
    plain, here = relnav(folder="plain"), relnav()
    run_campaign(load_campaign(plain.folder / "small.yaml", ["runs=2", "bound=false"]), plain.out, backend="sequential")
    for name in ("random", "signal", "numpy", "copy", "re", "enum", "json", "joblib", "scipy", "queue", "socket"):
        (here.folder / f"{name}.py").write_text('print("my script")\n')
    done = subprocess.run(
        [*command, "run", "small.yaml", *SMALL], cwd=here.folder, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert "my script" not in done.stdout + done.stderr
    assert_same_bits(plain.out, here.out)


DIES = "import os; os.write(2, b'no, not here'); os._exit(7)"
LACKS = "sys.modules['scipy'] = None"


@pytest.mark.parametrize(
    "cause, said",
    [
        pytest.param(DIES, "it ends as soon as it begins", id="dies"),
        pytest.param(LACKS, "ModuleNotFoundError", id="lacks", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("count", [1, pytest.param(2, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_workers_that_can_not_start_are_tried_twice(relnav, tmp_path, cause, said, count):
    here = relnav(environment={"PYTHONPATH": str(tmp_path / "site")})
    assert here.run("run", "small.yaml", "--backend", "sequential", "--runs", "1")[0] == 0
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text(
        "import sys\n"
        "if any('popen_loky' in word for word in sys.orig_argv):\n"
        f"    open({str(tmp_path / 'starts')!r}, 'a').write('.')\n"
        f"    {cause}\n"
    )
    code, _, stderr = here.run("run", "small.yaml", "--workers", str(count))
    assert code == 3, stderr
    assert "relnav: no worker process could be started; what is finished is kept" in stderr and said in stderr
    assert (tmp_path / "starts").read_text() in ("." * n for n in range(2, 2 * count + 1))
    if cause == DIES:
        assert "no, not here" in stderr
    (tmp_path / "site" / "sitecustomize.py").unlink()
    code, _, stderr = here.run("run", "small.yaml", "--workers", str(count))
    assert code == 0 and "2 finished blocks found; " in stderr, stderr
    with open_results(here.out) as results:
        assert not results.missing() and not results.failures()


@pytest.mark.parametrize("kilobytes", [150_000, pytest.param(300_000, marks=pytest.mark.slow)])
def test_a_limit_of_memory_that_is_too_low_is_a_sentence(relnav, kilobytes):
    here = relnav()
    done = subprocess.run(
        ["bash", "-c", f'ulimit -v {kilobytes} && exec "$@"', "-", *SCRIPT, "run", "small.yaml"],
        cwd=here.folder, env=here.environment, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 3
    assert done.stderr.startswith("relnav: the limit of virtual memory") and done.stderr.count("\n") == 1
