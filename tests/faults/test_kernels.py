"""Kernels that are compiled before a campaign's workers start, and what may come between."""

import fcntl
import os
import shutil
import signal
import time

import pytest
from relnav_process import installed, members, wait_until
from small_campaign import assert_same_bits
from test_bad_runs import PLUGIN

from relnav_sim.kernels.code_folder import code_folder, kernel_names

LEFT_OUT = "statistics.normalised_errors"
COMPILING = "compiling the numerical kernels that are needed here and not kept yet ..."


@pytest.fixture
def caches(tmp_path):
    """Return a folder of caches with all code that this machine has but for one kernel."""
    folder = tmp_path / "caches" / "kernels" / code_folder().name
    folder.mkdir(parents=True)
    for name in kernel_names():
        if name != LEFT_OUT and (code_folder() / f"{name}.code").exists():
            shutil.copy(code_folder() / f"{name}.code", folder)
    return tmp_path / "caches"


def kept(caches):
    (folder,) = caches.glob("kernels/*")
    return {path.name: path.stat().st_mtime_ns for path in folder.glob("*.code")}


@pytest.mark.parametrize("options", [(), ("--backend", "sequential")])
@pytest.mark.slow
def test_kernels_are_compiled_once_before_the_workers_start(relnav, caches, options):
    here = relnav(environment={"RELNAV_CACHE_DIR": str(caches)})
    code, _, stderr = here.run("run", "small.yaml", *options)
    assert code == 0, stderr
    said = stderr.splitlines()
    assert said.count(COMPILING) == 1 and said[said.index(COMPILING) + 1].startswith("compiled in ")
    assert said.index(COMPILING) + 1 < min(n for n, line in enumerate(said) if "runs done" in line)
    before = kept(caches)
    assert f"{LEFT_OUT}.code" in before
    os.rename(here.out.parent, here.folder / "first")
    code, _, stderr = here.run("run", "small.yaml", *options)
    assert code == 0 and "compil" not in stderr
    assert kept(caches) == before
    assert_same_bits(here.folder / "first" / "small.h5", here.out)


@pytest.mark.slow
def test_ends_within_two_seconds_while_kernels_are_compiled(relnav, caches):
    here = relnav(environment={"RELNAV_CACHE_DIR": str(caches)})
    (folder,) = caches.glob("kernels/*")
    with open(folder / f"{LEFT_OUT}.lock", "wb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # as if another process were compiling it, for long
        process = here.start("run", "small.yaml")
        assert process.stderr is not None and process.stderr.readline() == f"{COMPILING}\n"
        time.sleep(0.5)  # interrupted while it is still writing that line, Python writes it twice
        os.killpg(process.pid, signal.SIGINT)
        begin = time.monotonic()
        _, stderr = process.communicate(timeout=20)
    assert time.monotonic() - begin < 2
    assert process.returncode == 130
    said = "interrupted; what is finished is kept, and this continues it: relnav run small.yaml"
    assert stderr == f"relnav: {said}\n"
    assert wait_until(lambda: not members(process.pid), 3), members(process.pid)
    assert not list(folder.glob("rehearsed*"))


@pytest.mark.slow
def test_a_filter_that_kills_its_process_meanwhile_does_no_harm(relnav, caches, tmp_path):
    environment = {**installed(tmp_path / "site", "bad_filters", PLUGIN), "RELNAV_CACHE_DIR": str(caches)}
    here = relnav(("kf: {kind: kf}", "killed: {kind: killed_once}"), environment=environment)
    code, _, stderr = here.run("run", "small.yaml")
    assert code == 0, stderr
    assert (here.folder / "killed").exists()


@pytest.mark.parametrize("options", [(), ("--backend", "sequential")])
@pytest.mark.slow
def test_a_numba_that_can_not_be_imported_is_a_sentence(relnav, tmp_path, options):
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text("import sys\nsys.modules['numba'] = None\n")
    here = relnav(environment={"PYTHONPATH": str(tmp_path / "site")})
    code, stdout, stderr = here.run("run", "small.yaml", *options)
    assert (code, stdout) == (3, "")
    assert stderr.splitlines()[-1].startswith("relnav: relnav needs numba, which can't be imported: ")
    assert "Traceback" not in stderr and not list(here.shards.glob("*.h5"))
