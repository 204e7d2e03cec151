"""One call from nothing to verdicts: campaigns, results, summary, pages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from relnav_sim.results.atomic import written_whole
from relnav_sim.runner.executors.interface import Backend
from replication.compose import summarised
from replication.measured import Measured
from replication.pages import html_page, markdown_page
from replication.plan import Size, complete_in_full, run_plan
from replication.summary import Summary, as_stored, fingerprint, written

DOCS_FIGURES = "images/replication"
SUMMARY_FILE = "summary.json"


def reproduce(
    size: Size,
    campaigns: Path,
    out: Path,
    workers: int = 2,
    docs: Path | None = None,
    in_full: Path | None = None,
    progress: bool = False,
    say: Callable[[str], None] = lambda sentence: None,
    backend: Backend = "loky",
    scheduler: str | None = None,
    timeout_s: float | None = None,
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
        in_full: With docs: the folder of a replication of the full size; each of its campaigns that is complete
            takes the place of the usual one in the docs, and in nothing else.
        progress: Show progress.
        say: Told what a user should know, a sentence at a time.
        backend: Where the campaigns are computed; the summary does not depend on it.
        scheduler: As in `run_campaign`.
        timeout_s: As in `run_campaign`.

    Raises:
        CampaignError: A campaign file is missing or wrong.
        OSError: The output can't be written.
    """
    (out / "campaigns").mkdir(parents=True, exist_ok=True)
    paths = run_plan(size, campaigns, out / "campaigns", workers, progress, say, backend, scheduler, timeout_s)
    with Measured(paths) as measured:
        summary = as_stored(summarised(measured, size, out / "figures"))
        for line in timing_lines(measured):
            say(line)
    _write(out / SUMMARY_FILE, written(summary))
    _write(out / "index.html", html_page(summary, out / "figures"))
    if docs is not None:
        larger = {} if in_full is None else complete_in_full(campaigns, in_full / "campaigns", say)
        if larger:
            say(f"in the docs at full size: {', '.join(larger)}")
        write_docs(summary, paths, larger, docs)
    return summary


def write_docs(summary: Summary, paths: Mapping[str, Path], larger: Mapping[str, Path], docs: Path) -> None:
    """Write the page of the documentation, its data and its figures.

    Args:
        summary: What was found in one size.
        paths: Results files of that size, by name of the campaign.
        larger: Results files of the full size that take their place.
        docs: The folder.
    """
    target = docs / DOCS_FIGURES
    target.mkdir(parents=True, exist_ok=True)
    with Measured({**paths, **larger}) as measured:
        shown = as_stored(summarised(measured, "mixed" if larger else summary.size, target, larger))
    if larger:
        shown = replace(shown, usual_sha256=fingerprint(summary))
    _write_page(shown, docs)


def _write_page(summary: Summary, docs: Path) -> None:
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
