"""Filters of somebody else's that raise, return or change whatever they can: the other filters' bits stay the same."""

import os
import re
import time

import pytest
from relnav_process import installed
from small_campaign import data_of

from relnav_sim import load_campaign, open_results, run_campaign

PLUGIN = '''
import gc, os, signal, sys, threading, warnings
import numpy as np
from pydantic import Field
from relnav_sim import register_filter
from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.kalman import KalmanFilter, KalmanOptions

class Rude(Exception):
    def __str__(self):
        raise RuntimeError("no words")

class Options(KalmanOptions):
    way: str = Field(default="", description="what it does at epoch 12")

def hinder(): raise RuntimeError("signal")

ERRORS = {
    "generator_exit": GeneratorExit("g"), "interrupt": KeyboardInterrupt(), "base": BaseException("b"),
    "stop": StopIteration("s"), "exit": SystemExit(7), "rude": Rude(), "end": EOFError("e"),
    "nul": ValueError("a\\x00b"), "surrogate": OSError("caf\\udce9.dat"), "long": ValueError("x" * 5_000_000),
    "control": ValueError("\\x1b[31m\\x9b\\u202egnp\\r\\n\\tnext"), "recursion": None, "assertion": AssertionError(),
}

def returned(way, b):
    m, P = b.mean, b.covariance
    return {
        "narrow": lambda: Gaussian(m[:, :5], P[:, :5, :5]), "flat": lambda: Gaussian(m[0], P[0]),
        "thick": lambda: Gaussian(m[:, None], P), "complex": lambda: Gaussian(m + 1j, P),
        "single": lambda: Gaussian(m.astype("f4"), P.astype("f4")), "object": lambda: Gaussian(m.astype(object), P),
        "list": lambda: Gaussian(m.tolist(), P), "masked": lambda: Gaussian(np.ma.masked_array(m, m > 0), P),
        "nothing": lambda: None, "tuple": lambda: (m, P), "one_covariance": lambda: Gaussian(m, P[:, 0]),
    }[way]()

def change(way):
    if way == "folder": os.chdir("/")
    if way == "mask": os.umask(0o777)
    if way == "numpy": np.seterr(all="raise"); np.seterrcall(lambda *a: None); np.set_printoptions(precision=1)
    if way == "python": gc.disable(); warnings.simplefilter("error"); sys.setrecursionlimit(60_000)
    if way == "environment": os.environ.clear()
    if way == "signals":
        signal.signal(signal.SIGINT, signal.SIG_IGN); signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if way == "streams": print("to standard output"); sys.stdout = sys.stderr = None
    if way == "threads":
        for _ in range(3): threading.Thread(target=threading.Event().wait, daemon=False).start()
    if way == "seed": np.random.seed(1)

CHANGES = "folder mask numpy python environment signals streams threads seed".split()

@register_filter("bad", Options)
class Bad(KalmanFilter):
    """A Kalman filter that goes wrong."""

    def __init__(self, dynamics, measurement, options):
        super().__init__(dynamics, measurement, options)
        self.way = options.way

    def predict(self, belief, step):
        b = super().predict(belief, step)
        way = self.way if step.epoch == 12 else ""
        if way == "recursion": return self.predict(belief, step)
        if way in ERRORS: raise ERRORS[way]
        if way in CHANGES: change(way)
        if way == "reads": input()
        if way == "writes_belief": belief.mean[...] = 0
        return returned(way, b) if way in RETURNS else b

    def update(self, belief, z, step):
        way = self.way if step.epoch == 12 else ""
        if way == "writes_readings": z[...] = 0
        b, innovation = super().update(belief, z, step)
        if way == "no_innovation": return b, None
        if way == "wide_nis": return b, Innovation(np.zeros((len(z), 2)), innovation.log_likelihood)
        if way == "complex_nis": return b, Innovation(innovation.nis + 1j, innovation.log_likelihood)
        if way == "number_extra": return b, Innovation(innovation.nis, innovation.log_likelihood, {"ess": 3.0})
        if way == "bad_name": return b, Innovation(innovation.nis, innovation.log_likelihood, {"a\\0b": innovation.nis})
        return b, innovation

    def start(self, prior, source):
        if self.way == "spoils_prior":
            prior.mean[...] *= 1.01
            prior.covariance[...] = np.eye(6)
        return super().start(prior, source)

RETURNS = "narrow flat thick complex single object list masked nothing tuple one_covariance".split()
'''

