"""The program `relnav`, also `python -m relnav_sim`: as little as can be imported before Ctrl-C is taken care of."""

from __future__ import annotations

import sys

if __name__ == "__main__" and not sys.flags.safe_path:
    # `python -m` looks into the working folder first, where a random.py is the user's own; now it does so last.
    sys.path.append(sys.path.pop(0))

import os
import signal
from types import FrameType


def main() -> None:
    """Run the command line."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _end_at_once)  # except within a command, see cli.failures
    from relnav_sim.cli.app import main as run

    run()


def _end_at_once(number: int, frame: FrameType | None) -> None:
    """End while the program is imported, reads its arguments or leaves: there is nothing to lose."""
    os.write(2, b"relnav: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    sys.argv[0] = "relnav"  # the name in help, and in the commands that are told to the user
    main()
