"""What travels to a worker, what comes back, and who is to blame where hosts and workers come and go."""

import pickle
from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import pytest
from hypothesis import given
from hypothesis import strategies as st

from relnav_sim.results.block import ResultsError
from relnav_sim.runner.blame import TIMES_LOST, TaskQueue
from relnav_sim.runner.bound_task import bound_tasks
from relnav_sim.runner.compute import Outcome, compute
from relnav_sim.runner.executors import received
from relnav_sim.runner.executors.content import Content, compact, digest_of_content, numbers
from relnav_sim.runner.executors.identity import differences, identity
from relnav_sim.runner.executors.interface import Ended, Fault
from relnav_sim.runner.executors.on_worker import Came, admit, compute_order
from relnav_sim.runner.executors.shared_folder import leave_token, put
from relnav_sim.runner.failure_log import NAME as LOG
from relnav_sim.runner.machines import machines_of, note_machine
from relnav_sim.runner.pool import Pool
from relnav_sim.runner.work import Block, blocks_left
from relnav_sim.simulation.learned import Learned


@given(st.lists(st.integers(0, 300), min_size=1, unique=True))
def test_numbers_travel_in_their_order(given):
    assert numbers(compact(given)) == given


def test_forty_numbers_are_a_few_letters():
    assert compact(range(40)) == "0-39" and compact([5, 6, 7, 3, 9]) == "5-7,3,9"


@pytest.fixture
def tasks(campaign, tmp_path):
    made = campaign()
    return [*blocks_left(made, {}, tmp_path), *bound_tasks(made, tmp_path)]


def test_an_order_means_its_task_and_is_small(tasks, tmp_path):
    content = Content.of(tasks)
    packed = content.packed()
    there = Content.unpacked(packed)
    for task in [*tasks, *(piece for whole in tasks for piece in whole.pieces())]:
        order = content.order(digest_of_content(packed), task)
        meant = there.task(order, tmp_path)
        # The path is a hash of seed, case, filters with their settings, and runs.
        assert type(meant) is type(task) and meant.path == task.path
        assert list(meant.case.config.filters) == list(task.case.config.filters)
        assert meant.case.config.model_dump() == task.case.config.model_dump()
        if isinstance(task, Block):
            assert (meant.case_index, meant.runs) == (task.case_index, task.runs)
        assert len(pickle.dumps((compute_order, order, 60.0))) < 1000
    assert sum(isinstance(task, Block) for task in there.examples()) == 2
    assert len(list(there.examples())) == 4, "two cases, each with a bound"


def test_orders_of_many_filters_and_scattered_runs_stay_small(tasks, tmp_path):
    block = tasks[0]
    entry = block.case.config.filters["kf"]
    config = block.case.config.model_copy(update={"filters": {str(n): entry for n in range(200)}})
    every_other = {str(n): entry for n in range(0, 200, 2)}
    wide = replace(block, case=replace(block.case, config=config))
    part = replace(
        wide,
        case=replace(block.case, config=config.model_copy(update={"filters": every_other})),
        runs=tuple(range(0, 80, 2)),
    )
    content = Content.of([wide, part])
    assert len(pickle.dumps((compute_order, content.order("0" * 16, part), None))) < 1000


def test_a_campaign_without_files_names_none_and_one_with_a_field_names_it(campaign, tmp_path):
    assert Content.of(list(blocks_left(campaign(), {}, Path()))).files() == {}
    coefficients = (
        "product_type gravity_field\nmodelname own\nearth_gravity_constant 0.3986004415E+15\nradius 0.63781363E+07\n"
        "max_degree 2\nerrors no\nend_of_head =====\ngfc 0 0 1.0 0.0\ngfc 2 0 -0.484165371736E-03 0.0\n"
    )
    (tmp_path / "own.gfc").write_text(coefficients)
    path = str(tmp_path / "own.gfc")
    made = campaign(
        "truth.epoch=2010-07-27T00:00:00 UTC", f"truth.forces.gravity={{model: {path}, degree: 2, order: 0}}"
    )
    found = Content.of(list(blocks_left(made, {}, Path()))).files()
    assert list(found) == [path] and len(found[path]) == 64


