"""The package as others install it: a wheel, outside this folder, where nothing may be written."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder of installed packages that holds the wheel's content and can't be written."""
    folder = tmp_path_factory.mktemp("packaging")
    source = folder / "source"
    shutil.copytree(ROOT / "relnav_sim", source / "relnav_sim", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel", "--no-deps", "--wheel-dir", folder, source], check=True, timeout=300)
    (wheel,) = folder.glob("relnav_sim-*.whl")
    installed = folder / "site"
    subprocess.run([*pip, "install", "--no-deps", "--target", installed, wheel], check=True, timeout=300)
    for path in sorted(installed.rglob("*"), reverse=True):
        path.chmod(0o555 if path.is_dir() else 0o444)
    return installed


@pytest.mark.slow
def test_the_wheel_runs_a_campaign_from_any_folder(site, tmp_path):
    environment = os.environ | {"PYTHONPATH": str(site)}
    before = sorted(site.rglob("*"))

    def relnav(*arguments):
        command = [sys.executable, "-B", "-m", "relnav_sim", *arguments]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr
        return done.stdout

    where = [sys.executable, "-c", "import relnav_sim; print(relnav_sim.__file__)"]
    assert str(site) in subprocess.run(where, cwd=tmp_path, env=environment, capture_output=True, text=True).stdout
    listed = [line.split()[0] for line in relnav("list", "templates").splitlines() if not line.startswith(" ")]
    assert {"demo", "geo", "vbar-hold"} < set(listed)
    for name in listed:
        relnav("new", f"{name}.yaml", "--from", name)
        relnav("validate", f"{name}.yaml")
    relnav("run", "demo.yaml", "--runs", "2")
    page = relnav("report").splitlines()[0].removeprefix("wrote ")  # the decision follows
    assert (tmp_path / page).read_text(encoding="utf-8").startswith("<!doctype html>")
    assert sorted(site.rglob("*")) == before