RAISED = {
    "generator_exit": "GeneratorExit: g",
    "interrupt": "KeyboardInterrupt",
    "base": "BaseException: b",
    "stop": "StopIteration: s",
    "exit": "SystemExit: 7",
    "rude": "Rude: (its message can't be shown)",
    "end": "EOFError: e",
    "nul": r"ValueError: a\x00b",
    "surrogate": r"OSError: caf\udce9.dat",
    "control": r"ValueError: \x1b[31m\x9b\u202egnp next",
    "recursion": "RecursionError: maximum recursion depth exceeded",
    "assertion": "AssertionError",
    "reads": "EOFError: EOF when reading a line",
    "writes_belief": "ValueError: assignment destination is read-only",
    "writes_readings": "ValueError: assignment destination is read-only",
}
RETURNED = {
    "narrow": "the mean of the belief that predict has returned is an array of type float64 and shape (1, 5); "
    "it must be an array of float64 of shape (1, 6)",
    "flat": "is an array of type float64 and shape (6,);",
    "thick": "is an array of type float64 and shape (1, 1, 6);",
    "complex": "is an array of type complex128 and shape",
    "single": "is an array of type float32 and shape",
    "object": "is an array of type object and shape",
    "list": "is a list; it must be an array",
    "masked": "is a MaskedArray of type float64",
    "nothing": "predict has returned None; it must return a belief",
    "tuple": "predict has returned a tuple; it must return a belief",
    "one_covariance": "the covariance of the belief that predict has returned is an array of type float64 and shape",
    "no_innovation": "update has returned a tuple; it must return a belief and an Innovation",
    "wide_nis": "is an array of type float64 and shape (1, 2); it must be an array of numbers of shape (1,)",
    "complex_nis": "nis of the innovation is an array of type complex128",
    "number_extra": "ess of the innovation is a float; it must be",
    "bad_name": r"'a\x00b' can't be the name of an extra",
}
CHANGED = ("folder", "mask", "numpy", "python", "environment", "signals", "streams", "threads", "seed", "spoils_prior")
ONE_CASE = ("[{kind: gaussian}, {kind: mixture, scale: 5, fraction: 0.1}]", "[{kind: gaussian}]")
ONE_RUN = ("--runs", "1", "--set", "bound=false")
SEQUENTIAL = ("--backend", "sequential")


@pytest.fixture
def with_ways(relnav, tmp_path):
    """Return a maker of command lines whose campaigns have a bad filter for each way, before the good ones."""
    environment = installed(tmp_path / "site", "bad_filters", PLUGIN)

    def make(*ways, folder="here"):
        entries = "".join(f"\n  {way}: {{kind: bad, way: {way}}}" for way in ways)
        return relnav(("filters:", f"filters:{entries}"), ONE_CASE, environment=environment, folder=folder)

    return make


def neighbours(out):
    found = data_of(out)
    return {key: found[key].tobytes() for key in found if isinstance(key, tuple) and key[1] in ("", "kf", "ekf")}


def failures(out):
    with open_results(out) as results:
        assert not results.missing()
        found = [failure for _, failure in results.failures()]
        for failure in found:
            assert int(results.statistic(0, failure.filter, "failed_epoch")[failure.run]) == failure.epoch
    return {failure.filter: failure for failure in found}


def run(made, code, *options):
    begin = time.monotonic()
    found, stdout, stderr = made.run("run", "small.yaml", *options)
    assert found == code, stderr
    assert "Traceback" not in stderr + stdout
    return stdout, stderr, time.monotonic() - begin


def test_whatever_a_filter_raises_or_returns_is_its_own_failure(with_ways):
    ways = (*RAISED, *RETURNED, "long")
    plain, here = with_ways(folder="plain"), with_ways(*ways)
    one_run = load_campaign(plain.folder / "small.yaml", ["runs=1", "bound=false"])
    run_campaign(one_run, plain.out, backend="sequential")
    ran, inspected = here.in_turn(["run", "small.yaml", *SEQUENTIAL, *ONE_RUN], ["inspect", "results/small.h5"])
    code, stdout, stderr = ran
    assert code == 1 and "Traceback" not in stderr + stdout, stderr
    assert "results/small.h5.shards/failures.log has the tracebacks" in stderr
    found = failures(here.out)
    assert found.keys() == set(ways)
    assert neighbours(here.out) == neighbours(plain.out)
    for way, expected in RAISED.items():
        assert re.fullmatch(re.escape(expected) + r"( .*)? \(bad_filters.py:\d+\)", found[way].reason), found[way]
    for way, expected in RETURNED.items():
        assert found[way].reason.startswith("ValueError: ") and expected in found[way].reason, found[way]
    assert all(failure.epoch == 12 for failure in found.values())
    assert len(found["long"].reason) <= 500 and "xxx [...] xxx" in found["long"].reason
    log = (here.shards / "failures.log").read_text()
    assert log.count("epoch 12\nTraceback") == len(ways)
    assert all(letter.isprintable() or letter == "\n" for letter in log)
    assert len(log) < len(ways) * 22_000
    code, stdout, _ = inspected
    assert code == 0 and all(letter.isprintable() or letter == "\n" for letter in stdout)


