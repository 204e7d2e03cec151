"""Results files by hand, damaged or hostile: a sentence, whatever is wrong; never a traceback, never all the memory."""

from __future__ import annotations

import json
import resource
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner
from whole_result import everything

from relnav_sim import memory_limit
from relnav_sim.campaign import models
from relnav_sim.campaign.expand import MOST_CASES
from relnav_sim.cli.app import app
from relnav_sim.results import sound
from relnav_sim.results.block import ResultsError
from relnav_sim.results.read import open_results

CASE, EKF = "case_000", "case_000/ekf"
MEMORY = 300_000_000
"""Bytes of addresses that reading a small file may take."""


def replaced(place: str, **how: Any) -> Callable[[h5py.File], None]:
    """Return a maker that puts another dataset, link or group in the place of one."""

    def make(file: h5py.File) -> None:
        kind = file[place].dtype if place in file and isinstance(file[place], h5py.Dataset) else None
        del file[place]
        if "link" in how:
            file[place] = how["link"]
        elif how:
            file.create_dataset(place, **{"dtype": kind, **how})

    return make


def said(name: str, value: Any, place: str = "/") -> Callable[[h5py.File], None]:
    """Return a maker that sets an attribute."""

    def make(file: h5py.File) -> None:
        del file[place].attrs[name]
        file[place].attrs[name] = value

    return make


def told(name: str, **changes: Any) -> Callable[[h5py.File], None]:
    """Return a maker that changes keys of an attribute that holds JSON."""

    def make(file: h5py.File) -> None:
        stored = json.loads(file.attrs.get(name, "{}"))
        file.attrs[name] = json.dumps({**stored, **changes})

    return make


def one_text_for_many(file: h5py.File) -> None:
    """Failures whose reasons all stand for one long text: 2 MB in the file, 100 GB in memory."""
    group = file[f"{CASE}/failures"]
    many = 50_000
    for name in ("failure", "run", "epoch"):
        replaced(f"{CASE}/failures/{name}", data=np.arange(many))(file)
    for name in ("filter", "reason"):
        del group[name]
        group.create_dataset(name, (many,), h5py.string_dtype(), fillvalue=b"x" * 2_000_000)


def deflated(file: h5py.File) -> None:
    """Eight gigabytes of zeros, well packed."""
    for name in ("run", "nees"):
        del file[EKF][name]
    file[EKF].create_dataset("run", (10**9,), "<i8", chunks=(10**7,), compression="gzip")
    file[EKF]["run"][: 10**7] = 0


def nested(file: h5py.File) -> None:
    file[EKF]["ekf"] = file[EKF]
    file[CASE]["case_000"] = file[CASE]


