"""The whole replication: campaigns, summaries, verdicts, figures and pages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from relnav_sim.results.atomic import written_whole
from relnav_sim.runner.executors.interface import Backend
from replication.committed import FOLDER, committed, renew
from replication.compare import Comparison, compared
from replication.compose import summarised
from replication.evidence_page import evidence_page
from replication.extract import Extract, extracted
from replication.figure_files import save
from replication.findings import read_findings
from replication.html_page import html_page
from replication.listed import literal_text
from replication.measured import Measured
from replication.pages import markdown_page
from replication.plan import Size, complete_in_full, run_plan
from replication.summary import Summary, written

DOCS_FIGURES = "images/replication"
SUMMARY_FILE = "summary.json"
Say = Callable[[str], None]


def reproduce(
    size: Size,
    campaigns: Path,
    out: Path,
    workers: int = 2,
    progress: bool = False,
    say: Say = lambda sentence: None,
    backend: Backend = "loky",
    scheduler: str | None = None,
    timeout_s: float | None = None,
    summaries: Path = FOLDER,
) -> Summary:
    """Replicate the papers; return the summary. What an earlier call has finished is taken as it is.

    ``out`` gets ``summary.json``, ``index.html``, ``figures/`` and ``campaigns/`` (the results files). The subset is
    compared with the committed summaries, of which the pages are made; the full size renews them.

    Args:
        size: ``trial``, ``subset`` or ``full``.
        campaigns: Folder of the campaign files.
        out: Folder of the results.
        workers: Processes.
        progress: Show progress.
        say: Told what a user should know, a sentence at a time.
        backend: Where the campaigns are computed; the summary does not depend on it.
        scheduler: As in `run_campaign`.
        timeout_s: As in `run_campaign`.
        summaries: Folder of the committed summaries.

    Raises:
        CampaignError: A campaign file is missing or wrong.
        OSError: The output can't be written.
        ValueError: A committed summary is damaged.
    """
    (out / "campaigns").mkdir(parents=True, exist_ok=True)
    paths = run_plan(size, campaigns, out / "campaigns", workers, progress, say, backend, scheduler, timeout_s)
    if size == "trial":
        measured = {name: extracted(path) for name, path in paths.items()}
    else:
        if size == "full":
            renew(complete_in_full(campaigns, out / "campaigns", say), summaries, say)
        measured = committed(campaigns, summaries, say)
    if size == "subset":
        for comparison in comparisons(paths, measured):
            say(comparison.in_words())
    summary = summarised(Measured(measured), "trial" if size == "trial" else "full", read_findings())
    _write(out / SUMMARY_FILE, written(summary))
    draw(summary, out / "figures")
    _write(out / "index.html", html_page(summary, out / "figures"))
    return summary


def comparisons(paths: Mapping[str, Path], held: Mapping[str, Extract]) -> list[Comparison]:
    """Return how the campaigns that were computed here compare with the committed summaries."""
    found = []
    for name, path in paths.items():
        here = extracted(path)
        found.append(compared(here, held[name]) if name in held else Comparison(name, 0, 0, 0, 0.0, ""))
    return found


def write_docs(
    campaigns: Path,
    docs: Path,
    in_full: Path,
    say: Say = lambda sentence: None,
    summaries: Path = FOLDER,
) -> Summary:
    """Write the two pages of the documentation and their figures from the committed summaries; runs nothing.

    Args:
        campaigns: Folder of the campaign files.
        docs: Folder of the documentation.
        in_full: Folder of a replication of the full size; the summaries of its complete campaigns are renewed first. It
            need not exist.
        say: Told what a user should know, a sentence at a time.
        summaries: Folder of the committed summaries.

    Raises:
        CampaignError: A campaign file is missing or wrong.
        OSError: The output can't be written.
        ValueError: A committed summary is damaged.
    """
    renew(complete_in_full(campaigns, in_full / "campaigns", say), summaries, say)
    summary = summarised(Measured(committed(campaigns, summaries, say)), "full", read_findings())
    draw(summary, docs / DOCS_FIGURES)
    _write(docs / "replication.md", markdown_page(summary))
    _write(docs / "replication-evidence.md", evidence_page(summary, DOCS_FIGURES, literal_text(campaigns)))
    return summary


def draw(summary: Summary, folder: Path) -> None:
    """Draw every figure of a summary into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for part in summary.papers:
        for plot in part.plots:
            save(folder, plot.name, plot.draw())


def _write(path: Path, text: str) -> None:
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
