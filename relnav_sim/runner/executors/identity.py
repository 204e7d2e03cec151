"""What must be the same on every machine that computes a campaign, so that its numbers are."""

from __future__ import annotations

import hashlib
import platform
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, entry_points, version
from pathlib import Path

from relnav_sim import __version__
from relnav_sim.results.provenance import processor, relnav_in_words

PACKAGES = ("numpy", "scipy", "numba", "scikit-learn", "pyerfa", "sgp4")
GROUPS = ("relnav.dynamics", "relnav.filters", "relnav.sensors")
_SOURCE, _COMMIT = "source", "commit"


@cache
def identity() -> dict[str, str]:
    """Return what this process would compute with, by name: versions, relnav's own source, and plug-ins."""
    return {
        "Python": f"{sys.version_info.major}.{sys.version_info.minor}",
        "relnav": __version__,
        _COMMIT: relnav_in_words().removeprefix(__version__).strip(),
        _SOURCE: _source(),
        **{name: _version(name) for name in PACKAGES},
        "plug-ins": ", ".join(_plugins()) or "none",
    }


def differences(there: dict[str, str], here: dict[str, str]) -> str:
    """Return in words what is different on another machine; empty: nothing.

    A commit tells nothing by itself: the same source may be installed or checked out, and a checkout may have changes.
    """
    different = [name for name in {**here, **there} if there.get(name) != here.get(name) and name != _COMMIT]
    if "relnav" in different and _SOURCE in different:
        different.remove(_SOURCE)
    return "; ".join(_in_words(name, there, here) for name in different)


def _in_words(name: str, there: dict[str, str], here: dict[str, str]) -> str:
    if name == _SOURCE:
        ours, theirs = (f"commit {one.get(_COMMIT) or 'not known'}" for one in (here, there))
        return f"relnav {there.get('relnav', '')} of another source ({theirs}) than the one here ({ours})"
    return f"{name} {there.get(name, 'none')}, not {here.get(name, 'none')}"


def machine() -> tuple[str, str]:
    """Return the name of this machine and of its processor."""
    return platform.node(), processor()


def _source() -> str:
    """Return a digest of relnav's source, which tells changes that no version and no commit tells."""
    package = Path(__file__).resolve().parents[2]
    found = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        found.update(f"{path.relative_to(package).as_posix()}\0".encode() + path.read_bytes())
    return found.hexdigest()[:12]


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"


def _plugins() -> list[str]:
    found = {
        f"{entry.name} ({entry.dist.name} {entry.dist.version})" if entry.dist else f"{entry.name} ({entry.value})"
        for group in GROUPS
        for entry in entry_points(group=group)
    }
    return sorted(found)
