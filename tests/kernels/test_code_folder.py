"""The folder of compiled code, with a package of its own whose two kernels are compiled in a moment."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import relnav_sim
from relnav_sim.kernels import code_folder

PACKAGE = Path(relnav_sim.__file__).parent
MACHINERY = ("__init__.py", "__main__.py", "code_folder.py", "compiler.py", "compiling.py")
FACTOR = """
from relnav_sim.kernels.compiling import inner

@inner
def times(x):
    return 2.0 * x
"""
DOUBLING = """
from relnav_sim.kernels.compiling import kernel, number
from relnav_sim.kernels.factor import times

@kernel(number)
def double(x: float) -> float:
    return times(x)

@kernel(number)
def fourfold(x: float) -> float:
    return times(times(x))
"""
OTHERS = """
from relnav_sim.kernels.compiling import kernel, number

@kernel(number)
def enlarged(x: float) -> float:
    return FACTOR * x
"""
DOUBLES = """
import json
from relnav_sim import kernels
value = kernels.doubling.double(3.0)
print(json.dumps([value, sum(kernels.doubling.double.stats.cache_misses.values())]))
"""


class Copy:
    """A copy of the machinery with small kernels, run in processes of its own."""

    def __init__(self, place: Path) -> None:
        self.kernels = place / "relnav_sim" / "kernels"
        self.kernels.mkdir(parents=True)
        for name in ("__init__.py", "arrays.py", "conventions.py"):
            shutil.copy(PACKAGE / name, self.kernels.parent / name)
        for name in MACHINERY:
            shutil.copy(PACKAGE / "kernels" / name, self.kernels / name)
        self.write(FACTOR)
        (self.kernels / "doubling.py").write_text(DOUBLING)
        self.caches = place / "caches"
        self.environment = {
            **os.environ, "PYTHONPATH": str(place), "RELNAV_CACHE_DIR": str(self.caches), "PYTHONDONTWRITEBYTECODE": "1"
        }  # fmt: skip

    def write(self, factor: str) -> None:
        (self.kernels / "factor.py").write_text(factor)

    def start(self, *program: str, **environment: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, *program],
            cwd=self.kernels.parents[1],
            env={**self.environment, **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, *program: str, **environment: str) -> tuple[int, str, str]:
        process = self.start(*program, **environment)
        stdout, stderr = process.communicate(timeout=120)
        return process.returncode, stdout, stderr

    def doubles(self, before: str = "", **environment: str) -> tuple[float, int]:
        """Return what 3 doubled is in a new process, and how often that process compiled it; it says nothing."""
        code, stdout, stderr = self.run("-c", before + DOUBLES, **environment)
        assert (code, stderr) == (0, "")
        value, compiled = json.loads(stdout)
        return value, compiled

    @property
    def code(self) -> Path:
        (found,) = self.caches.glob("kernels/*/doubling.double.code")
        return found


@pytest.fixture
def copy(tmp_path):
    return Copy(tmp_path)


@pytest.mark.slow
def test_what_is_compiled_is_kept(copy):
    assert copy.doubles() == (6.0, 1)
    assert copy.doubles() == (6.0, 0)


def test_a_changed_function_of_another_file_is_noticed(copy):
    assert copy.doubles() == (6.0, 1)
    copy.write(FACTOR.replace("2.0", "2.5"))
    assert copy.doubles() == (7.5, 1)
    assert copy.doubles() == (7.5, 0)
    copy.write(FACTOR)
    assert copy.doubles() == (6.0, 0)


@pytest.mark.slow
def test_a_changed_kernel_of_another_package_is_noticed(copy):
    """Its source is no part of the folder's name."""
    module = copy.kernels.parents[1] / "others.py"
    program = "import others\nprint(others.enlarged(3.0), sum(others.enlarged.stats.cache_misses.values()))"
    for factor, said in (("4.0", "12.0 1"), ("5.0", "15.0 1"), ("4.0", "12.0 0")):
        module.write_text(OTHERS.replace("FACTOR", factor))
        code, stdout, stderr = copy.run("-c", program)
        assert (code, stdout.strip()) == (0, said), stderr


