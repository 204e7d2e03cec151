"""Standard streams that are closed, full, without a reader or on a terminal that is gone: what can't be said is not."""

import contextlib
import errno
import os
import pty
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from relnav_process import RELNAV, members, wait_until
from small_campaign import TEXT, assert_same_bits
from typer.testing import CliRunner

from relnav_sim import load_campaign, run_campaign
from relnav_sim.cli.app import app
from relnav_sim.cli.failures import EXIT_CODES, Exit
from relnav_sim.standard_streams import PatientStream

ROOT = Path(__file__).parents[2]
RUN = "run small.yaml --backend sequential --set bound=false"
FULL = "/dev/full"

needs_full_disk = pytest.mark.skipif(not os.path.exists(FULL), reason="no /dev/full here")


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """Return the result as it is computed where every stream is open."""
    folder = tmp_path_factory.mktemp("expected")
    (folder / "small.yaml").write_text(TEXT, encoding="utf-8")
    campaign = load_campaign(folder / "small.yaml", ["bound=false"])
    return run_campaign(campaign, folder / "small.h5", backend="sequential")


def shell(here, words):
    """Run `relnav WORDS` in a shell, which redirects; return the exit code of relnav, and the two outputs."""
    words, *reader = words.partition(" |")
    command = f"{{ {shlex.join(RELNAV)} {words}; echo $? > code; }}{''.join(reader)}"
    done = subprocess.run(
        ["sh", "-c", command], cwd=here.folder, env=here.environment, capture_output=True, text=True, timeout=120
    )
    return int((here.folder / "code").read_text()), done.stdout, done.stderr


@pytest.mark.parametrize(
    "words",
    [
        pytest.param("2>&-", marks=pytest.mark.slow),
        pytest.param(">&- 2>&-", marks=pytest.mark.slow),
        pytest.param("<&- >&- 2>&-", marks=pytest.mark.slow),
        pytest.param("2>&1 | true", marks=pytest.mark.slow),
        pytest.param(f"2>{FULL}", marks=[needs_full_disk, pytest.mark.slow]),
        pytest.param(f">{FULL} 2>&1", marks=needs_full_disk),
        pytest.param("--workers 2 --backend loky >&-", marks=pytest.mark.slow),
        pytest.param("--workers 2 --backend loky <&- >&- 2>&-", marks=pytest.mark.slow),
        pytest.param("--only 0:1 <&- 2>&-", marks=pytest.mark.slow),
    ],
)
def test_a_campaign_writes_its_result_whoever_listens(relnav, expected, words):
    here = relnav()
    code, stdout, stderr = shell(here, f"{RUN} {words}")
    assert code == 0
    assert "Traceback" not in stdout + stderr
    if "--only" in words:
        assert (here.folder / "results" / "small.case_000.run_1.h5").exists()
    else:
        assert_same_bits(expected, here.out)


def test_no_data_file_gets_the_number_of_a_closed_stream(relnav):
    """Else the sentence for the terminal lands in a shard. The module is imported first, before anything is opened."""
    code = (
        "import os\n"
        "from relnav_sim.standard_streams import make_patient\n"
        "make_patient()\n"
        "assert os.open('data', os.O_CREAT | os.O_WRONLY) > 2\n"
        "print('words')\n"
        "assert all(os.get_inheritable(number) for number in range(3))\n"
        "assert os.path.getsize('data') == 0\n"
    )
    here = relnav()
    done = subprocess.run(
        ["sh", "-c", f"{shlex.join([sys.executable, '-c', code])} <&- >&- 2>&-"], cwd=here.folder, env=here.environment
    )
    assert done.returncode == 0


@pytest.mark.parametrize(
    "words, code",
    [
        pytest.param("list filters | true", 0, marks=pytest.mark.slow),
        pytest.param("validate small.yaml --set statistics.convergence_hold_s=10 | true", 0, marks=pytest.mark.slow),
        pytest.param("validate small.yaml --set runs=0 2>&1 | true", 2, marks=pytest.mark.slow),
        pytest.param("list noise >&-", 0, marks=pytest.mark.slow),
        pytest.param(f"list noise >{FULL}", 3, marks=needs_full_disk),
        pytest.param("schema | true", 0, marks=pytest.mark.slow),
    ],
)
def test_a_command_that_only_answers(relnav, words, code):
    """A reader that has left is no failure; an answer that a full disk has swallowed is one."""
    here = relnav(environment={"PYTHONUNBUFFERED": "1"})
    found, _, stderr = shell(here, words)
    assert found == code
    assert stderr == ("relnav: standard output: No space left on device\n" if code == 3 else "")


