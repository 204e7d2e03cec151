"""One call from a results file to a report on disk."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from relnav_sim.plots.axes import checked_axes
from relnav_sim.printable import visible
from relnav_sim.report import html, markdown
from relnav_sim.report.compose import MOST_FIGURES, compose
from relnav_sim.report.drawing import FigureFolder
from relnav_sim.report.garbage import collected_rarely
from relnav_sim.report.latex import latex, latex_sentences
from relnav_sim.report.page import Page, page_tables
from relnav_sim.report.sentences import plain
from relnav_sim.report.tables import comma_separated
from relnav_sim.results.atomic import written_whole

FORMATS = ("html", "md", "csv", "latex")
USUAL = ("html", "md", "csv")
_WRITTEN_AT_ONCE = 16  # files


@collected_rarely()
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
    return _written(folder, wanted, page)


def _written(folder: Path, formats: Sequence[str], page: Page) -> Path:
    """Write a page in some formats; return the file or folder of the first."""
    first: list[Path] = []
    texts: dict[Path, str] = {}
    if "html" in formats:
        first.append(folder / "index.html")
        texts[first[-1]] = html.render(page)
    if "md" in formats:
        first.append(folder / "report.md")
        texts[first[-1]] = markdown.render(page)
    for form, suffix, made in (("csv", "csv", comma_separated), ("latex", "tex", latex)):
        if form in formats:
            first.append(folder / "tables")
            first[-1].mkdir(exist_ok=True)
            texts |= {first[-1] / f"{table.name}.{suffix}": made(table) for table in page_tables(page)}
    if "latex" in formats and page.decision is not None:
        texts[folder / "decision.tex"] = latex_sentences((page.decision.lead, *page.decision.others))
    _write(texts)
    return first[0]


def _checked_formats(formats: Iterable[str]) -> tuple[str, ...]:
    wanted = tuple(dict.fromkeys(formats))
    if not wanted or (unknown := sorted(set(wanted) - set(FORMATS))):
        found = f"not {unknown[0]!r}" if wanted else "at least one"
        raise ValueError(f"formats must be of {', '.join(FORMATS)}, {found}")
    return tuple(form for form in FORMATS if form in wanted)


def _write(texts: Mapping[Path, str]) -> None:
    """Write files, each whole or not at all; the disk takes what several wait for faster than one after the other."""

    def write(path: Path) -> None:
        with written_whole(path) as temporary:
            temporary.write_text(visible(texts[path]), encoding="utf-8", newline="\n")

    with ThreadPoolExecutor(_WRITTEN_AT_ONCE) as threads:
        list(threads.map(write, texts))
