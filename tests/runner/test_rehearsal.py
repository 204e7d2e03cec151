"""Which cases are rehearsed for their kernels, and when none is."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from small_campaign import TEXT

from relnav_sim import load_campaign
from relnav_sim.kernels import code_folder as folder
from relnav_sim.runner import rehearsal
from relnav_sim.runner.bound_task import BoundTask
from relnav_sim.runner.work import Block


def campaign(tmp_path, *changes):
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "small.yaml").write_text(text, encoding="utf-8")
    return load_campaign(tmp_path / "small.yaml")


def shapes(campaign, bound=False):
    tasks = [Block(campaign.seed, n, case, (0, 1, 2), Path()) for n, case in enumerate(campaign.cases)]
    bounds = [BoundTask(campaign.seed, case, Path()) for case in campaign.cases] if bound else []
    return rehearsal._shapes([*tasks, *bounds])


def test_a_shape_is_a_filter_in_a_case_without_its_numbers(tmp_path):
    plain = shapes(campaign(tmp_path))
    assert len(plain) == 4  # two filters under two kinds of noise
    assert all(len(task.case.config.filters) == 1 for task in plain.values())
    alike = [("runs: 6", "runs: 9"), ("a_km: 6878", "a_km: 7000"), ("name: small", "name: other")]
    assert shapes(campaign(tmp_path, *alike)).keys() == plain.keys()
    other = shapes(campaign(tmp_path, ("ekf: {kind: ekf}", "ekf: {kind: ukf}")))
    assert len(other.keys() & plain.keys()) == 2
    assert len(shapes(campaign(tmp_path), bound=True)) == 6


@pytest.fixture
def own_folder(tmp_path, monkeypatch):
    """Let the folder of compiled code be an empty one, and a rehearsal be no more than noted."""
    place = tmp_path / "caches" / "kernels" / "digest"
    rehearsed = []

    def note(tasks, say):
        rehearsed.append(len(tasks))
        return True

    def made():
        place.mkdir(parents=True, exist_ok=True)

    for module in (rehearsal, folder):
        monkeypatch.setattr(module, "code_folder", lambda: place)
    monkeypatch.setattr(folder, "_make_folder", made)
    monkeypatch.setattr(rehearsal, "_rehearsed", note)
    return place, rehearsed


def tasks_of(campaign):
    return [Block(campaign.seed, n, case, (0, 1), Path()) for n, case in enumerate(campaign.cases)]


def test_a_shape_is_rehearsed_once(tmp_path, own_folder):
    place, rehearsed = own_folder
    said = []
    tasks = tasks_of(campaign(tmp_path))
    rehearsal.compile_kernels(tasks[:1], said.append)
    rehearsal.compile_kernels(tasks, said.append)
    rehearsal.compile_kernels(tasks, said.append)
    rehearsal.compile_kernels([], said.append)
    assert rehearsed == [2, 2] and len(list(place.glob("rehearsed.*"))) == 4 and not said


def test_nothing_is_rehearsed_where_all_kernels_are_kept(tmp_path, own_folder):
    place, rehearsed = own_folder
    place.mkdir(parents=True)
    for name in folder.kernel_names():
        (place / f"{name}.code").touch()
    rehearsal.compile_kernels(tasks_of(campaign(tmp_path)), print)
    assert not rehearsed


def test_nothing_is_rehearsed_where_nothing_can_be_kept_and_it_is_said(tmp_path, own_folder, monkeypatch):
    place, rehearsed = own_folder
    monkeypatch.setattr(folder, "_hushed", False)
    (tmp_path / "caches").write_text("a file")
    said = []
    rehearsal.compile_kernels(tasks_of(campaign(tmp_path)), said.append)
    assert said == [
        f"warning: compiled code can't be kept in {place} (Not a directory), so that every process compiles the "
        "numerical kernels for itself; RELNAV_CACHE_DIR can name another folder"
    ]
    folder.warn_not_kept("again")  # would be an error if it warned
    assert not rehearsed


def test_a_rehearsal_ends_after_the_first_epochs(tmp_path):
    longer = (("duration_s: 40", "duration_s: 4000"), ("store_every_s: 4", "store_every_s: 8"))
    case = campaign(tmp_path, *longer).cases[0]
    short = rehearsal._first_epochs(case).config.clock
    assert (short.epochs, short.stored, short.step_s) == (rehearsal.EPOCHS + 1,) * 2 + (1,)
    brief = replace(case, config=case.config.model_copy(update={"clock": short.model_copy(update={"duration_s": 40})}))
    assert rehearsal._first_epochs(brief).config.clock.epochs == 41
    many = campaign(tmp_path, *longer, ("ekf: {kind: ekf}", "pf: {kind: particle, particles: 100000}")).cases[0]
    assert rehearsal._first_epochs(many).config.clock.epochs == rehearsal.FEWEST_EPOCHS + 1


PREVIEW = """
import sys
from pathlib import Path
from relnav_sim import load_campaign
from relnav_sim.runner import rehearsal
from relnav_sim.runner.work import Block
campaign = load_campaign(sys.argv[1])
named = []
rehearsal._be_silent, rehearsal.is_kept, rehearsal.compile_kernel = lambda: None, named.__contains__, named.append
tasks = [Block(campaign.seed, n, case, (0, 1), Path()) for n, case in enumerate(campaign.cases)]
for place in (0, 1):
    rehearsal.compile_ahead(tasks, place)
    print(*named, "numba" in sys.modules)
    first, second = rehearsal.shares(sorted(named))
    named.clear()
print(*first, "/", *second)
"""


def test_two_processes_name_the_same_kernels_from_either_end_without_a_compiler(tmp_path):
    campaign(tmp_path)
    done = subprocess.run(
        [sys.executable, "-c", PREVIEW, str(tmp_path / "small.yaml")], capture_output=True, text=True, check=True
    )
    *two, halves = done.stdout.splitlines()
    (*one, compiler), (*other, still) = (line.split() for line in two)
    assert compiler == still == "False"
    assert len(one) == len(set(one)) and {"statistics.normalised_errors", "epochs.filtered", "orbits.fly"} <= set(one)
    assert set(one) == set(other) <= set(folder.kernel_names())
    # Each begins with its share and goes on with the other's, from its end.
    first, second = (half.split() for half in halves.split("/"))
    assert one == [*first, *reversed(second)] and other == [*second, *reversed(first)]


def test_a_kernel_that_fails_or_is_of_another_package_keeps_no_other_from_being_compiled(tmp_path, monkeypatch):
    tried, kept = [], set()

    def preview(task, epochs, runs, learned):
        from relnav_sim.kernels import compiling

        compiling._called.update(dict.fromkeys(["elsewhere.kernel", "maps.linear", "angles.difference"]))

    def compile_kernel(name):
        tried.append(name)
        if name == "maps.linear":
            raise RuntimeError("no such luck")
        kept.add(name)

    monkeypatch.setattr(rehearsal, "_be_silent", lambda: None)
    monkeypatch.setattr(rehearsal, "_run", preview)
    monkeypatch.setattr(rehearsal, "is_kept", kept.__contains__)
    monkeypatch.setattr(rehearsal, "compile_kernel", compile_kernel)
    monkeypatch.setattr(rehearsal, "is_being_compiled", lambda name: False)
    case = campaign(tmp_path).cases[0]
    rehearsal.compile_ahead([Block(1, 0, case, (0,), Path())], 0)
    assert set(tried) == {"maps.linear", "angles.difference"} and kept == {"angles.difference"}