def on_terminal(here, ignored, words):
    """Start relnav on a terminal of its own; return its process and the other end of the terminal."""
    process, terminal = pty.fork()
    if process == 0:  # as an interactive shell starts it, or nohup
        signal.signal(signal.SIGHUP, signal.SIG_IGN if ignored else signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.chdir(here.folder)
        os.execve(RELNAV[0], [*RELNAV, *words], here.environment)
    return process, terminal


def read(terminal):
    """Take what the terminal shows, lest it fills up."""
    with contextlib.suppress(BlockingIOError):
        os.read(terminal, 65536)
    return True


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["loky", "sequential"])
@pytest.mark.parametrize("ignored", [True, False])
def test_a_terminal_that_is_closed(relnav, ignored, backend):
    here = relnav(("runs: 6", "runs: 16"), ("block_runs: 4", "block_runs: 1"), ("duration_s: 40", "duration_s: 150"))
    words = ("run", "small.yaml", "--backend", backend)
    process, terminal = on_terminal(here, ignored, words)
    os.set_blocking(terminal, False)
    assert wait_until(lambda: read(terminal) and any(here.shards.glob("*.h5")))
    os.close(terminal)
    begin = time.monotonic()
    code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    if ignored:
        assert code == 0
    else:
        assert code == 128 + signal.SIGHUP
        assert time.monotonic() - begin < 3
        assert wait_until(lambda: not members(process), 3), members(process)
        assert not here.out.exists()
        assert here.run(*words)[0] == 0
    whole = relnav(
        ("runs: 6", "runs: 16"), ("block_runs: 4", "block_runs: 1"), ("duration_s: 40", "duration_s: 150"), folder="w"
    )
    assert whole.run("run", "small.yaml")[0] == 0
    assert_same_bits(whole.out, here.out)


def test_a_stream_drops_what_it_cannot_write_and_keeps_the_reason():
    reader, writer = os.pipe()
    stream = PatientStream(writer)
    assert stream.write(b"heard") == 5 and os.read(reader, 10) == b"heard" and stream.error is None
    os.close(reader)
    assert stream.write(b"not heard") == 9 and stream.error.errno == errno.EPIPE
    os.close(writer)
    assert stream.write(b"nor this") == 8 and stream.error.errno == errno.EPIPE


def test_a_stream_waits_for_a_slow_reader_that_is_not_to_be_waited_for():
    """As where another program has made the shared pipe non-blocking: nothing is lost, nothing raised."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    words = b"x" * 300_000
    slow = subprocess.Popen(["sh", "-c", "sleep 0.2; wc -c"], stdin=reader, stdout=subprocess.PIPE)
    os.close(reader)
    PatientStream(writer).write(words)
    os.close(writer)
    assert int(slow.communicate()[0]) == len(words)


FAULT = """
import sys
from relnav_sim import campaign
def broken(*arguments):
    raise ZeroDivisionError("a \\x1b[31mfault")
campaign.plan_campaign = broken
sys.argv = ["relnav", "validate", "small.yaml"]
from relnav_sim.__main__ import main
main()
"""


@pytest.mark.parametrize("writable", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_an_unexpected_exception_is_one_line_and_a_file(relnav, tmp_path, writable):
    here = relnav()
    spare = tmp_path / "spare"
    spare.mkdir()
    (tmp_path / "file").touch()
    temporary = spare if writable else tmp_path / "file"
    code = FAULT if writable else f"import tempfile; tempfile.tempdir = {str(temporary)!r}\n{FAULT}"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=here.folder,
        env={**here.environment, "TMPDIR": str(temporary)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == Exit.UNEXPECTED == 70
    line, *rest = done.stderr.splitlines()
    assert "unexpected ZeroDivisionError: a \\x1b[31mfault; this is a fault of relnav, please report it in" in line
    if writable:
        assert not rest
        [kept] = spare.iterdir()
        assert line.endswith(str(kept))
        assert "in broken" in kept.read_text()
    else:
        assert "in broken" in done.stderr


def test_exit_codes_are_told_alike_everywhere():
    told = {int(code) for codes in EXIT_CODES for code in codes.split(",")}
    assert told == {0, *map(int, Exit)}
    table = "".join(f"| {code} | {meaning} |\n" for code, meaning in EXIT_CODES.items())
    for page in (ROOT / "README.md", ROOT / "docs" / "reliability.md"):
        assert f"| exit code | meaning |\n|---|---|\n{table}\n" in page.read_text(encoding="utf-8") + "\n", page
    for words in (["--help"], ["run", "--help"]):
        shown = re.sub(r"\s+", " ", CliRunner().invoke(app, words).output)
        assert all(f"{code}: {meaning}" in shown for code, meaning in EXIT_CODES.items())
