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

Size = Literal["trial", "subset", "full"]
Say = Callable[[str], None]


@dataclass(frozen=True)
class Planned:
    """One campaign with its size.

    A smaller size has the first of the runs of a larger one: the same random numbers, the same figures.

    Attributes:
        name: The file without ``.yaml``.
        subset_runs: Runs that `make reproduce` computes again; 0: it leaves the campaign out.
        full_runs: Runs of the full size.
        always: What every size changes, as ``--set`` takes it.
        trial: What the trial changes besides its three runs.
        filters: The filters of the file that are run; default: all of them.
        subset_filters: The filters of the subset; default: all that are run.
    """

    name: str
    subset_runs: int
    full_runs: int
    always: tuple[str, ...] = ()
    trial: tuple[str, ...] = ("clock.duration_s=120", "statistics.settle_s=60")
    filters: tuple[str, ...] = ()
    subset_filters: tuple[str, ...] = ()


# In the order in which they are run: what decides the most claims for the least time first, hours last.
PLAN = (
    Planned("two_step", 20, 100, trial=("clock.duration_s=200",)),
    Planned("alpha_kf_start", 20, 100, trial=()),
    Planned("alpha_kf_orbit", 10, 100),
    Planned("alpha_kf_gaussian", 10, 100),
    Planned(
        "mf_upf_depletion",
        4,
        40,
        trial=("clock.duration_s=1200",),
        subset_filters=("pf", "pf_50", "pf_roughened", "ekf", "open_loop"),
    ),
    Planned("alpha_kf_mixture", 10, 100),
    Planned("alpha_kf_tuned", 0, 100),
    # Stored more often than the file says, for the box plots' outliers.
    Planned("alpha_kf_sweep", 10, 100, always=("clock.store_every_s=20",)),
    # A run costs a minute of processor time and more: the paper has one, an interval needs a few.
    Planned(
        "mf_upf_particles",
        2,
        12,
        trial=("clock.duration_s=1200",),
        subset_filters=("pf", "pf_no_roughening", "ekf_paper_q", "gp_particle_absolute_truth"),
    ),
    Planned("alpha_kf_sweep_tuned", 0, 100, always=("clock.store_every_s=20",)),
    Planned("alpha_kf_process_noise", 0, 100),
    Planned("alpha_kf_bias", 0, 100, always=("clock.store_every_s=20",)),
    Planned("alpha_kf_epsilon", 4, 100),
    Planned("alpha_kf_geometry", 4, 100),
    Planned("alpha_kf_attitude", 4, 100),
    # 10000 draws an epoch cost a hundred times what a Kalman filter does.
    Planned("alpha_kf_draws", 0, 4, trial=("clock.duration_s=60", "statistics.settle_s=30")),
    Planned("mf_upf", 4, 40, trial=("clock.duration_s=1200",), subset_filters=("ekf_paper_q", "gp_ukf_absolute_truth")),
    Planned("mf_upf_size", 0, 8, trial=("clock.duration_s=1200",)),
    # Its own steady state is the last 2000 s; the paper's tables are over all of the time.
    Planned("limit", 0, 40, always=("statistics.settle_s=500",), filters=("kf", "imm", "imm_biases")),
)
TRIAL_RUNS = 3


def planned_campaign(planned: Planned, size: Size, folder: Path) -> Campaign:
    """Return a campaign of the plan in a size.

    Raises:
        CampaignError: The file is missing or wrong.
    """
    path = folder / f"{planned.name}.yaml"
    runs = {"subset": planned.subset_runs, "full": planned.full_runs, "trial": TRIAL_RUNS}[size]
    # The trial's changes come last: its span is shorter.
    changes = (f"runs={runs}", *planned.always, *(planned.trial if size == "trial" else ()))
    campaign = load_campaign(path, changes)
    wanted = planned.subset_filters if size == "subset" and planned.subset_filters else planned.filters
    if not wanted:
        return campaign
    chosen = {name: campaign.content["filters"][name] for name in wanted}
    # Requirements may name filters that are left out; they judge a result, which is done here.
    return load_campaign(path, (*changes, f"filters={json.dumps(chosen)}", "requirements={}"))


def of_size(size: Size) -> list[Planned]:
    """Return what a size runs, in order."""
    return [planned for planned in PLAN if size != "subset" or planned.subset_runs]


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
        size: ``trial`` (minutes, proves nothing), ``subset`` (compared with the full size) or ``full``.
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
    loaded = [(planned.name, planned_campaign(planned, size, campaigns)) for planned in of_size(size)]
    paths = {planned.name: out / f"{planned.name}.h5" for planned in of_size(size)}
    for number, (name, campaign) in enumerate(loaded, start=1):
        cases = "1 case" if len(campaign.cases) == 1 else f"{len(campaign.cases)} cases"
        say(f"campaign {number} of {len(loaded)}: {name}, {cases} of {campaign.runs} runs")
    jobs = [(campaign, paths[name]) for name, campaign in loaded]
    run_campaigns(jobs, workers, progress, say, backend, scheduler, timeout_s)
    return paths
