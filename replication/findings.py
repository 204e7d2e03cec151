"""What the inference from all printed numbers found, where `replication/inverse` has written it: read, and in words."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from relnav_sim.report.tables import Number, decimals_for

FINDINGS = Path(__file__).parent / "inverse" / "findings.json"
PAPER_OF = {"alpha_kf": "alpha_kf", "mf_upf": "mf_upf", "mf_upf_learned": "mf_upf", "two_step_kf": "two_step_kf"}
"""The paper of each bank: that of Wei et al. has one for the particle filter, and one with its learned dynamics."""
_PLAIN = {("the process noise", ("one for all",)): "process noises differ between filters"}
"""Conditions in plain words, by the setting and the choices that it excludes."""


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
    """Return in which share of the settings a claim holds, and what nearly all of these have; else nothing.

    What they have is needed, not enough: the claim may fail in a stated setting that has it.
    Where a claim mostly holds stands on the page of the settings.
    """
    for bank in findings.values():
        found = bank.get("claims", {}).get(claim)
        if found and not found["probability"]:
            return f"impossible: {why_impossible(found, bank)}"
        if found:
            needed, share = only_if(found), share_of_settings(found)
            return f"{share} of settings" + (f", nearly all where {needed}" if needed else "")
    return ""


def why_impossible(claim: Mapping[str, Any], bank: Mapping[str, Any]) -> str:
    """Return why a claim holds in no setting: what the finding says, or that none of so many settings has it."""
    told = str(claim.get("sentence", ""))
    if told.startswith("impossible: "):
        return told.removeprefix("impossible: ")
    return f"none of {bank['bank']['campaigns']} settings (at most {100 * claim['interval'][1]:.1g} %)"


def only_if(claim: Mapping[str, Any]) -> str:
    """Return the choices without which a claim does not hold; nothing if there are none."""
    return " and ".join(
        _PLAIN.get((each["name"], tuple(each["excluded"])), f"{each['name']} is {' or '.join(each['choices'])}")
        for each in claim.get("choices", ())
    )


def share_of_settings(found: Mapping[str, Any]) -> str:
    """Return a share in per cent with its interval, which decides how many digits both have."""
    value, low, high = (100 * part for part in (found["probability"], *found["interval"]))
    number = Number(value, low, high, decimals_for([value], [(high - low) / 2]))
    return f"{number.shown} % {number.shown_interval}"


def sentence_lines(paper: Mapping[str, Any]) -> list[str]:
    """Return what the settings of a bank say of sentences of the paper that are no claims."""
    lines: list[str] = []
    for sentence in paper.get("sentences", ()):
        value = sentence.get("p_value")
        shown = f" (p = {value:.2g})" if value else ""
        lines.append(f"{sentence['text'].rstrip('.')}: {sentence['verdict']}{shown}.")
    return lines
