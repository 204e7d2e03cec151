"""The folder of compiled code: where it is, what it is good for, and what is kept in it. Nothing here needs numba.

A file of code begins with its checksum: half a file, which a loss of power may leave, counts as none.
"""

from __future__ import annotations

import fcntl
import hashlib
import marshal
import os
import platform
import re
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

VARIABLE = "RELNAV_CACHE_DIR"
KEPT = 8
"""Folders of other code or other versions that stay beside the one in use."""
IN_USE_S = 3600.0
"""A folder that a process has begun to use so lately is never removed."""
LONGEST_WAIT_S = 120.0
"""After this a process compiles for itself what another one seems to be compiling."""
_CHECKSUM_BYTES = 32


@cache
def code_folder() -> Path:
    """Return the folder, which need not exist.

    It is `kernels/DIGEST` below `RELNAV_CACHE_DIR`, else below `relnav` in the user's folder of caches.

    Raises:
        RuntimeError: Nobody knows the user's home.
    """
    return _base() / "kernels" / digest()


def _base() -> Path:
    if chosen := os.environ.get(VARIABLE):
        return Path(chosen).absolute()
    caches = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(caches) if os.path.isabs(caches) else Path.home() / ".cache") / "relnav"


@cache
def digest() -> str:
    """Return a hash of all that decides what the compiled code is.

    That is the source of every kernel, for each has parts of other files compiled into it; what compiles; and the
    processor. The code itself names its processor too, in the compiler's words.
    """
    found = hashlib.sha256()
    for name, source in _sources().items():
        found.update(f"{name}\0{len(source)}\0".encode() + source)
    settings = {name: value for name, value in os.environ.items() if name.startswith("NUMBA_")}
    settings.pop("NUMBA_NUM_THREADS", None)  # workers have it from relnav
    python = (sys.implementation.cache_tag, sys.version, getattr(sys, "abiflags", ""))
    versions = [_version_of(package) for package in ("numba", "llvmlite", "numpy")]
    found.update(repr((python, versions, sorted(settings.items()), platform.machine(), _processor())).encode())
    return found.hexdigest()[:20]


