"""A worker process before its first block: where its streams lead, how it ends, and plug-ins imported under guard."""

from __future__ import annotations

import os
import warnings
from multiprocessing.util import Finalize

from relnav_sim.dynamics.registry import dynamics_kinds
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.standard_streams import open_missing


def prepare_worker() -> None:
    """Make this process a worker; call it once, before anything of a campaign is unpickled.

    Standard output is the command's own, so what a worker prints goes to standard error; it has nothing to read. It
    ends without waiting for threads that a filter may have left. Packages with plug-ins are imported here, guarded;
    unpickling a filter's options would import them as they come.
    """
    open_missing()
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    Finalize(None, os._exit, args=(0,), exitpriority=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the campaign's process has said which are left out
        dynamics_kinds()
        filter_kinds()
