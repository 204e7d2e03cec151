"""What the inference from all printed numbers found, where `replication/inverse` has written it: read, and in words."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

FINDINGS = Path(__file__).parent / "inverse" / "findings.json"
KEYS = ("alpha_kf", "mf_upf", "two_step_kf")


def read_findings(path: Path = FINDINGS) -> Mapping[str, Any]:
    """Return the findings by paper; empty where there is no file.

    Raises:
        ValueError: The file is no findings.
    """
    if not path.exists():
        return {}
    try:
        papers = json.loads(path.read_text(encoding="utf-8"))["papers"]
        return {key: papers[key] for key in KEYS if key in papers}
    except (KeyError, TypeError, json.JSONDecodeError) as error:
        raise ValueError(f"{path} holds no findings: {error}") from error


def possible(findings: Mapping[str, Any], claim: str) -> str:
    """Return what a claim can't do without and its share of the settings; nothing where no finding speaks of it.

    A finding's sentence tells after a semicolon where the claim mostly holds: that stands on the page of the settings.
    """
    for paper in findings.values():
        found = paper.get("claims", {}).get(claim)
        if found:
            condition = found["sentence"].partition(";")[0]
            share, low, high = (f"{100 * part:.2g}" for part in (found["probability"], *found["interval"]))
            return f"{condition} ({share} % of settings [{low}, {high}])"
    return ""


def paper_lines(paper: Mapping[str, Any]) -> list[str]:
    """Return what was found of one paper beside its claims: the bank, and what settings say of its sentences."""
    lines: list[str] = []
    bank = paper.get("bank")
    if bank:
        lines.append(
            f"{bank['campaigns']} short campaigns from the prior over what the paper leaves open, "
            f"{bank['cpu_hours']:.1f} CPU hours, seed {bank['seed']}."
        )
    for sentence in paper.get("sentences", ()):
        value = sentence.get("p_value")
        shown = f" (p = {value:.2g})" if value else ""
        lines.append(f"“{sentence['text']}”: {sentence['verdict']}{shown}.")
    return lines
