"""Whether an exception is for want of memory: then the machine is to blame, and another attempt may succeed."""

from __future__ import annotations

import errno

_SAID = ("can't start new thread", "memory allocation failed")
"""What Python says where there is no memory for the stack of a thread, and HDF5 where there is none for its data."""


def lacks_memory(error: BaseException) -> bool:
    """Return whether an exception, or one that it came of, says that there was not enough memory."""
    seen: set[int] = set()
    cause: BaseException | None = error
    while cause is not None and id(cause) not in seen:
        seen.add(id(cause))
        if isinstance(cause, MemoryError) or (isinstance(cause, OSError) and cause.errno == errno.ENOMEM):
            return True
        if isinstance(cause, RuntimeError | OSError) and any(words in str(cause) for words in _SAID):
            return True
        cause = cause.__cause__ or cause.__context__
    return False


def lacking_in_words(count: int) -> str:
    """Return what became of so many runs of filters for which there was too little memory, or whose workers went."""
    return (
        f"{count} of the runs of filters lacked memory or a worker: left out of the result, and no failure of a "
        "filter; the same command tries again"
    )


def memory_in_words(error: BaseException) -> str:
    """Return the reason that a result gives for what failed for want of memory."""
    return f"not enough memory: {type(error).__name__}: {error}".rstrip(": ")
