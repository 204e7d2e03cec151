"""Lists that stand in data files, as tables: how the rules changed, where relnav deviates from the papers."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from relnav_sim.report.tables import plain_markdown


def pipe_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table; a cell in back quotes stays as it is."""
    lines = [f"| {' | '.join(head)} |", f"|{':--|' * len(head)}"]
    for row in rows:
        cells = (cell if cell.startswith("`") else plain_markdown(" ".join(cell.split())) for cell in row)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def deviation_table(literal: str) -> str:
    """Return where relnav's usual settings differ from the papers, as a Markdown table.

    Args:
        literal: Text of the campaigns that fly the papers literally: a switch is shown where they set it.
    """
    rows = []
    for item in entries("deviations.yaml"):
        switch = item["switch"]
        shown = f"`{switch}`" if switch and switch in literal else "–"
        rows.append((item["paper"], item["relnav"], item["printed"], shown))
    table = pipe_table(("paper", "relnav", "the paper", "switch"), rows)
    if literal:
        given = "[what that gives](filters.md#as-published) is not what the verdicts go by"
        return f"{table}\n\n`campaigns/papers_literal*.yaml` set the switches; {given}."
    return f"{table}\n\nA campaign that sets the papers' own ways is not here yet."


def entries(name: str) -> list[dict[str, str]]:
    """Return the entries of a data file of this package."""
    import yaml

    content: list[dict[str, str]] = yaml.safe_load((files("replication") / name).read_text(encoding="utf-8"))
    return content


def literal_text(campaigns: Path) -> str:
    """Return the text of the campaigns that fly the papers literally; empty where there are none."""
    return "\n".join(path.read_text(encoding="utf-8") for path in sorted(campaigns.glob("papers_literal*.yaml")))
