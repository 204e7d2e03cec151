"""The page of settings, made of the findings: verdicts first, then what they rest on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from replication.findings import only_if, sentence_lines, share_of_settings, why_impossible
from replication.inverse.page_coverage import banks_and_coverage
from replication.inverse.page_evidence import evidence, is_reached, searches_reached
from replication.inverse.page_tables import column_words, escaped, percent, plain
from replication.papers import paper_of, papers

PAGE = "replication-settings.md"
_EVIDENCE = "replication-evidence.md"
BANKS = {"mf_upf": ("mf_upf", "mf_upf_learned")}
"""Banks of a paper that has more than one."""

_HEAD = """# Which settings give the printed numbers

The papers leave settings open. This page judges each claim over all of them: in which share of the settings it holds,
with a 95 % interval, and what these settings have in common. [The page of verdicts](replication.md) judges the same
claims in stated settings.

## Verdicts
"""
_METHOD = """## Method

A prior says how likely each value of an open setting is before any printed number is looked at. A bank of short
campaigns, one for each setting drawn from the prior, answers all questions. A claim holds in a setting if its rule
holds on the numbers of that one run: at least half of a published reduction, a size within a factor of two. "Only if"
names choices without which at most 1 % of the settings with a claim do; "mostly where" the interval that 90 % of them
meet and the fewest others, with the share of all that do. A consistent paper is synthetic: one run of one setting.

`make inverse` does all of it; replication/inverse/findings.json has all that is found, with seeds and digests.
"""
_KNOWN = (
    "Of tables of synthetic papers whose settings are known, all tables together counted as one more, the same search "
    "reached {reached}."
)
_IMPOSSIBLE, _POSSIBLE = "Impossible under the stated conditions", "Reproduced with some of the settings"


def page_of(findings: Mapping[str, Any]) -> str:
    """Return the page, Markdown."""
    banks = {name: findings["papers"][name] for key in papers() for name in _names(key) if name in findings["papers"]}
    parts = [_HEAD, *_verdicts(banks), *_together(banks), _METHOD, *banks_and_coverage(banks)]
    for key, paper in papers().items():
        parts.append(f"## {paper.short}\n")
        for name in _names(key):
            parts += evidence(name, banks.get(name, {}))
    return "\n".join(parts).rstrip() + "\n"


def _names(key: str) -> tuple[str, ...]:
    return BANKS.get(key, (key,))


def _verdicts(banks: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield the claims, by what they take."""
    groups: dict[str, list[str]] = {_IMPOSSIBLE: []}
    told = {claim: (found, bank) for bank in banks.values() for claim, found in bank.get("claims", {}).items()}
    for claim in (name for paper in papers().values() for name in paper.claims if name in told):
        found, bank = told[claim]
        needed = only_if(found)
        title = _IMPOSSIBLE if not found["probability"] else f"Possible only if {needed}" if needed else _POSSIBLE
        groups.setdefault(title, []).append(_claim(claim, found, bank))
    order = sorted(groups, key=lambda title: (title != _IMPOSSIBLE, title == _POSSIBLE))
    counts = [f"{len(groups[title])} {title[:1].lower() + title[1:]}" for title in order if groups[title]]
    if counts:
        yield f"Of {len(told)} claims: {'; '.join(counts)}. Shares are of all settings.\n"
    for title in order:
        if groups[title]:
            yield f"### {title}\n"
            yield _bullets(groups[title])


def _claim(claim: str, found: Mapping[str, Any], bank: Mapping[str, Any]) -> str:
    text = escaped(paper_of(claim).claims[claim].rstrip("."))
    if not found["probability"]:
        return f"[{claim}]({_EVIDENCE}#{claim.lower()}) {text}: {escaped(why_impossible(found, bank))}."
    shares = [escaped(share_of_settings(found))]
    common = found.get("probability_with_one_process_noise")
    if only_if(found) and common is not None:
        shares.append(f"{100 * common:.2g} % with one process noise for all")
    shares += [f"mostly where {escaped(_interval(each))}" for each in found["settings"][:1]]
    shares += _by_stand_in(claim, bank.get("stand_in", {}))
    return (
        f"[{claim}]({_EVIDENCE}#{claim.lower()}) {text}: **{shares[0]}**" + "".join(f"; {x}" for x in shares[1:]) + "."
    )


def _by_stand_in(claim: str, found: Mapping[str, Any]) -> Iterator[str]:
    """Yield how far a verdict goes that a cheaper filter was flown for."""
    if claim in found.get("same", {}):
        count, *ends = found["same"][claim]
        share = share_of_settings({"probability": count / found["settings"], "interval": ends})
        low, _, high = map(plain, found["ratio"])
        yield (
            f"a stand-in was flown: the published filter, with {low} to {high} times its error in 80 % of settings, "
            f"agrees in {escaped(share)} of {found['settings']} settings"
        )


def _interval(condition: Mapping[str, Any]) -> str:
    """Return a condition with the share of all settings that meet it; two digits, since it is an empirical quantile."""
    low, high = map(plain, condition["interval"])
    sides = {"between": f"between {low} and {high}", "at most": f"at most {high}", "at least": f"at least {low}"}
    unit = f" {condition['unit']}" if condition["unit"] else ""
    return f"{condition['name']} is {sides[condition['side']]}{unit} ({percent(condition['prior'])} of all)"


def _together(banks: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield what holds of several claims or numbers together: claims, tables, sentences."""
    lines = [_every(bank["all_claims"], bank) for bank in banks.values() if "all_claims" in bank]
    for bank in banks.values():
        lines += [*_tables(bank.get("best", {}), bank.get("searched", ())), *_consistent(bank), *sentence_lines(bank)]
    if lines:
        yield "### Several numbers at a time\n"
        yield _bullets(map(escaped, lines))


def _every(claims: Mapping[str, Any], bank: Mapping[str, Any]) -> str:
    if claims["probability"]:
        return f"{claims['words']} hold together in {share_of_settings(claims)} of the settings."
    return f"{claims['words']} hold together in {why_impossible(claims, bank)}."


def _tables(best: Mapping[str, Any], known: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield which tables one setting gives, and which it does not."""
    given: dict[bool, list[str]] = {True: [], False: []}
    for name, each in best.items():
        given[is_reached(each)].append(column_words(name))
    if given[True]:
        yield f"Reproduced with one setting each: {'; '.join(given[True])}."
    if given[False]:
        reached = searches_reached(known)
        power = f" {_KNOWN.format(reached=reached)}" if reached else ""
        yield f"No one setting was found for: {'; '.join(given[False])}. A longer search may find one.{power}"


def _consistent(bank: Mapping[str, Any]) -> Iterator[str]:
    if "inferred" in bank:
        yield (
            f"Of synthetic papers flown in one setting {100 * bank['inferred']['p_value']:.2g} % look as inconsistent "
            "as this one. That speaks against one setting of this prior for all columns and names no cause: it may be "
            "settings that changed between columns, a misprint, or what the model here leaves out."
        )


def _bullets(lines: Iterable[str]) -> str:
    return "\n".join(f"- {line}" for line in lines) + "\n"
