"""Example packages as if installed by `pip install -e`: importable modules and metadata, which alone point to them."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]


def distribution(folder, name, version, entries, group="relnav.filters"):
    """Put what pip leaves of a package beside its modules: its metadata and entry points."""
    info = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    lines = [f"{entry} = {module}\n" for entry, module in entries.items()]
    (info / "entry_points.txt").write_text("".join([f"[{group}]\n", *lines]))


def example(kind, group):
    """Return the folder of an example, its project table, and the name and module of its one entry point."""
    folder = ROOT / "examples" / kind
    project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    [(name, module)] = project["entry-points"][group].items()
    return folder, project, name, module


def python(paths, *arguments, cwd=ROOT):
    """Run a fresh interpreter with `paths` importable, as installed packages are."""
    search = [*map(str, paths), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(search), "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.run(
        [sys.executable, *arguments], cwd=cwd, env=environment, capture_output=True, text=True, timeout=300
    )
