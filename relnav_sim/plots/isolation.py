"""Matplotlib as it comes, whatever the user's backend, matplotlibrc and settings say; and theirs left as they were."""

from __future__ import annotations

import logging
import os
import sys
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, cast

_BACKEND = "MPLBACKEND"
_FILE = "MATPLOTLIBRC"


@contextmanager
def isolated(settings: Mapping[str, Any]) -> Iterator[None]:
    """Draw and save with Matplotlib's own defaults and these settings, without a word of its to the terminal.

    Where it is entered already, the settings are laid over the ones in force, if they are others.

    Args:
        settings: Matplotlib's ``rcParams`` that differ from its defaults.
    """
    global _depth, _in_force
    if _depth and settings == _in_force:
        yield
        return
    with _quiet():
        _import_matplotlib()
        from matplotlib import rc_context, rcParamsDefault

        # The backend is left out: setting one may load a window system, and figures have their canvas.
        own = {} if _depth else {name: rcParamsDefault[name] for name in rcParamsDefault if name not in _BACKENDS}
        with rc_context(cast(Any, {**own, **settings})):  # newer stubs list every key
            before, _in_force = _in_force, settings
            _depth += 1
            try:
                yield
            finally:
                _depth -= 1
                _in_force = before


_BACKENDS = ("backend", "backend_fallback")
_in_force: Mapping[str, Any] = {}  # the settings of the innermost `isolated`
_depth = 0  # how many `isolated` are open: rcParams are one for the process as well


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep what Matplotlib warns of to itself: fonts without a sign, its folder of settings, its font cache."""
    logger = logging.getLogger("matplotlib")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            # Its warnings appear to come from the caller's lines. NumPy's are of another kind: those are our mistakes.
            warnings.simplefilter("ignore", UserWarning)
            warnings.simplefilter("ignore", DeprecationWarning)
            warnings.filterwarnings("ignore", module=r"matplotlib\.|mpl_toolkits\.")
            yield
    finally:
        logger.setLevel(level)


def _import_matplotlib() -> None:
    """Import Matplotlib also where MPLBACKEND names a backend that is not there, or its settings file can't be read.

    The backend of a notebook, ``module://matplotlib_inline.backend_inline``, is unknown in another environment.
    """
    if "matplotlib" in sys.modules:
        return
    backend = os.environ.pop(_BACKEND, None)
    try:
        try:
            import matplotlib
        except Exception:  # whatever it makes of the file
            for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"]:
                del sys.modules[name]
            file = os.environ.get(_FILE)
            os.environ[_FILE] = os.devnull
            try:
                import matplotlib
            finally:
                _restore(_FILE, file)
    finally:
        _restore(_BACKEND, backend)
    if backend:
        try:
            matplotlib.rcParams["backend"] = backend
        except ValueError:
            return  # a window is never opened here; pyplot says so to whoever wants one


def _restore(name: str, value: str | None) -> None:
    if value is None:
        os.environ.pop(name, None)
    else:
        os.environ[name] = value