RULE = {"metric": "r_rms_m", "half_width": 1.0, "at": [2], "filter": None, "reached": 2, "met": True, "widest": 0.5}
NAN, INF = float("nan"), float("inf")
WRONG = {"at": 3, "met": "yes", "reached": INF, "filter": 1, "half_width": None, "widest": "x"}
HOSTILE: dict[str, Callable[[h5py.File], None]] = {
    "runs 1e9": said("runs", 10**9),
    "runs 0": said("runs", 0),
    "runs NaN": said("runs", NAN),
    "runs infinite": said("runs", INF),
    "runs and a half": said("runs", 4.5),
    "runs as text": said("runs", "5"),
    "runs as a list": said("runs", [5, 5]),
    "fewer runs than are held": said("runs", 3),
    "duplicate runs": replaced(f"{EKF}/run", data=[0, 1, 1, 3, 4]),
    "negative runs": replaced(f"{EKF}/run", data=[-1, 0, 1, 2, 3]),
    "unordered runs": replaced(f"{EKF}/run", data=[0, 2, 1, 3, 4]),
    "times NaN": replaced(f"{CASE}/time", data=[0, 10, NAN, 30, 40, 50, 60]),
    "times infinite": replaced(f"{CASE}/time", data=[0, 10, 20, 30, 40, 50, INF]),
    "times negative": replaced(f"{CASE}/time", data=np.arange(-10.0, 60, 10)),
    "times unordered": replaced(f"{CASE}/time", data=[0.0, 20, 10, 30, 40, 50, 60]),
    "times duplicate": replaced(f"{CASE}/time", data=[0.0, 10, 10, 30, 40, 50, 60]),
    "times in another file": replaced(f"{CASE}/time", link=h5py.ExternalLink("other.h5", f"/{CASE}/time")),
    "times of another case": replaced(f"{CASE}/time", link=h5py.SoftLink("/case_001/time")),
    "no times": replaced(f"{CASE}/time"),
    "times have no space": replaced(f"{CASE}/time", data=h5py.Empty("f8"), dtype=None),
    "truth of one run twice": replaced(f"{CASE}/trajectory", data=[0, 1, 1, 3, 4]),
    "failed is 7": replaced(f"{EKF}/failed", data=np.full(5, 7, "i1")),
    "failed as a compound": replaced(f"{EKF}/failed", data=np.zeros(5, [("a", "i1"), ("b", "i1")]), dtype=None),
    "failed as references": replaced(f"{EKF}/failed", shape=(5,), dtype=h5py.ref_dtype),
    "failed is scalar": replaced(f"{EKF}/failed", data=1),
    "failed has no space": replaced(f"{EKF}/failed", data=h5py.Empty("i1"), dtype=None),
    "failed at -2": replaced(f"{EKF}/failed_epoch", data=np.full(5, -2)),
    "failures without a reason": replaced(f"{CASE}/failures/reason"),
    "failures of run -1": replaced(f"{CASE}/failures/run", data=[-1]),
    "failures is a dataset": replaced(f"{CASE}/failures", data=[1.0]),
    "a case is a link": replaced("case_001", link=h5py.SoftLink("/case_000")),
    "a case in another file": replaced("case_001", link=h5py.ExternalLink("other.h5", "/case_001")),
    "a filter twice": lambda file: file.__setitem__("case_001/copy", file["case_001/ekf"]),
    "a case is missing": lambda file: file.__delitem__(CASE),
    "no case": lambda file: [file.__delitem__(name) for name in (CASE, "case_001")],
    "no constants": lambda file: file.__delitem__("constants"),
    "constants is a list": lambda file: file["constants"].attrs.__setitem__("mu_m3_s2", [1.0, 2.0]),
    "a case of another number": lambda file: file.move(CASE, "case_007"),
    "the case has no filters": said("filters", "{}", CASE),
    "filters are a list": said("filters", '["ekf"]', CASE),
    "a filter is named /": said("filters", '{"/": "1"}', CASE),
    "two cases are the same": said("id", "id1", CASE),
    "variables nest": said("variables", '{"a":' * 500 + "1" + "}" * 500, CASE),
    "content is a list": said("campaign_content", "[]"),
    "content nests": said("campaign_content", '{"a":' * 500 + "1" + "}" * 500),
    "content is cut": said("campaign_content", '{"clock": {"ste'),
    "content is bytes": said("campaign_content", np.void(b"{}")),
    "content is a compound": said("campaign_content", np.zeros(3, [("a", "f8")])),
    "clock is a text": told("campaign_content", clock="1 s"),
    "a step is a text": told("campaign_content", clock={"step_s": "x"}),
    "a step is NaN": told("campaign_content", clock={"step_s": NAN}),
    "a filter is a text": told("campaign_content", filters={"ekf": "ekf"}),
    "sessions are numbers": said("sessions", "[1, 2]"),
    "a session is empty": said("sessions", "[{}]"),
    "versions are a list": said("versions", "[]"),
    "began yesterday": said("started", "yesterday"),
    "ended without a zone": said("finished", "2026-01-02T03:04:05"),
    "took NaN": said("wall_time_s", NAN),
    "git_dirty is infinite": said("git_dirty", INF),
    "a seed of words": said("seed", "seven"),
    "stopping is a number": lambda file: file.attrs.__setitem__("stopping", "3"),
    "stopping says too little": told("stopping", met=True),
    **{
        f"stopping: {key} is {value!r:.20}": told("stopping", **{**RULE, key: value})
        for key, value in WRONG.items()
    },
    "one text for many": one_text_for_many,
    "deflated": deflated,
    "groups inside themselves": nested,
}  # fmt: skip


