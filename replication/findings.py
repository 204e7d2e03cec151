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
    """Return a claim's sentence with its probability, or nothing where the inference does not speak of it."""
    for paper in findings.values():
        found = paper.get("claims", {}).get(claim)
        if found:
            low, high = found["interval"]
            return f"{found['sentence']} (probability {found['probability']:.2f} [{low:.2f}, {high:.2f}])"
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
        shown = f" (p = {value:.3g})" if isinstance(value, (int, float)) else ""
        lines.append(f"“{sentence['text']}”: {sentence['verdict']}{shown}.")
    return lines