@pytest.mark.slow
def test_whatever_a_filter_changes_is_as_before_for_the_others(with_ways):
    plain, here = with_ways(folder="plain"), with_ways(*CHANGED)
    run(plain, 0, *SEQUENTIAL)
    stdout, stderr, _ = run(here, 0, *SEQUENTIAL)
    assert neighbours(here.out) == neighbours(plain.out)
    assert stdout.startswith("wrote results/small.h5") and stdout.count("\n") == 1
    assert "to standard output" in stderr
    assert os.stat(here.out).st_mode == os.stat(plain.out).st_mode


@pytest.mark.slow
def test_the_same_in_worker_processes(with_ways):
    plain, here = with_ways(folder="plain"), with_ways(*CHANGED, *RAISED)
    run(plain, 0)
    stdout, _, _ = run(here, 1, "--set", "block_runs=2")
    assert failures(here.out).keys() == set(RAISED)
    assert neighbours(here.out) == neighbours(plain.out)
    assert stdout.startswith("wrote results/small.h5") and stdout.count("\n") == 1


@pytest.mark.slow
def test_threads_that_a_filter_leaves_in_workers_do_not_keep_the_command(with_ways):
    here = with_ways("threads")
    run(here, 0)
    assert here.run("run", "small.yaml", "--only", "0:1")[0] == 0


@pytest.mark.slow
def test_the_log_of_a_single_run_lies_beside_it(with_ways):
    here = with_ways("nul")
    _, stderr, _ = run(here, 1, "--only", "0:3", *SEQUENTIAL)
    log = here.folder / "results" / "small.case_000.run_3.h5.failures.log"
    assert f"{log.relative_to(here.folder)} has the tracebacks" in stderr
    assert log.read_text().startswith("case sensors.radar.noise.kind=gaussian, run 3, filter nul, epoch 12\nTraceback")


@pytest.mark.parametrize(
    "source, problem",
    [
        pytest.param("import sys; sys.exit(0)", "SystemExit: 0", marks=pytest.mark.slow),
        pytest.param("raise KeyboardInterrupt", "KeyboardInterrupt", marks=pytest.mark.slow),
        ("raise OSError('caf\\udce9 \\x1b[31m')", r"OSError: caf\udce9 \x1b[31m"),
    ],
)
@pytest.mark.slow
def test_a_package_that_can_not_be_imported_is_named(relnav, tmp_path, source, problem):
    """Its filters are left out, also those that it had registered before; the campaign that names them can't be run."""
    environment = installed(tmp_path / "site", "quits", f"{PLUGIN}\n{source}\n")
    here = relnav(("kf: {kind: kf}", "kf: {kind: bad}"), environment=environment)
    code, stdout, stderr = here.run("validate", "small.yaml")
    assert code == 2 and not stdout
    left_out, unknown = stderr.splitlines()
    assert left_out == f"relnav: the filters of quits are left out; importing quits: {problem}"
    assert "there is no kind 'bad'" in unknown
    code, stdout, stderr = here.run("validate", "small.yaml", "--set", "filters={ekf: {kind: ekf}}")
    assert code == 0 and "small.yaml is a valid campaign" in stdout and left_out in stderr


@pytest.mark.slow
def test_what_an_import_changes_or_prints_stays_out_of_answers(relnav, tmp_path):
    source = "import os, sys; print('loading'); os.chdir('/'); os.umask(0o777); sys.stdin = sys.stdout = None"
    here = relnav(environment=installed(tmp_path / "site", "loud", source))
    code, stdout, stderr = here.run("validate", "small.yaml")
    assert code == 0 and stdout.startswith("small.yaml is a valid campaign") and stderr == "loading\n"
    run(here, 0, *SEQUENTIAL)
    assert os.access(here.out, os.R_OK)