@pytest.mark.slow
def test_code_for_another_processor_is_not_used(copy):
    one_folder = "from relnav_sim.kernels import code_folder\ncode_folder.digest = lambda: 'same'\n"
    assert copy.doubles(one_folder, NUMBA_CPU_NAME="generic") == (6.0, 1)
    assert copy.doubles(one_folder) == (6.0, 1)
    assert copy.doubles(one_folder) == (6.0, 0)
    assert copy.doubles(NUMBA_CPU_NAME="generic") == (6.0, 1)  # by itself it has a folder of its own
    assert len(list(copy.caches.glob("kernels/*"))) == 2


def damaged(code: bytes) -> list[bytes]:
    half = len(code) // 2
    sound = code_folder.hashlib.sha256(b"no code").digest() + b"no code"
    return [b"", code[:20], code[:half], code[:half] + bytes(len(code) - half), code[:-1] + b"?", sound]


@pytest.mark.slow
def test_a_damaged_file_is_compiled_anew(copy):
    assert copy.doubles() == (6.0, 1)
    for content in damaged(copy.code.read_bytes()):
        copy.code.write_bytes(content)
        assert copy.doubles() == (6.0, 1)
    assert copy.doubles() == (6.0, 0)


@pytest.mark.slow
def test_several_processes_at_once_compile_once_and_hinder_nobody(copy):
    processes = [copy.start("-c", DOUBLES) for _ in range(3)]
    answers = [process.communicate(timeout=120) for process in processes]
    assert all(stderr == "" for _, stderr in answers)
    values, compiled = zip(*(json.loads(stdout) for stdout, _ in answers), strict=True)
    assert values == (6.0,) * 3 and sum(compiled) == 1


def test_a_process_killed_while_it_compiles_hinders_nobody(copy):
    holds = (
        "import time\nfrom relnav_sim.kernels.code_folder import alone\n"
        "with alone('doubling.double'):\n    print('held', flush=True)\n    time.sleep(60)\n"
    )
    process = copy.start("-c", holds)
    assert process.stdout is not None and process.stdout.readline() == "held\n"
    process.kill()
    process.communicate()
    assert copy.doubles() == (6.0, 1)


TWICE = """
from relnav_sim import kernels
print(kernels.doubling.double(3.0), kernels.doubling.fourfold(3.0))
"""
FULL = """
import errno, os, pathlib
def full(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
pathlib.Path.write_bytes = full
"""


@pytest.mark.parametrize(
    "before, folder, reason",
    [
        pytest.param("", "/dev/null/here", "Not a directory", id="no folder"),
        pytest.param("", "/proc/here", "No such file or directory", id="not writable", marks=pytest.mark.slow),
        pytest.param(FULL, None, "No space left on device", id="full", marks=pytest.mark.slow),
    ],
)
def test_without_a_folder_kernels_work_and_it_is_said_once(copy, before, folder, reason):
    environment = {} if folder is None else {"RELNAV_CACHE_DIR": folder}
    code, stdout, stderr = copy.run("-c", before + TWICE, **environment)
    assert (code, stdout) == (0, "6.0 12.0\n"), stderr
    (line,) = [line for line in stderr.splitlines() if "UserWarning" in line]
    assert f"({reason}), so that every process compiles" in line and "RELNAV_CACHE_DIR" in line
    assert str(folder or copy.caches) in line


@pytest.mark.slow
def test_a_program_that_makes_errors_of_warnings_goes_on(copy):
    assert copy.run("-Werror", "-c", TWICE, RELNAV_CACHE_DIR="/dev/null/here") == (0, "6.0 12.0\n", "")


def test_a_folder_that_can_only_be_read_is_read(copy):
    assert copy.doubles() == (6.0, 1)
    read_only = (
        "import errno, os\nfrom relnav_sim.kernels import code_folder\n"
        "def refused(*_):\n    raise OSError(errno.EROFS, os.strerror(errno.EROFS))\n"
        "code_folder._make_folder = code_folder.os.replace = refused\n"
    )
    assert copy.doubles(read_only) == (6.0, 0)


@pytest.mark.slow
def test_numba_of_the_user_is_left_as_it_is(copy):
    program = (
        "import os\nfrom relnav_sim import kernels\nkernels.doubling.double(3.0)\nimport numba\n"
        "print(numba.config.CACHE_DIR, os.environ.get('NUMBA_DISABLE_INTEL_SVML'), numba.config.USING_SVML)\n"
    )
    assert copy.run("-c", program, NUMBA_CACHE_DIR="/mine") == (0, "/mine None False\n", "")
    assert copy.run("-c", program, NUMBA_DISABLE_INTEL_SVML="0", NUMBA_CACHE_DIR="x") == (0, "x 0 False\n", "")


