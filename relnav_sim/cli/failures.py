"""What a command says and returns when it can't do its work: a sentence and an exit code, never a traceback."""

from __future__ import annotations

import errno
import functools
import os
import signal
from collections.abc import Callable
from enum import IntEnum
from typing import Any

import typer

from relnav_sim.printable import visible
from relnav_sim.standard_streams import output_error


class Exit(IntEnum):
    """Exit codes of every command."""

    SOME_RUNS_FAILED = 1
    BAD_INPUT = 2
    INPUT_OUTPUT = 3
    REQUIREMENT_MISSED = 4
    REQUIREMENT_UNDECIDED = 5
    UNFINISHED = 6
    UNEXPECTED = 70
    HUNG_UP = 129
    INTERRUPTED = 130
    TERMINATED = 143


EXIT_CODES = {
    "0": "all is well",
    "1": "some runs failed, which the report counts, or lacked memory, which the same command tries again",
    "2": "the campaign or the arguments can't be used",
    "3": "a file can't be read or written, no worker can start or the scheduler is gone, numba can't be imported, or "
    "there is too little memory",
    "4, 5": "only of relnav report --check: a requirement is missed, or undecided",
    "6": "only of relnav status, where nobody is at work, and of relnav merge --missing: the campaign is not finished",
    "70": "an error of relnav itself; please report it",
    "129, 130, 143": "ended by a closed terminal, Ctrl-C or SIGTERM; the same command continues",
}
"""What the codes mean, as help and documents say it."""


class UserError(Exception):
    """A mistake that the user can mend; the message says how."""


def guarded(command: Callable[..., None], answers: bool = False) -> Callable[..., None]:
    """Return the command with the failures that a user can cause turned into a sentence and an exit code.

    Anything else is a bug, which `relnav_sim.__main__` tells.

    Args:
        command: The command.
        answers: Whether what it prints is all that it does: then a full disk behind standard output is a failure.
    """

    @functools.wraps(command)
    def with_exit_codes(*args: Any, **kwargs: Any) -> None:
        from relnav_sim.memory_limit import too_little_memory

        if (sentence := too_little_memory()) is not None:
            _stop(sentence, Exit.INPUT_OUTPUT)

        from relnav_sim.campaign.problems import CampaignError
        from relnav_sim.kernels import CompilerError
        from relnav_sim.kernels.code_folder import tell
        from relnav_sim.results.block import RefusedError, ResultsError

        tell(lambda sentence: typer.echo(visible(sentence), err=True))
        before = signal.getsignal(signal.SIGINT)
        try:
            if before is not signal.SIG_IGN:
                signal.signal(signal.SIGINT, signal.default_int_handler)
            command(*args, **kwargs)
            if answers:
                _check_answer()
        except CampaignError as error:
            for problem in error.problems:
                typer.echo(visible(problem), err=True)
            raise typer.Exit(Exit.BAD_INPUT) from None
        except (UserError, RefusedError) as error:
            _stop(str(error), Exit.BAD_INPUT)
        except (ResultsError, CompilerError) as error:
            _stop(str(error), Exit.INPUT_OUTPUT)
        except EOFError as error:
            raise RuntimeError("a file ended too early") from error  # click would make it exit code 1
        except MemoryError as error:
            _stop(f"not enough memory: {error}".rstrip(": "), Exit.INPUT_OUTPUT)
        except OSError as error:
            _stop(_os_sentence(error), Exit.INPUT_OUTPUT)
        except KeyboardInterrupt:
            _stop("interrupted; the same command continues where it stopped", Exit.INTERRUPTED)
        finally:
            signal.signal(signal.SIGINT, before)

    return with_exit_codes


def _check_answer() -> None:
    """Raise the error that kept an answer from being written. A reader that has left, as `head` does, is none."""
    error = output_error()
    if error is not None and error.errno not in _NOBODY_LISTENS:
        raise OSError(error.errno, error.strerror, "standard output")


_NOBODY_LISTENS = (errno.EPIPE, errno.EIO, errno.EBADF)
"""Errors of a pipe without a reader, of a terminal that is gone, and of a stream that was never meant for writing."""


def _stop(sentence: str, code: Exit) -> None:
    typer.echo(visible(f"relnav: {sentence}"), err=True)
    raise typer.Exit(code) from None


def _os_sentence(error: OSError) -> str:
    if error.filename is None:
        return error.strerror or str(error)
    return f"{os.fspath(error.filename)}: {error.strerror or error}"
