"""What the verdicts on the page of settings rest on, bank by bank."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from replication.findings import share_of_settings
from replication.inverse.page_tables import column_words, deviation, number_words, percent, plain, table

_HOW = {
    "alpha_kf": """EKF and UKF are flown as one Kalman filter on the converted measurement, the alpha filter as that
with R / α and the scatter of its samples: at 12 km they are the same ([why](replication.md)). Steps are 0.2 s long at
first and 5 s from 960 s on, with measurements that much better, which leaves white noise as it is; drag is left out. A
quarter of the settings leave out that scatter, as samples at fixed places do; A7 counts the 10000 samples that the
paper states. A8 and A9 are judged on 20 runs of each setting whose one run is within a factor of two.
""",
    "mf_upf": """The particle filter over Clohessy-Wiltshire dynamics: 50 to 500 particles, 2 to 20 s between
measurements.
""",
    "mf_upf_learned": """B1, B2 and B5 compare both filters in one setting. An unscented Kalman filter over the learned
dynamics stands for the published filter; one process serves all outputs, fitted to 75 of the 500 pairs, with the
variance that the 100 most informative give.
""",
    "two_step_kf": """No scenario of the paper is accessible: every one is admissible. A setting is eight runs of 40
measurements, with Clohessy-Wiltshire motion for truth and filters.
""",
}
_STAND_IN = """In {settings} settings the published filter with {particles} particles and relnav's own fit has {low} to
{high} times the stand-in's RMS position error (80 % of them; median {middle}).
"""
_BEST = """From the bank's nearest settings the search moves single settings across their range and steps downhill, as
long as that pays. Its last quarter {gain}; other starts may lead to a better setting. Residuals are printed less found
in standard deviations (std) of a single run, the last digit's rounding counted. The distance sums their squares (large
ones count less); a consistent paper's is that to its own setting.
"""
_SEARCHED = """The same search on synthetic papers whose settings are known: the distance of the best setting found, in
brackets the limit that 95 % of consistent papers keep. A table is reached when its distance is within the limit, where
the search ends. In the last paper a column is doubled: it has no setting.
"""
_CELLS = """Paper; best setting for the table (residual). [All numbers](replication-numbers.csv) with components,
scatter and the best setting for all tables.
"""
_SHOWN = ("r mean", "v mean", "convergence")
_PAIRS = """Pairs of printed numbers that rarely come together, though the bank gives each alone: {count} with
p ≤ {limit}; consistent papers have {middle:.0f} (95 % of them at most {high:.0f}). Least: {pairs}.
"""
_COLUMNS = """### Columns against each other

p is how often a column of a consistent paper goes as ill with the other columns. Least of {count}, with the number
furthest from what the others imply, in standard deviations: {least}.
"""
_POWER = """Power: the share of {papers} synthetic papers called inconsistent when one column is multiplied by a factor
or is another paper's; unchanged {alarms} are (nominal {nominal}). The sizes of a column differ
from run to run by a factor of {low:.2f} to {high:.2f}.
"""
_KNOWN = """In brackets the power of a test that knows all settings and looks at the mean size of each column alone;
others can have more, as columns share their noise.
"""
_FACTORS, _PULLING, _FEWEST, _FURTHEST, _WORST = ("0.5", "1.25", "1.5", "2"), 2, 3, 3, 3


def evidence(name: str, found: Mapping[str, Any]) -> Iterator[str]:
    """Yield the parts of a bank's section."""
    yield _HOW[name]
    if "bank" not in found:
        yield "No bank has been flown yet.\n"
        return
    if "stand_in" in found:
        yield _stand_in(found["stand_in"])
    conflicts = [
        f"{claim} against {_named(text)}" for claim, each in found["claims"].items() for text in each["conflicts"]
    ]
    if conflicts:
        yield "Printed numbers that rarely come with a claim: " + "; ".join(conflicts) + ".\n"
    if found.get("together"):
        pairs = (f"{' and '.join(each['claims'])} {_share(each)}" for each in found["together"][:_FEWEST])
        yield "How often both hold where the rarer one does: " + "; ".join(pairs) + ".\n"
    if "best" in found:
        yield from _best(found)
    if found.get("searched"):
        yield _SEARCHED
        yield searched_table(found["searched"])
    if "pairs" in found:
        yield _pairs(found["pairs"])
    yield from _columns(found.get("inferred", {}).get("columns", ()), found.get("checks", {}).get("forged", {}))


def _named(conflict: str) -> str:
    number, colon, rest = conflict.partition(":")
    return number_words(number) + colon + rest


def _share(pair: Mapping[str, Any]) -> str:
    return share_of_settings({"probability": pair["share"], "interval": pair["interval"]})


def _stand_in(found: Mapping[str, Any]) -> str:
    low, middle, high = found["ratio"]
    return _STAND_IN.format(
        settings=found["settings"],
        particles=found["particles"],
        low=plain(low),
        high=plain(high),
        middle=plain(middle),
    )