@pytest.mark.slow
def test_a_numba_that_is_not_known_compiles_in_its_own_way(copy):
    program = (
        "from relnav_sim.kernels import compiler\ncompiler.LATEST_KNOWN = (0, 1)\n"
        "from relnav_sim import kernels\nprint(kernels.doubling.fourfold(3.0))"
    )
    assert copy.run("-c", program) == copy.run("-c", program) == (0, "12.0\n", "")


def test_without_a_compiler_kernels_are_plain_python(copy):
    program = "from relnav_sim import kernels\nprint(kernels.doubling.fourfold(3.0))"
    assert copy.run("-c", program, NUMBA_DISABLE_JIT="1") == (0, "12.0\n", "")
    assert not copy.caches.exists()


def test_a_numba_that_can_not_be_imported_is_a_sentence(copy):
    program = (
        "import sys\nsys.modules['numba'] = None\nfrom relnav_sim import kernels\n"
        "try: kernels.doubling.double(3.0)\nexcept kernels.CompilerError as error: print(error)"
    )
    code, stdout, _ = copy.run("-c", program)
    assert code == 0 and stdout.startswith("relnav needs numba, which can't be imported: ") and stdout.count("\n") == 1


@pytest.mark.slow
def test_all_kernels_are_compiled_by_a_command(copy):
    code, stdout, stderr = copy.run("-m", "relnav_sim.kernels")
    assert (code, stderr) == (0, "")
    assert [line.split()[-1] for line in stdout.splitlines()[:2]] == ["doubling.double", "doubling.fourfold"]
    assert copy.doubles() == (6.0, 0)
    assert copy.run("-m", "relnav_sim.kernels")[1].startswith("compiled 0 kernels in 0.0 s of processor time, 2 were ")
    code, stdout, stderr = copy.run("-m", "relnav_sim.kernels", RELNAV_CACHE_DIR="/dev/null/here")
    assert (code, stdout) == (3, "") and stderr.startswith("relnav: compiled code can't be kept in /dev/null/here")


def test_old_folders_go_and_those_in_use_stay(tmp_path):
    for age_h in range(2, 14):
        (tmp_path / f"{age_h}").mkdir()
        (tmp_path / f"{age_h}" / "used").touch()
        then = code_folder.time.time() - 3600 * age_h
        os.utime(tmp_path / f"{age_h}" / "used", (then, then))
    for name in ("mine", *(f"lately {n}" for n in range(3)), "never used"):
        (tmp_path / name).mkdir()
        if name != "never used":
            (tmp_path / name / "used").touch()
    code_folder._remove_old(tmp_path / "mine")
    stay = {"mine", *(f"lately {n}" for n in range(3)), *map(str, range(2, 2 + code_folder.KEPT - 3))}
    assert {path.name for path in tmp_path.iterdir()} == stay


@pytest.mark.parametrize(
    "environment, place",
    [
        ({"HOME": "/home/me"}, "/home/me/.cache/relnav"),
        ({"HOME": "/home/me", "XDG_CACHE_HOME": "/caches"}, "/caches/relnav"),
        ({"HOME": "/home/me", "XDG_CACHE_HOME": "not/absolute"}, "/home/me/.cache/relnav"),
        ({"HOME": "/home/me", "XDG_CACHE_HOME": "/caches", "RELNAV_CACHE_DIR": "/mine"}, "/mine"),
    ],
)
def test_where_the_folder_is(monkeypatch, environment, place):
    for name in ("HOME", "XDG_CACHE_HOME", "RELNAV_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    code_folder.code_folder.cache_clear()
    assert code_folder.code_folder() == Path(place, "kernels", code_folder.digest())
    monkeypatch.undo()
    code_folder.code_folder.cache_clear()


def test_the_sources_name_all_kernels():
    from relnav_sim.kernels.compiling import Uncompiled

    themes = [path.stem for path in (PACKAGE / "kernels").glob("*.py") if not path.stem.startswith("__")]
    found = []
    for theme in themes:
        for name, value in vars(import_module(f"relnav_sim.kernels.{theme}")).items():
            kept = getattr(getattr(value, "_cache", None), "_name", None)
            if isinstance(value, Uncompiled) or kept == f"{theme}.{name}":
                found.append(f"{theme}.{name}")
    assert sorted(found) == sorted(code_folder.kernel_names())
