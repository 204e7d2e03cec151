"""Which campaigns a replication runs, and how large each is: what decides a claim gets the runs."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from relnav_sim.campaign import Campaign, load_campaign
from relnav_sim.results.read import open_results
from relnav_sim.runner.executors.interface import Backend
from relnav_sim.runner.several import run_campaigns

Size = Literal["trial", "usual", "full"]
Say = Callable[[str], None]


@dataclass(frozen=True)
class Planned:
    """One campaign with its size.

    Attributes:
        name: The file without ``.yaml``.
        runs: Runs in the usual size.
        changes: What the usual size changes, as ``--set`` takes it.
        always: What every size changes.
        trial: What the trial changes besides its three runs.
        full_runs: Runs in the full size; default: those of the file.
        filters: The filters of the file that the usual size has; default: all of them.
        full_hours: CPU hours of the full size where it takes longer than an hour: the longest come last.
    """

    name: str
    runs: int
    changes: tuple[str, ...] = ()
    trial: tuple[str, ...] = ("clock.duration_s=120", "statistics.settle_s=60")
    full_runs: int | None = None
    always: tuple[str, ...] = ()
    filters: tuple[str, ...] = ()
    full_hours: float = 0.0


PLAN = (
    Planned("mf_upf", 15, ("block_runs=15",), ("clock.duration_s=1200",)),
    Planned("mf_upf_depletion", 8, ("block_runs=8",), ("clock.duration_s=1200",)),
    # Minutes a run: the paper has one, an interval needs a few.
    Planned(
        "mf_upf_particles",
        4,
        ("clock.duration_s=1500", "block_runs=2"),
        ("clock.duration_s=1200",),
        full_runs=100,
        full_hours=7.0,
    ),
    Planned(
        "mf_upf_size",
        4,
        ("clock.duration_s=1500",),
        ("clock.duration_s=1200",),
        full_runs=100,
        full_hours=1.5,
    ),
    # All of the runs in a block: the other worker has the next campaign, and a step of 100 costs less than two of 50.
    Planned("alpha_kf_gaussian", 100, ("block_runs=100",)),
    Planned("alpha_kf_mixture", 100, ("block_runs=100",)),
    # Its own settled span is the last 2000 s; the paper's tables are over all of the time.
    Planned("limit", 12, always=("statistics.settle_s=500",), filters=("kf", "imm", "imm_biases")),
    Planned("alpha_kf_sweep", 100, ("block_runs=100",)),
    Planned("alpha_kf_process_noise", 12),
    Planned("alpha_kf_bias", 12),
    Planned("alpha_kf_geometry", 16),
    Planned("alpha_kf_attitude", 16),
    Planned("alpha_kf_epsilon", 16),
    # 10000 draws an epoch cost a hundred times what a Kalman filter does: a fifth of the duration, and few runs.
    Planned(
        "alpha_kf_draws",
        4,
        ("clock.duration_s=1200", "block_runs=4"),
        ("clock.duration_s=60", "statistics.settle_s=30"),
        full_hours=4.0,
    ),
    # The shortest blocks last: no worker then waits long for the other's.
    Planned("two_step", 100, trial=("clock.duration_s=200",)),
    Planned("alpha_kf_start", 100, trial=()),
)
TRIAL_RUNS = 3


def planned_campaign(planned: Planned, size: Size, folder: Path) -> Campaign:
    """Return a campaign of the plan in a size.

    Raises:
        CampaignError: The file is missing or wrong.
    """
    path = folder / f"{planned.name}.yaml"
    runs = {"usual": planned.runs, "full": planned.full_runs, "trial": TRIAL_RUNS}[size]
    # The trial's changes come last: its span is shorter.
    changes = planned.always + {"usual": planned.changes, "full": (), "trial": planned.trial}[size]
    changes = (*(() if runs is None else (f"runs={runs}",)), *changes)
    campaign = load_campaign(path, changes)
    if size != "usual" or not planned.filters:
        return campaign
    chosen = {name: campaign.content["filters"][name] for name in planned.filters}
    return load_campaign(path, (*changes, f"filters={json.dumps(chosen)}"))


def in_order(size: Size) -> list[Planned]:
    """Return the plan in the order in which it is run: in full, what takes hours comes last.

    A full replication that is ended early has then left as many complete results as it could.
    """
    return sorted(PLAN, key=lambda planned: planned.full_hours) if size == "full" else list(PLAN)


def complete_in_full(campaigns: Path, results: Path, say: Say = lambda sentence: None) -> dict[str, Path]:
    """Return the results of the full size that are complete, by name of the campaign.

    Args:
        campaigns: Folder of the campaign files.
        results: Folder of the results files of the full size; it need not exist.
        say: Told of the files that can't be taken.

    Raises:
        CampaignError: A campaign file is missing or wrong.
        ResultsError: A results file is damaged.
    """
    found = {}
    for planned in PLAN:
        path = results / f"{planned.name}.h5"
        if not path.exists():
            continue
        campaign = planned_campaign(planned, "full", campaigns)
        with open_results(path) as held:
            same = held.campaign_hash == campaign.hash and len(held.runs) >= campaign.runs
            if same and not held.missing():
                found[planned.name] = path
            else:
                what = "runs are missing" if same else "it is of other settings, or of fewer runs, than the plan"
                say(f"{path} is not taken: {what}")
    return found


def run_plan(
    size: Size,
    campaigns: Path,
    out: Path,
    workers: int,
    progress: bool,
    say: Say,
    backend: Backend = "loky",
    scheduler: str | None = None,
    timeout_s: float | None = None,
) -> dict[str, Path]:
    """Run every campaign of the plan; what is finished is taken as it is. Return the results files by name.

    Args:
        size: ``trial`` (minutes, proves nothing), ``usual`` or ``full`` (the papers' sizes).
        campaigns: Folder of the campaign files.
        out: Folder of the results files.
        workers: Processes.
        progress: Show progress.
        say: Told what a user should know, a sentence at a time.
        backend: As in `run_campaign`.
        scheduler: As in `run_campaign`.
        timeout_s: As in `run_campaign`.

    Raises:
        CampaignError: A campaign file is missing or wrong.
    """
    # All files are read first: a mistake in the last one should not show after an hour.
    loaded = [(planned.name, planned_campaign(planned, size, campaigns)) for planned in in_order(size)]
    paths = {planned.name: out / f"{planned.name}.h5" for planned in PLAN}
    for number, (name, campaign) in enumerate(loaded, start=1):
        cases = "1 case" if len(campaign.cases) == 1 else f"{len(campaign.cases)} cases"
        say(f"campaign {number} of {len(loaded)}: {name}, {cases} of {campaign.runs} runs")
    jobs = [(campaign, paths[name]) for name, campaign in loaded]
    run_campaigns(jobs, workers, progress, say, backend, scheduler, timeout_s)
    return paths