def _best(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield how near the best settings come, how the search ended, and the tables beside them."""
    yield "### The best settings\n"
    gains = [each["misfit"][1] - each["misfit"][2] for each in found["best"].values()]
    lowered = f"still lowered the misfit, -2 log likelihood, by {min(gains):.0f} to {max(gains):.0f}"
    yield _BEST.format(gain=lowered if max(gains) >= 1 else "brought nothing")
    rows = (
        (
            column_words(name),
            f"{percent(each['within_two'])} of {each['numbers']}",
            str(each["beyond_four"]),
            f"{each['distance']:.0f}",
            "{:.0f} to {:.0f}".format(*each["honest"]),
            str(each["flown"]),
        )
        for name, each in found["best"].items()
    )
    head = ("best for", "within 2 std", "beyond 4", "distance", "consistent: median to 95 %", "settings tried")
    yield table(head, rows)
    first = next(iter(found["best"]))
    far = found["best"][first].get("furthest", ())[:_FURTHEST]
    if far:
        told = "; ".join(f"{number_words(each['number'])} {deviation(each['residual'])}" for each in far)
        yield f"Furthest from the best for {column_words(first)}: {told}.\n"
    yield _CELLS
    for name, printed in found.get("tables", {}).items():
        rows = ((row["label"], *_cells(row)) for row in printed["rows"] if row["label"] in _SHOWN)
        columns = [column_words(f"{name} {column}").split(", ")[1].replace(" = ", "=") for column in printed["columns"]]
        yield table((column_words(name), *columns), rows)


def searched_table(papers: Sequence[Mapping[str, Any]]) -> str:
    """Return how near the search came to synthetic papers."""
    names = list(papers[0]["tables"])
    rows = []
    for each in papers:
        setting = "near this paper's" if each["near"] else "any of the prior"
        if each["forged"]:
            setting += f"; {column_words(each['forged'])} × 2"
        rows.append((setting, *(_searched(each["tables"].get(name)) for name in names)))
    return table(("setting", *map(column_words, names)), rows)


def _searched(own: Mapping[str, Any] | None) -> str:
    if own is None:
        return "–"
    told = "reached" if is_reached(own) else "**not reached**"
    return f"{told}: {own['distance']:.0f} ({own['honest'][1]:.0f})"


def is_reached(own: Mapping[str, Any]) -> bool:
    """Return whether a setting was found that gives a table as well as 95 % of consistent papers' own settings do."""
    return bool(own["distance"] <= own["honest"][1])


def searches_reached(papers: Sequence[Mapping[str, Any]]) -> str:
    """Return how many tables of synthetic papers, none of their columns changed, were reached; nothing without any."""
    told = []
    for near, words in ((True, "near this paper's settings"), (False, "elsewhere")):
        own = [
            each
            for paper in papers
            if paper["near"] == near and not paper["forged"]
            for each in paper["tables"].values()
        ]
        if own:
            told.append(f"{sum(map(is_reached, own))} of {len(own)} {words}")
    return " and ".join(told)


def _cells(row: Mapping[str, Any]) -> Iterator[str]:
    printed, found = {"s": (0, 0), "m": (3, 2)}.get(row["unit"], (3, 3))
    for paper, alone, off in zip(row["paper"], row["alone"], row["alone_residual"], strict=True):
        yield f"{paper:.{printed}f}; {alone:.{found}f} ({deviation(off)})"


def _pairs(found: Mapping[str, Any]) -> str:
    middle, high = found["honest"]
    least = "; ".join(
        f"{number_words(each['first'])} and {number_words(each['second'])} (p = {each['p_value']:.1g})"
        for each in found["pairs"][:_PULLING]
    )
    return _PAIRS.format(count=found["count"], limit=percent(found["limit"]), middle=middle, high=high, pairs=least)


def _columns(pulls: Sequence[Mapping[str, Any]], power: Mapping[str, Any]) -> Iterator[str]:
    """Yield how each column goes with the others, and how surely one that does not would be seen."""
    if pulls:
        least = "; ".join(
            f"{column_words(each['column'])} p = {each['p_value']:.1g} ({_furthest(each)})"
            for each in sorted(pulls, key=lambda each: float(each["p_value"]))[:_WORST]
        )
        yield _COLUMNS.format(count=len(pulls), least=least)
    if not power:
        return
    yield _POWER.format(
        papers=power["papers"],
        alarms=percent(power["false_alarm"], 1),
        nominal=percent(power["nominal_false_alarm"]),
        low=min(power["scatter"].values()),
        high=max(power["scatter"].values()),
    )
    p_values = {each["column"]: f"{each['p_value']:.2g}" for each in pulls}
    factors = [factor for factor in _FACTORS if factor in power["columns"][0]["called_inconsistent"]]
    rows = (
        (
            column_words(each["column"]).replace(" = ", "="),
            p_values.get(each["column"], "–"),
            *(
                f"{each['called_inconsistent'][factor]:.2f}{_known(power, each['column'], factor)}"
                for factor in factors
            ),
            f"{each['of_another_paper']:.2f}",
        )
        for each in power["columns"]
    )
    if "known_settings" in power:
        yield _KNOWN
    yield table(("column", "p", *(f"× {factor}" for factor in factors), "another's"), rows)
    yield from _powers_by_kind(power.get("kinds", ()), factors)


def _known(power: Mapping[str, Any], column: str, factor: str) -> str:
    return f" ({power['known_settings'][column][factor]:.2f})" if "known_settings" in power else ""


def _powers_by_kind(kinds: Sequence[Mapping[str, Any]], factors: Sequence[str]) -> Iterator[str]:
    """Yield the mean over columns for papers of each kind, if papers are of several."""
    if not kinds:
        return
    rows = ((each["kind"], str(each["papers"]), *(f"{part:.2f}" for part in _called(each, factors))) for each in kinds)
    head = ("mean over columns, papers with", "papers", "unchanged", *(f"× {factor}" for factor in factors))
    yield table((*head, "another's"), rows)


def _called(each: Mapping[str, Any], factors: Sequence[str]) -> Iterator[float]:
    yield each["false_alarm"]
    yield from (each["called_inconsistent"][factor] for factor in factors)
    yield each["of_another_paper"]


def _furthest(column: Mapping[str, Any]) -> str:
    far = column["furthest"][0]
    return f"{far['number'].split(' ', 2)[2]} {deviation(far['deviations'])}"