def test_a_file_is_put_where_its_token_is_and_nowhere_else(tmp_path):
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir(), there.mkdir()
    file = tmp_path / "shard.h5"
    file.write_bytes(b"numbers")
    token = leave_token(here)
    assert put(file, token) and (here / "shard.h5").read_bytes() == b"numbers"
    # Another machine's folder of the same name: there is no such file, or it says something else.
    assert not put(file, replace(token, folder=str(there)))
    (there / token.name).write_text("0" * 32)
    assert not put(file, replace(token, folder=str(there)))
    assert not (there / "shard.h5").exists()
    assert not put(file, replace(token, folder=str(tmp_path / "nowhere")))


def test_what_comes_back_is_verified_before_it_stays(tasks, tmp_path):
    ours, other = tasks[0], tasks[1]
    there = tmp_path / "there"
    there.mkdir()
    outcome = compute(replace(ours, folder=there), Learned())
    sent = (there / ours.path.name).read_bytes()
    received.receive(ours, Came(outcome, shard=sent, log="case x, run 1\ntraceback\n\n"))
    assert ours.path.read_bytes() == sent
    assert (tmp_path / LOG).read_text() == "case x, run 1\ntraceback\n\n"
    with pytest.raises(ResultsError, match="result of another task"):
        received.receive(other, Came(outcome, shard=sent))
    damaged = bytearray(sent)
    damaged[len(sent) // 2] ^= 1
    with pytest.raises(ResultsError):
        received.receive(other, Came(outcome, shard=bytes(damaged)))
    assert not other.path.exists()


def test_a_file_that_is_never_seen_is_an_error(tasks, monkeypatch):
    monkeypatch.setattr(received, "LONGEST_UNSEEN_S", 0.1)
    with pytest.raises(ResultsError, match="no such file"):
        received.receive(tasks[0], Came(Outcome(0, {})))


def test_what_differs_on_another_machine_is_named():
    here = identity()
    assert differences(here, here) == ""
    assert differences({**here, "numpy": "1.0"}, here) == f"numpy 1.0, not {here['numpy']}"
    assert differences({**here, "Python": "3.9"}, here) == f"Python 3.9, not {here['Python']}"
    found = differences({**here, "plug-ins": "mine (mine 1.0)"}, here)
    assert found.startswith("plug-ins mine (mine 1.0), not ")
    assert differences({**here, "commit": "1234567"}, here) == ""
    other = {**here, "commit": "1234567", "source": "0"}
    assert "of another source (commit 1234567) than the one here (commit " in differences(other, here)
    assert differences({**other, "relnav": "0.0.1"}, here) == f"relnav 0.0.1, not {here['relnav']}"
    older = {name: value for name, value in here.items() if name != "sgp4"}
    assert differences(older, here) == f"sgp4 none, not {here['sgp4']}"


def test_a_worker_without_the_campaigns_files_or_of_another_relnav_is_refused_before_it_starts_anything(tmp_path):
    def refused(files=MappingProxyType({}), **other):
        return admit({**identity(), **other}, "0" * 16, b"", [], files).refused

    file = tmp_path / "orbit.oem"
    assert refused({str(file): "0" * 64}) == (
        f"it can't read a file that the campaign names: {file}: No such file or directory"
    )
    file.write_text("another orbit")
    assert "has other content than the one here" in refused({str(file): "0" * 64})
    assert refused(relnav="9.9") == f"it has relnav {identity()['relnav']}, not 9.9"


def test_machines_are_counted_by_the_blocks_that_are_there(tmp_path):
    for name, host in (("a.h5", "one"), ("b.h5", "two"), ("gone.h5", "two"), ("a.h5", "three")):
        note_machine(tmp_path / name, host, "a processor")
    for name in ("a.h5", "b.h5"):
        (tmp_path / name).touch()
    with open(tmp_path / "machines.jsonl", "a") as file:
        file.write("half a li")
    assert machines_of(tmp_path) == {"three (a processor)": 1, "two (a processor)": 1}


class Cluster:
    """An executor of two hosts of two places, on which some pairs of a filter and a run always go wrong.

    It computes nothing, and notes what was at work beside a suspect.
    """

    def __init__(self, wrong, fault, strikes=10**6):
        self.wrong, self.fault, self.strikes = wrong, fault, strikes
        self.at = {}
        self.together = []

    def begin(self, tasks):
        self.at.clear()

    def free(self):
        return Counter({host: 2 - sum(h == host for h in self.at.values()) for host in ("a", "b")})

    def submit(self, task, host):
        assert self.free()[host] > 0
        self.at[task] = host

    def as_completed(self):
        task = next(iter(self.at))
        host = self.at.pop(task)
        self.together.append((task, [other for other, h in self.at.items() if h == host]))
        struck = self.strikes > 0 and not pairs(task).isdisjoint(self.wrong)
        self.strikes -= struck
        return [Ended(task, None, self.fault, "wrong") if struck else Ended(task, Outcome(0, {}))]

    def discard(self):
        self.at.clear()

    def close(self):
        pass


class Piece(Block):
    """A block that a set can hold."""

    __hash__ = object.__hash__


def pairs(task):
    return {(name, run) for name in task.case.config.filters for run in task.runs}


@pytest.fixture
def run_on(campaign, tmp_path, monkeypatch):
    made = campaign("block_runs=2", "runs=8", "grid={}")
    blocks = [Piece(**vars(block)) for block in blocks_left(made, {}, tmp_path)]
    given_up = []
    monkeypatch.setattr(
        "relnav_sim.runner.pool.failed_task",
        lambda task, reason, retry: given_up.append((pairs(task), retry)),
    )

    def run(cluster):
        pool = Pool(backend="sequential")
        monkeypatch.setattr(pool, "_executor", cluster)
        done = [pair for done in pool.computed(blocks) for pair in pairs(done.block)]
        return sorted(done), given_up

    every = sorted(pair for block in blocks for pair in pairs(block))
    return run, every


@pytest.mark.parametrize("fault, retry", [(Fault.KILLED, False), (Fault.LOST, True), (Fault.TOO_LONG, False)])
def test_who_goes_wrong_is_given_up_alone_and_all_others_are_computed(run_on, fault, retry):
    run, every = run_on
    wrong = {("kf", 3), ("ekf", 6)}
    cluster = Cluster(wrong, fault)
    done, given_up = run(cluster)
    assert done == sorted(set(every) - wrong)
    assert sorted(given_up, key=str) == sorted([({pair}, retry) for pair in wrong], key=str)


def test_suspects_are_alone_on_their_host_and_the_other_host_works_on(run_on):
    run, _ = run_on
    cluster = Cluster({("kf", 3)}, Fault.KILLED)
    run(cluster)
    seen = 0
    for task, beside in cluster.together[1:]:
        if ("kf", 3) in pairs(task):
            seen += 1
            assert not beside, "nothing else was on its host"
    assert seen >= 3


def test_workers_that_are_lost_from_outside_cost_nobody_a_run(run_on):
    run, every = run_on
    for fault in (Fault.LOST, Fault.SENT_BACK):
        done, given_up = run(Cluster(set(every), fault, strikes=2))
        assert done == every and not given_up


def test_what_no_worker_finishes_in_its_time_is_cut_and_comes_to_an_end(run_on):
    run, every = run_on
    wrong = {("kf", 3)}
    done, given_up = run(Cluster(wrong, Fault.SENT_BACK))
    assert done == sorted(set(every) - wrong) and given_up == [(wrong, True)]


def test_what_can_not_be_cut_is_given_up_after_as_many_lost_workers_as_told(tasks):
    one = tasks[0].pieces()[0].pieces()[0].pieces()[0]
    assert not one.pieces()
    queue = TaskQueue([one])
    lost = [queue.lost(queue.take()) for _ in range(TIMES_LOST)]
    assert lost == [False] * (TIMES_LOST - 1) + [True]
