"""The program `relnav`, also `python -m relnav_sim`: as little as can be imported before Ctrl-C is taken care of."""

from __future__ import annotations

import sys

if __name__ == "__main__" and not sys.flags.safe_path:
    # `python -m` looks into the working folder first, where a random.py is the user's own; now it does so last.
    sys.path.append(sys.path.pop(0))

import os
import signal
import threading
from types import FrameType
from typing import NoReturn

from relnav_sim.standard_streams import make_patient, say_last

LONGEST_END_S = 2.0
"""After this the process ends whatever is still at work in it: threads that a filter of the user's has left, say."""


def main() -> None:
    """Run the command line."""
    make_patient()
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _end_at_once)  # except within a command, see cli.failures
    try:
        from relnav_sim.cli.app import main as run

        run()
    except SystemExit as leaving:
        _leave(leaving.code if isinstance(leaving.code, int) else 0)
    except Exception as error:
        from relnav_sim.fault_report import tell_fault

        _leave(tell_fault(error))


def _leave(code: int) -> NoReturn:
    sys.stdout.flush()
    sys.stderr.flush()
    last = threading.Timer(LONGEST_END_S, os._exit, (code,))
    last.daemon = True
    last.start()
    sys.exit(code)


def _end_at_once(number: int, frame: FrameType | None) -> None:
    """End while the program is imported, reads its arguments or leaves: there is nothing to lose."""
    say_last("relnav: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    sys.argv[0] = "relnav"  # the name in help, and in the commands that are told to the user
    main()
