"""Foreign code is contained: its exceptions are kept, the process is put back, signals still end it."""

import contextlib
import gc
import os
import signal
import sys
import threading
import warnings

import numpy as np
import pytest

from relnav_sim.containment import Containment


def state():
    mask = os.umask(0o022)
    os.umask(mask)
    return {
        "folder": os.getcwd(),
        "mask": mask,
        "environment": dict(os.environ),
        "handlers": {number: signal.getsignal(number) for number in signal.valid_signals()},
        "blocked": signal.pthread_sigmask(signal.SIG_BLOCK, ()),
        "errors": np.geterr(),
        "call": np.geterrcall(),
        "print": np.get_printoptions(),
        "garbage": (gc.isenabled(), gc.get_threshold()),
        "depth": sys.getrecursionlimit(),
        "warnings": list(warnings.filters),
        "streams": (sys.stdin, sys.stdout, sys.stderr),
    }


def spoil():
    os.chdir("/")
    os.umask(0o777)
    os.environ["OMP_NUM_THREADS"] = "64"
    os.environ.pop("PATH", None)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    signal.signal(signal.SIGALRM, lambda *_: None)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGUSR1})
    np.seterr(all="raise")
    np.seterrcall(lambda *_: None)
    np.set_printoptions(precision=1)
    gc.disable()
    gc.set_threshold(1, 1, 1)
    sys.setrecursionlimit(3000)
    warnings.simplefilter("error")
    sys.stdout = sys.stderr = sys.stdin = None


@pytest.mark.parametrize("error", [None, ValueError("x"), GeneratorExit(), KeyboardInterrupt(), SystemExit(0)])
def test_the_process_is_as_before(error, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = state()
    with Containment() as contained:
        spoil()
        if error is not None:
            raise error
    assert state() == before
    assert contained.error is error


class Asked(KeyboardInterrupt):
    pass


def ask(number, frame):
    raise Asked


@pytest.fixture
def heeded():
    before = signal.signal(signal.SIGINT, ask)
    yield
    signal.signal(signal.SIGINT, before)


def swallowing():
    with contextlib.suppress(BaseException):
        signal.raise_signal(signal.SIGINT)


def hiding():
    try:
        signal.raise_signal(signal.SIGINT)
    except BaseException:
        raise ValueError("something else") from None


@pytest.mark.usefixtures("heeded")
@pytest.mark.parametrize("code", [lambda: signal.raise_signal(signal.SIGINT), swallowing, hiding])
def test_what_a_signal_raises_is_no_failure_of_the_code(code):
    with pytest.raises(Asked), Containment():
        code()


@pytest.mark.usefixtures("heeded")
def test_an_interrupt_that_nobody_has_sent_is():
    with Containment() as contained:
        raise KeyboardInterrupt
    assert isinstance(contained.error, KeyboardInterrupt)
    with pytest.raises(Asked):
        signal.raise_signal(signal.SIGINT)


def test_outside_the_main_thread_it_leaves_signals_alone():
    found = []

    def work():
        with Containment() as contained:
            raise GeneratorExit
        found.append(contained.error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert isinstance(found[0], GeneratorExit)


def test_a_folder_that_is_gone_is_no_error(tmp_path, monkeypatch):
    folder = tmp_path / "gone"
    folder.mkdir()
    monkeypatch.chdir(folder)
    folder.rmdir()
    with Containment() as contained:
        os.chdir("/")
    assert contained.error is None
