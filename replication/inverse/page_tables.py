"""Tables of Markdown, and numbers in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table."""
    lines = ["| " + " | ".join(head) + " |", "|" + ":--|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def folded(summary: str, content: str) -> str:
    """Return content that opens at a click."""
    return f"<details><summary>{summary}</summary>\n\n{content}\n</details>\n"


def percent(value: float, digits: int = 2) -> str:
    """Return a share in per cent."""
    return f"{100 * value:.{digits}f} %"


def share(probability: float, interval: Sequence[float]) -> tuple[str, str]:
    """Return a share and its interval."""
    low, high = (f"{100 * end:.2f}" for end in interval)
    return percent(probability), f"{low} to {high}"
