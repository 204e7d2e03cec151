"""One call from nothing to verdicts: campaigns, results, summary, pages."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from relnav_sim.replication.compose import summarised
from relnav_sim.replication.measured import Measured
from relnav_sim.replication.pages import html_page, markdown_page
from relnav_sim.replication.plan import Size, run_plan
from relnav_sim.replication.summary import Summary, as_stored, written
from relnav_sim.results.atomic import written_whole

DOCS_FIGURES = "images/replication"
SUMMARY_FILE = "summary.json"


def reproduce(
    size: Size,
    campaigns: Path,
    out: Path,
    workers: int = 2,
    docs: Path | None = None,
    progress: bool = False,
    say: Callable[[str], None] = lambda sentence: None,
) -> Summary:
    """Replicate the papers; return the summary. What an earlier call has finished is taken as it is.

    ``out`` gets ``summary.json`` (the same bytes each time), ``index.html``, ``figures/`` and ``campaigns/`` (the
    results files).

    Args:
        size: ``trial``, ``usual`` or ``full``.
        campaigns: Folder of the campaign files.
        out: Folder of the results.
        workers: Processes.
        docs: Also write ``replication.md``, ``replication.json`` and their figures into this folder.
        progress: Show progress.
        say: Told what a user should know, a sentence at a time.

    Raises:
        CampaignError: A campaign file is missing or wrong.
        OSError: The output can't be written.
    """
    (out / "campaigns").mkdir(parents=True, exist_ok=True)
    paths = run_plan(size, campaigns, out / "campaigns", workers, progress, say)
    with Measured(paths) as measured:
        summary = as_stored(summarised(measured, size, out / "figures"))
        for line in timing_lines(measured):
            say(line)
    _write(out / SUMMARY_FILE, written(summary))
    _write(out / "index.html", html_page(summary, out / "figures"))
    if docs is not None:
        write_docs(summary, out / "figures", docs)
    return summary


def write_docs(summary: Summary, figures: Path, docs: Path) -> None:
    """Write the page of the documentation, its data and its figures."""
    target = docs / DOCS_FIGURES
    target.mkdir(parents=True, exist_ok=True)
    for part in summary.papers:
        for plot in part.plots:
            (target / f"{plot.name}.png").write_bytes((figures / f"{plot.name}.png").read_bytes())
    _write(docs / "replication.json", written(summary))
    _write(docs / "replication.md", markdown_page(summary, DOCS_FIGURES))


def timing_lines(measured: Measured) -> list[str]:
    """Return the measured CPU time of a step, by filter, for the cost claim: of this machine, so in no summary."""
    lines = []
    for label, campaign, filter in (
        ("KF(R/alpha)", "alpha_kf_gaussian", "kf_r2"),
        ("EKF", "alpha_kf_gaussian", "ekf"),
        ("UKF", "alpha_kf_gaussian", "ukf"),
        ("alpha filter, 512 fixed samples", "alpha_kf_gaussian", "alpha_kf"),
        ("alpha filter, 10000 random samples", "alpha_kf_draws", "random_0.5"),
    ):
        if measured.has(campaign, (filter,)):
            cost = measured.values(campaign, 0, filter, "cpu_us_per_step")
            lines.append(f"measured here: {label} {cost.mean():.1f} us a step and run")
    return lines


def _write(path: Path, text: str) -> None:
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
