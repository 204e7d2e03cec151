"""A campaign over two machines that share no folder: shards travel, a machine dies, the link is cut."""

from __future__ import annotations

import re
import signal
import sys

import pytest
from relnav_process import RELNAV, wait_until
from small_campaign import assert_same_bits
from two_machines import two_machines

from relnav_sim import load_campaign, open_results, run_campaign
from relnav_sim.runner.event_log import NAME, read_events

pytestmark = pytest.mark.slow

LONGER = (("runs: 6", "runs: 24"), ("duration_s: 40", "duration_s: 3000"))
SCHEDULER = "tcp://10.77.0.1:8786"
DASK = [sys.executable, "-m"]


class Campaign:
    """A campaign on machine a, with a scheduler there and a worker on each machine; the results are only on a."""

    def __init__(self, relnav, machines):
        self.here = relnav(*LONGER)
        self.a, self.b = machines
        self.here.out.parent.mkdir()
        self.scheduler = self.a.start(
            [*DASK, "distributed.cli.dask_scheduler", "--no-dashboard", "--port", "8786"],
            self.here.folder,
            hides=self.here.folder / "results",
        )
        self.a_worker, self.b_worker = self.worker(self.a), self.worker(self.b)

    def worker(self, machine):
        command = [*DASK, "distributed.cli.dask_worker", "--no-dashboard", "--nthreads", "1", SCHEDULER]
        return machine.start(command, self.here.folder, hides=self.here.folder / "results")

    def run(self, machine):
        process = machine.start(
            [*RELNAV, "run", "small.yaml", "--backend", "dask", "--scheduler", SCHEDULER], self.here.folder
        )
        return process

    def events(self, name):
        log = self.here.shards / NAME
        return [event for event in read_events(log) if event["event"] == name] if log.exists() else []

    def is_at_work(self, machine):
        """Return whether blocks were done here and another one is under way."""
        started = [event["block"] for event in self.events("start") if event["host"] == machine.address]
        done = [event["block"] for event in self.events("done") if event["host"] == machine.address]
        return len(done) >= 1 and len(started) > len(done)

    def same_bits(self):
        reference = self.here.folder / "reference.h5"
        run_campaign(load_campaign(self.here.folder / "small.yaml"), reference)
        assert_same_bits(reference, self.here.out)
        with open_results(self.here.out) as results:
            machines = " ".join(results.provenance.machines)
        assert re.search("machine-a.*machine-b", machines), machines
        return True


@pytest.fixture
def campaign(relnav):
    machines = two_machines()
    try:
        yield Campaign(relnav, machines)
    finally:
        for machine in machines:
            machine.end()


def finished(process, seconds=240):
    _, stderr = process.communicate(timeout=seconds)
    assert "Traceback" not in stderr, stderr
    return process.returncode, stderr


def test_a_machine_is_killed(campaign):
    process = campaign.run(campaign.a)
    assert wait_until(lambda: campaign.is_at_work(campaign.b) or process.poll() is not None)
    campaign.b.send(campaign.b_worker, signal.SIGKILL)
    code, stderr = finished(process)
    assert code == 0, stderr
    (again,) = campaign.events("retry")
    assert again["fault"] == "lost" and again["host"] == campaign.b.address
    assert "a worker on 10.77.0.2 is gone, with case " in stderr and "; computed again" in stderr
    assert campaign.same_bits()


def test_all_processes_of_a_machine_are_told_to_end(campaign):
    """As a batch system does at the end of a job's time."""
    process = campaign.run(campaign.a)
    assert wait_until(lambda: campaign.is_at_work(campaign.b) or process.poll() is not None)
    campaign.b.send(campaign.b_worker, signal.SIGTERM)
    code, stderr = finished(process)
    assert code == 0, stderr
    assert {event["fault"] for event in campaign.events("retry")} == {"sent back"}, "nobody is to blame"
    assert "is gone" not in stderr
    assert campaign.same_bits()


def test_the_link_to_a_worker_is_cut(campaign):
    process = campaign.run(campaign.a)
    assert wait_until(lambda: campaign.is_at_work(campaign.b) or process.poll() is not None)
    campaign.b.link("down")
    code, stderr = finished(process)
    assert code == 0, stderr
    assert {event["fault"] for event in campaign.events("retry")} <= {"lost"}
    assert campaign.same_bits()


def test_the_link_to_the_scheduler_is_cut_and_the_same_command_goes_on(campaign):
    process = campaign.run(campaign.b)
    assert wait_until(lambda: campaign.is_at_work(campaign.b) or process.poll() is not None)
    campaign.b.link("down")
    code, stderr = finished(process, 90)
    assert code == 3, stderr
    assert f"the Dask scheduler is gone ({SCHEDULER}); what is finished is kept" in stderr
    campaign.b.link("up")
    campaign.worker(campaign.b)
    code, stderr = finished(campaign.run(campaign.b))
    assert code == 0 and " finished blocks found; " in stderr, stderr
    assert campaign.same_bits()
