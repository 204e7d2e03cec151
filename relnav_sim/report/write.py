"""One call from a results file to a report on disk."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from relnav_sim.plots.axes import checked_axes
from relnav_sim.printable import visible
from relnav_sim.report import html, markdown
from relnav_sim.report.compose import MOST_FIGURES, compose
from relnav_sim.report.drawing import FigureFolder
from relnav_sim.report.latex import latex, latex_sentences
from relnav_sim.report.page import page_tables
from relnav_sim.report.sentences import plain
from relnav_sim.report.tables import comma_separated
from relnav_sim.results.atomic import written_whole

FORMATS = ("html", "md", "csv", "latex")
USUAL = ("html", "md", "csv")


def write_report(
    result_path: str | Path,
    out_dir: str | Path | None = None,
    formats: Iterable[str] = USUAL,
    axes: str = "rtn",
    most_figures: int = MOST_FIGURES,
    workers: int = 2,
    cases: Sequence[int | str] | None = None,
    say: Callable[[str], object] | None = None,
    tell: Callable[[str], object] | None = None,
) -> Path:
    """Write the report of a result.

    ``index.html`` is one file that opens from disk and asks for nothing from anywhere; ``report.md``,
    ``tables/*.csv`` and ``tables/*.tex`` hold the same tables; ``figures/`` holds every figure as PNG, with
    ``latex`` as PDF too.

    Args:
        result_path: The results file.
        out_dir: Folder of the report; default: beside the result, with its name without the suffix.
        formats: Any of ``html``, ``md``, ``csv`` and ``latex``.
        axes: ``rtn`` (x radial out, y along-track, z orbit normal) or ``shi2025`` (x along-track, y minus orbit
            normal, z nadir, as Shi et al. 2025 tabulate).
        most_figures: How many figures to draw; the first case always gets its own. The rest can be drawn with
            the functions of ``relnav_sim.plots``.
        workers: Processes that make the cases of a large campaign, this one included.
        cases: The cases to show closely, each with its tables and figures, by number from 0, id, or label as printed;
            default: all, of more than 50 the first.
        say: Is given a sentence for each figure or table that could not be made. The page has these sentences too, in
            the places of those parts.
        tell: Is given the decision, in a sentence.

    Returns:
        The HTML file; without ``html`` the first of the others: ``report.md`` or the folder ``tables``.

    Raises:
        ValueError: An unknown format or unknown axes.
        ResultsError: The result can't be read.
        OSError: The report can't be written.
    """
    from relnav_sim.results.read import open_results

    wanted, turned = _checked_formats(formats), checked_axes(axes)
    path = Path(result_path)
    folder = Path(out_dir) if out_dir is not None else path.with_suffix("")
    with open_results(path) as results:
        shown = None if cases is None else [results.case_index(case) for case in cases]
        (folder / "figures").mkdir(parents=True, exist_ok=True)
        page = compose(
            results, FigureFolder(folder / "figures", "latex" in wanted), turned, most_figures, workers, shown
        )
    if say is not None:
        for sentence in page.all_missing:
            say(sentence)
    if tell is not None and page.decision is not None:
        tell(plain(page.decision.lead))
    written: dict[str, Path] = {}
    if "html" in wanted:
        written["html"] = _write(folder / "index.html", html.render(page))
    if "md" in wanted:
        written["md"] = _write(folder / "report.md", markdown.render(page))
    for form, suffix, made in (("csv", "csv", comma_separated), ("latex", "tex", latex)):
        if form not in wanted:
            continue
        written[form] = folder / "tables"
        written[form].mkdir(exist_ok=True)
        for table in page_tables(page):
            _write(written[form] / f"{table.name}.{suffix}", made(table))
    if "latex" in wanted and page.decision is not None:
        sentences = (page.decision.lead, *page.decision.others)
        _write(folder / "decision.tex", latex_sentences(sentences))
    return next(iter(written.values()))


def _checked_formats(formats: Iterable[str]) -> tuple[str, ...]:
    wanted = tuple(dict.fromkeys(formats))
    if not wanted or (unknown := sorted(set(wanted) - set(FORMATS))):
        found = f"not {unknown[0]!r}" if wanted else "at least one"
        raise ValueError(f"formats must be of {', '.join(FORMATS)}, {found}")
    return tuple(form for form in FORMATS if form in wanted)


def _write(path: Path, text: str) -> Path:
    with written_whole(path) as temporary:
        temporary.write_text(visible(text), encoding="utf-8", newline="\n")
    return path