def _version_of(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def _processor() -> str:
    """Return the processor's name and instructions, as far as the system tells in a moment."""
    try:
        with open("/proc/cpuinfo", encoding="ascii", errors="replace") as told:
            first = told.read(8192).split("\n\n")[0]
    except OSError:
        return platform.processor()
    return "\n".join(re.findall(r"^(?:model name|flags|Features|CPU part)\s*:.*", first, re.MULTILINE))


@cache
def _sources() -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py"))}


def kernel_names() -> list[str]:
    """Return every kernel as `theme.function`, from the text of the sources."""
    found = re.compile(r"^@kernel(?:_like)?\(.*?^def (\w+)", re.MULTILINE | re.DOTALL)
    return [
        f"{name.removesuffix('.py')}.{function}"
        for name, source in _sources().items()
        for function in found.findall(source.decode())
    ]


def name_of_code(function: Callable[..., Any]) -> str:
    """Return the name under which the code of a kernel is kept: `theme.function`.

    The folder is that of this package's sources. The code of a kernel from elsewhere has a hash of its own module in
    its name, so that another version of that module, or another module of the same name, has code of its own.
    """
    package, _, theme = function.__module__.rpartition(".")
    name = f"{theme}.{function.__name__}"
    if package == __package__:
        return name
    source = getattr(sys.modules[function.__module__], "__file__", None)
    content = Path(source).read_bytes() if source else marshal.dumps(function.__code__)
    return f"{name}.{hashlib.sha256(content).hexdigest()[:20]}"


def is_kept(name: str) -> bool:
    """Return whether there is a file of code for a kernel."""
    with suppress(RuntimeError):
        return _file(name).exists()
    return False


def is_being_compiled(name: str) -> bool:
    """Return whether another process is compiling a kernel."""
    with suppress(OSError, RuntimeError), open(_lock(name), "r+b") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def read_code(name: str) -> bytes | None:
    """Return what is kept of a kernel; None where there is nothing, or nothing whole."""
    try:
        content = _file(name).read_bytes()
    except (OSError, RuntimeError):
        return None
    checksum, code = content[:_CHECKSUM_BYTES], content[_CHECKSUM_BYTES:]
    return code if hashlib.sha256(code).digest() == checksum else None


def keep_code(name: str, code: bytes) -> None:
    """Keep the code of a kernel; where that can't be, say so once in this process."""
    try:
        _make_folder()
        part = code_folder() / f"{name}.{os.getpid()}.part"
        try:
            part.write_bytes(hashlib.sha256(code).digest() + code)
            os.replace(part, _file(name))
        finally:
            part.unlink(missing_ok=True)
    except (OSError, RuntimeError) as error:
        warn_not_kept(_reason(error))


def not_writable() -> str | None:
    """Return why nothing can be kept in the folder; None where it can. The folder is made."""
    try:
        _make_folder()
        with tempfile.TemporaryFile(dir=code_folder()) as trial:
            trial.write(bytes(4096))
    except (OSError, RuntimeError) as error:
        return _reason(error)
    return None


@contextmanager
def alone(name: str) -> Iterator[None]:
    """Wait while another process compiles this kernel; where nothing can be locked, don't."""
    say_compiling()
    try:
        _make_folder()
        os.utime(code_folder())  # for who waits outside: something is at work here
        lock = open(_lock(name), "ab")  # noqa: SIM115  # closed below
    except (OSError, RuntimeError):
        yield
        return
    with lock:
        before = time.monotonic()
        while time.monotonic() - before < LONGEST_WAIT_S:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                time.sleep(0.05)
            except OSError:  # some file systems can't lock
                break
        yield


@cache
def _make_folder() -> None:
    """Make the folder, once in a process; a new one takes the place of the oldest.

    Raises:
        OSError: It can't be made.
    """
    folder = code_folder()
    is_new = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    with suppress(OSError):
        (folder / _USED).touch()
        if is_new:
            _remove_old(folder)


_USED = "used"
"""A file whose time says when a process last began to use the folder."""


def _remove_old(folder: Path) -> None:
    def used(other: Path) -> float:
        with suppress(OSError):
            return (other / _USED).stat().st_mtime
        return 0.0

    others = sorted((other for other in folder.parent.iterdir() if other != folder), key=used, reverse=True)
    for other in others[KEPT:]:
        if time.time() - used(other) > IN_USE_S:
            shutil.rmtree(other, ignore_errors=True)


_say: Callable[[str], None] | None = None


def tell(say: Callable[[str], None]) -> None:
    """Name who is told, once in this process, that kernels are being compiled; by default nobody is."""
    global _say
    if _say is not _say_nothing:
        _say = say


def say_compiling() -> None:
    """Say that kernels are being compiled."""
    global _say
    if _say is not None:
        # First of all, so that an interrupt in the middle does not have it said again.
        say, _say = _say, _say_nothing
        say("compiling the numerical kernels that are needed here and not kept yet ...")


def _say_nothing(sentence: str) -> None:
    """Do nothing: it has been said."""


_trouble: str | None = None
_hushed = False


def trouble() -> str | None:
    """Return why compiled code could not be kept in this process; None where it could."""
    return _trouble


def warn_not_kept(reason: str) -> None:
    """Warn that compiled code can't be kept, once in a process."""
    global _trouble
    _trouble = reason
    if not _hushed:
        hush()
        with suppress(UserWarning):  # a program that makes errors of warnings must not lose a run by it
            warnings.warn(not_kept(reason), UserWarning, stacklevel=2)


def hush() -> None:
    """Say nothing of it in this process: another one has said it, or will."""
    global _hushed
    _hushed = True


def not_kept(reason: str) -> str:
    """Return the warning in words."""
    with suppress(RuntimeError):
        reason = f"in {code_folder()} ({reason})"
    return (
        f"compiled code can't be kept {reason}, so that every process compiles the numerical kernels for itself; "
        f"{VARIABLE} can name another folder"
    )


def _file(name: str) -> Path:
    return code_folder() / f"{name}.code"


def _lock(name: str) -> Path:
    return code_folder() / f"{name}.lock"


def _reason(error: OSError | RuntimeError) -> str:
    return getattr(error, "strerror", None) or str(error)
