"""Everything about Wei, Song and Zhang (2012): index, tables, figures, causes."""

from __future__ import annotations

from pathlib import Path

from relnav_sim.replication.measured import Measured
from relnav_sim.replication.papers import papers
from relnav_sim.replication.summary import PaperPart
from relnav_sim.report.tables import Column, Row, Table, Words


def part(measured: Measured, folder: Path) -> PaperPart:
    """Return the paper's part of the summary; its figures are written to a folder."""
    paper = papers()["mf_upf"]
    return PaperPart(
        key=paper.key,
        short=paper.short,
        citation=paper.citation,
        scenario=paper.scenario,
        silent=paper.silent,
        learned=(),
        index=_index(),
        tables=(),
        plots=(),
        experiments=(),
        beyond=(),
    )


def _index() -> Table:
    rows = (
        ("Fig. 1", "Frames of chief and deputy. No numbers: docs/frames.md."),
        ("Tables 1, 2", "Orbit, masses and radar: the campaign's truth and sensors sections."),
        ("Fig. 2", "Relative position in the orbit plane."),
        ("Fig. 3", "Position error."),
        ("Fig. 4", "Velocity error."),
    )
    return Table(
        "index_mf_upf",
        "The paper's tables and figures, by number",
        "",
        "in the paper",
        (Column("here", numeric=False),),
        tuple(Row(number, (Words(text),)) for number, text in rows),
    )