@pytest.fixture
def little_memory(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Let this process have a little more memory than it has now."""
    # Its libraries are loaded; each command would start a process to see whether they can be.
    monkeypatch.setattr(memory_limit, "too_little_memory", lambda: None)
    limits = resource.getrlimit(resource.RLIMIT_AS)
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + MEMORY, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, limits)


# Each is read by several commands: every third of them here, the others in the long check.
@pytest.mark.parametrize(
    "make",
    [
        pytest.param(make, id=name, marks=[] if number % 3 == 0 else pytest.mark.slow)
        for number, (name, make) in enumerate(HOSTILE.items())
    ],
)
def test_a_hostile_file_is_refused_in_a_sentence(
    old_result: Path, tmp_path: Path, make: Callable[[h5py.File], None], little_memory: None
) -> None:
    path = tmp_path / "hostile.h5"
    shutil.copy(old_result, tmp_path / "other.h5")
    shutil.copy(old_result, path)
    with h5py.File(path, "r+") as file:
        make(file)
    with pytest.raises(ResultsError, match=r"hostile\.h5"):
        everything(path)
    for command in (["inspect", path], ["inspect", tmp_path / "other.h5", path], ["export", path, "--overwrite"]):
        done = CliRunner().invoke(app, [str(word) for word in command])
        assert done.exit_code in (0, 3) and "identical" not in done.output, done.output
        assert done.exception is None or isinstance(done.exception, SystemExit)


ODD = (b"", "", "[]", "{}", "null", '"x"', "[" * 5000, "\x7f", 0, -1, 2**63, NAN, INF, [1, 2], np.zeros((2, 2)), True)


def test_any_attribute_may_be_anything(old_result: Path, tmp_path: Path) -> None:
    """Every attribute of file, constants and cases with every odd value: a sentence or a result."""
    path = tmp_path / "fuzzed.h5"
    with h5py.File(old_result, "r") as file:
        places = [(place, name) for place in ("/", "constants", CASE) for name in file[place].attrs]
    refused = 0
    for place, name in places:
        shutil.copy(old_result, path)
        for value in ODD:
            with h5py.File(path, "r+") as file:
                file[place].attrs[name] = value
            try:
                open_results(path).close()
            except ResultsError:
                refused += 1
        with h5py.File(path, "r+") as file:
            del file[place].attrs[name]
        if place != "constants" and name not in ("only_run", "channels", "merged_from"):  # not in every file
            with pytest.raises(ResultsError):
                open_results(path)
    assert refused > len(places) * len(ODD) // 2


def test_labels_in_another_order_are_refused_where_they_are_used(old_result: Path, tmp_path: Path) -> None:
    """relnav goes by the layout; in a labelled tree another order would be other numbers."""
    path = tmp_path / "hostile.h5"
    shutil.copy(old_result, path)
    with h5py.File(path, "r+") as file:
        replaced(f"{CASE}/component", data=["y", "x", "z", "vx", "vy", "vz"])(file)
    with open_results(path) as results, pytest.raises(ResultsError, match="is not x, y, z"):
        results.to_xarray()


def test_limits_are_the_campaign_s() -> None:
    assert (sound.MOST_RUNS, sound.MOST_CASES) == (models.MOST_RUNS, MOST_CASES)


@pytest.mark.parametrize("values", [np.nan, 5.0, "later"])
def test_the_time_axis_of_a_filter_is_that_of_its_case(old_result: Path, tmp_path: Path, values: float | str) -> None:
    path = tmp_path / "r.h5"
    shutil.copy(old_result, path)
    with h5py.File(path, "r+") as file:
        axis = file["case_000/ekf/time"]
        axis[...] = axis[...] + 1.0 if values == "later" else values
    with pytest.raises(ResultsError, match="ekf/time"), open_results(path) as results:
        results.case_runs(0, "ekf")
