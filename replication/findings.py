"""What the inference from all printed numbers found, where `replication/inverse` has written it: read, and in words."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

FINDINGS = Path(__file__).parent / "inverse" / "findings.json"
PAPER_OF = {"alpha_kf": "alpha_kf", "mf_upf": "mf_upf", "mf_upf_learned": "mf_upf", "two_step_kf": "two_step_kf"}
"""The paper of each bank: that of Wei et al. has one for the particle filter, and one with its learned dynamics."""


def read_findings(path: Path = FINDINGS) -> Mapping[str, Any]:
    """Return the findings by bank; empty where there is no file.

    Raises:
        ValueError: The file is no findings.
    """
    if not path.exists():
        return {}
    try:
        papers = json.loads(path.read_text(encoding="utf-8"))["papers"]
        return {key: papers[key] for key in PAPER_OF if key in papers}
    except (KeyError, TypeError, json.JSONDecodeError) as error:
        raise ValueError(f"{path} holds no findings: {error}") from error


def possible(findings: Mapping[str, Any], claim: str) -> str:
    """Return in which share of the settings a claim holds, and what it can't do without; nothing without a finding.

    Where a claim mostly holds, which a finding tells after a semicolon, stands on the page of the settings.
    """
    for bank in findings.values():
        found = bank.get("claims", {}).get(claim)
        if found:
            share, low, high = (_percent(part) for part in (found["probability"], *found["interval"]))
            if found["probability"] and not found.get("choices"):
                return f"{share} % of settings [{low}, {high}]"
            return f"{found['sentence'].partition(';')[0]} ({share} % [{low}, {high}])"
    return ""


def _percent(share: float) -> str:
    return f"{100 * share:.2g}" if share < 0.995 else f"{100 * share:.0f}"


def sentence_lines(paper: Mapping[str, Any]) -> list[str]:
    """Return what the settings of a bank say of sentences of the paper that are no claims."""
    lines: list[str] = []
    for sentence in paper.get("sentences", ()):
        value = sentence.get("p_value")
        shown = f" (p = {value:.2g})" if value else ""
        lines.append(f"“{sentence['text']}”: {sentence['verdict']}{shown}.")
    return lines
