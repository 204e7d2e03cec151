"""What a command says and returns when it can't do its work: a sentence and an exit code, never a traceback."""

from __future__ import annotations

import functools
import os
import signal
from collections.abc import Callable
from enum import IntEnum
from typing import Any

import typer


class Exit(IntEnum):
    """Exit codes of every command."""

    SOME_RUNS_FAILED = 1
    BAD_INPUT = 2
    INPUT_OUTPUT = 3
    REQUIREMENT_MISSED = 4
    REQUIREMENT_UNDECIDED = 5
    INTERRUPTED = 130


class UserError(Exception):
    """A mistake that the user can mend; the message says how."""


def guarded(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command with the failures that a user can cause turned into a sentence and an exit code.

    Anything else is a bug and keeps its traceback.
    """

    @functools.wraps(command)
    def with_exit_codes(*args: Any, **kwargs: Any) -> None:
        from relnav_sim.memory_limit import too_little_memory

        if (sentence := too_little_memory()) is not None:
            _stop(sentence, Exit.INPUT_OUTPUT)

        from relnav_sim.campaign.problems import CampaignError
        from relnav_sim.results.block import RefusedError, ResultsError

        before = signal.getsignal(signal.SIGINT)
        try:
            if before is not signal.SIG_IGN:
                signal.signal(signal.SIGINT, signal.default_int_handler)
            command(*args, **kwargs)
        except CampaignError as error:
            for problem in error.problems:
                typer.echo(problem, err=True)
            raise typer.Exit(Exit.BAD_INPUT) from None
        except (UserError, RefusedError) as error:
            _stop(str(error), Exit.BAD_INPUT)
        except ResultsError as error:
            _stop(str(error), Exit.INPUT_OUTPUT)
        except MemoryError as error:
            _stop(f"not enough memory: {error}".rstrip(": "), Exit.INPUT_OUTPUT)
        except BrokenPipeError:
            raise
        except OSError as error:
            _stop(_os_sentence(error), Exit.INPUT_OUTPUT)
        except KeyboardInterrupt:
            _stop("interrupted; the same command continues where it stopped", Exit.INTERRUPTED)
        finally:
            signal.signal(signal.SIGINT, before)

    return with_exit_codes


def _stop(sentence: str, code: Exit) -> None:
    typer.echo(f"relnav: {sentence}", err=True)
    raise typer.Exit(code) from None


def _os_sentence(error: OSError) -> str:
    if error.filename is None:
        return error.strerror or str(error)
    return f"{os.fspath(error.filename)}: {error.strerror or error}"
