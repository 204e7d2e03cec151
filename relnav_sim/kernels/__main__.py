"""Compile all kernels for this machine, as `python -m relnav_sim.kernels`: once in an image, or before many tests.

Prints the seconds of processor time that each takes; nothing of those that are compiled already. The kernels of a
theme are compiled by the same process, which compiles once what they have in common.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import groupby
from multiprocessing import get_context

from relnav_sim.kernels import CompilerError
from relnav_sim.kernels.code_folder import code_folder, is_kept, kernel_names, not_kept, not_writable
from relnav_sim.kernels.compiling import compile_kernels


def main() -> int:
    """Compile what is not kept yet, on two processes; return the exit code."""
    if (reason := not_writable()) is not None:
        print(f"relnav: {not_kept(reason)}", file=sys.stderr)
        return 3
    try:
        importlib.import_module("relnav_sim.kernels.compiler")
    except CompilerError as error:
        print(f"relnav: {error}", file=sys.stderr)
        return 3
    names = [name for name in kernel_names() if not is_kept(name)]
    themes = [list(theme) for _, theme in groupby(names, lambda name: name.partition(".")[0])]
    themes.sort(key=len, reverse=True)  # so that no process is left with a large one at the end
    total_s = 0.0
    with ProcessPoolExecutor(min(2, os.cpu_count() or 1), get_context("spawn")) as processes:
        for theme, took in zip(themes, processes.map(compile_kernels, themes), strict=True):
            for name, took_s in zip(theme, took, strict=True):
                print(f"{took_s:6.1f} s  {name}", flush=True)
            total_s += sum(took)
    there = len(kernel_names()) - len(names)
    print(f"compiled {len(names)} kernels in {total_s:.1f} s of processor time, {there} were there: {code_folder()}")
    return 0


if __name__ == "__main__":
    argparse.ArgumentParser("python -m relnav_sim.kernels", description=__doc__).parse_args()
    sys.exit(main())
