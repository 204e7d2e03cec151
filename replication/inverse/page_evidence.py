"""What the verdicts on the page of settings rest on, bank by bank."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from replication.inverse.page_tables import folded, share, table

_HOW = {
    "alpha_kf": """EKF and UKF are flown as one Kalman filter on the converted measurement, the alpha filter as that
with R / alpha and the scatter of its samples: at 12 km they are the same ([why](replication.md)). Steps are 0.2 s long
at first and 5 s from 960 s on, with measurements that much better, which leaves white noise as it is. Drag is left out.
A8 and A9 ask for printed errors within two standard deviations of a setting's single runs; settings that come near were
flown 20 times for that.
""",
    "mf_upf": """The particle filter over Clohessy-Wiltshire dynamics: 50 to 500 particles, 2 to 20 s between
measurements. B3 asks for a largest position error of 5 m from 4000 s on, B4 for 0.01 m/s RMS, both within a factor of
two and with half of the RMS of 1000 to 2000 s or more; B6 for 1 m RMS from 1000 s on, within a factor of two.
""",
    "mf_upf_learned": """### With learned dynamics

Both filters of the comparison in one setting, for B1, B2 and B5. An unscented Kalman filter over the learned dynamics
stands for the published filter; one process serves all outputs, fitted to 75 of the 500 pairs, and its variance is that
given the 100 most informative.
""",
    "two_step_kf": """No scenario of the paper is accessible, so that every scenario is admissible. Each setting flies
eight runs of 40 measurements, with Clohessy-Wiltshire motion for truth and filters.
""",
}
_STAND_IN = """The published filter with {particles} particles and relnav's own fit, flown in {settings} of these
settings, has {low:.2f} to {high:.2f} times the stand-in's RMS position error (80 % of them; median {middle:.2f}). The
outcome of a claim is the same in:
"""
_PAIRS = """Each number alone is as far out as in a twentieth of the bank's papers or more. Of the papers that have
nearly the first number, p is twice the share in which the second is as far out on its side, or the same the other way
round if that is more; deviations are from the median of these papers. One pair is listed for each pair of columns.
Pairs with p of {limit:.0%} or less: {count}; papers held out of the bank have {middle:.0f} (95 % of them at most
{high:.0f}).
"""
_SEARCH = """The search starts from the settings of the bank that come nearest. In each round single settings move
across their range, Fisher scoring steps follow, and the worse half of the starts is dropped. Batches of starts follow
until one lowers the misfit by less than 1 % of its whole fall. All fly with the same noise. The misfit is -2 log
likelihood; "at first" is the least of the bank's settings, before any has moved. Other starts end at other misfits: the
least found need not be the least there is.
"""
_SEARCHED = """The same search on papers that relnav has made in a known setting, which the search has not been told and
the bank has lost. Distances are read as above: of the paper to the best setting found, and in brackets that which 95 %
of honest papers have from their own setting at most, where the search ends. The forged paper is the first one with a
column doubled; only the forged table and all tables are searched.
"""
_CELLS = """In each cell: the paper's number; that of the best setting for this table alone; that of the best setting
for all tables. In brackets: printed less found, in standard deviations of a single run, the rounding of the last digit
counted.
"""
_COVERED = """Intervals of {level:.0%} contain the known settings of {papers} papers that were held out of the bank in
{contained:.1%} of all cases. The least for one unknown is {least} papers; for so many unknowns together the binomial
bound is {least_allowed}.
"""
_FORGED = """Share of {papers} synthetic papers like the printed one that are called inconsistent when the errors of one
column are multiplied by a factor, or are those of another such paper. Of those without a forged column
{false_alarm:.1%} are; nominal are {nominal_false_alarm:.0%}. The test is a classifier that has been shown other papers
forged in these two ways. The scatter is the factor by which all sizes in a column together differ from run to run of
one setting (one standard deviation): no test can see much less.
"""
_COLUMNS = """The probability that a column of an honest paper like this one is as improbable given the other columns,
and the numbers that are furthest from what the others imply, in standard deviations.
"""


def evidence(name: str, found: Mapping[str, Any]) -> Iterator[str]:
    """Yield the parts of a bank's section."""
    yield _HOW[name]
    if "bank" not in found:
        yield "No bank has been flown yet.\n"
        return
    bank = found["bank"]
    size = f"{bank['campaigns']} independent settings, {bank['cpu_hours']:.2f} hours of processor time"
    yield f"Bank: {size}, seed {bank['seed']}, digest {bank['digest']}.\n"
    if "stand_in" in found:
        yield _stand_in(found["stand_in"])
    conflicts = [f"- {claim}: {text}." for claim, each in found["claims"].items() for text in each["conflicts"]]
    if conflicts:
        yield "Printed numbers that pull against a claim:\n"
        yield "\n".join(conflicts) + "\n"
    if found.get("together"):
        rows = ((" and ".join(pair["claims"]), *share(pair["share"], pair["interval"])) for pair in found["together"])
        yield table(("both claims hold, least often first", "where the rarer one holds", "95 %"), rows)
    if "best" in found:
        yield from _best(found)
    if "searched" in found:
        yield "### Known settings searched\n"
        yield _SEARCHED
        yield searched_table(found["searched"])
    if "pairs" in found:
        middle, high = found["pairs"]["honest"]
        yield "### Printed numbers that pull against each other\n"
        yield _PAIRS.format(**found["pairs"], middle=middle, high=high)
        yield _pairs(found["pairs"]["pairs"])
    if "inferred" in found:
        yield "### Columns that go with the others\n"
        yield _COLUMNS
        yield _pulls(found["inferred"]["columns"])
    if "forged" in found.get("checks", {}):
        yield "### Power against a forged column\n"
        yield _FORGED.format(**found["checks"]["forged"])
        yield _powers(found["checks"]["forged"])
    yield from _unknowns(found)


def _stand_in(found: Mapping[str, Any]) -> str:
    low, middle, high = found["ratio"]
    rows = (
        (claim, str(same), *share(same / found["settings"], ends)) for claim, (same, *ends) in found["same"].items()
    )
    head = ("claim", f"of {found['settings']} settings", "share", "95 %")
    return _STAND_IN.format(**found, low=low, middle=middle, high=high) + "\n" + table(head, rows)


def _best(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield how the search ended, and the tables beside the best settings."""
    yield "### The best settings\n"
    yield _SEARCH
    rows = (
        (name.replace("_", " "), str(each["flown"]), *(f"{value:.1f}" for value in each["misfit"]))
        for name, each in found["best"].items()
    )
    head = ("best setting for", "settings flown", "misfit at first", "after three quarters of them", "in the end")
    yield table(head, rows)
    yield _CELLS
    for name, printed in found["tables"].items():
        rows = ((row["label"], *_cells(row)) for row in printed["rows"])
        title = f"{name.replace('_', ' ').capitalize()}: paper; best for the table; best for all"
        yield folded(title, table(("", *printed["columns"]), rows))


def searched_table(searched: Sequence[Mapping[str, Any]]) -> str:
    """Return how near the search came to synthetic papers."""
    names = list(searched[0]["tables"])
    rows = []
    for each in searched:
        setting = "near the printed numbers" if each["near"] else "any of the prior"
        forged = f", {each['forged'].replace('_', ' ', 1)} forged" if each["forged"] else ""
        cells = []
        for name in names:
            own = each["tables"].get(name)
            reached = own and ("reached" if own["distance"] <= own["honest"][1] else "not reached")
            cells.append(f"{own['distance']:.0f} ({own['honest'][1]:.0f}): {reached}" if own else "")
        rows.append((setting + forged, *cells))
    return table(("setting", *(name.replace("_", " ") for name in names)), rows)


def _cells(row: Mapping[str, Any]) -> Iterator[str]:
    names = ("paper", "alone", "alone_residual", "joint", "joint_residual")
    for paper, alone, alone_off, joint, joint_off in zip(*(row[name] for name in names), strict=True):
        yield f"{paper:.3f}; {alone:.3f} ({alone_off:+.1f}); {joint:.3f} ({joint_off:+.1f})"


def _unknowns(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield how well known settings are found again, and each unknown with its prior, best values and coverage."""
    head, columns = ["unknown", "unit", "prior: choices, or 0, 5, 50, 95 and 100 %"], []
    unknowns = found["bank"]["unknowns"]
    columns += [[each["words"] for each in unknowns], [each["unit"] for each in unknowns], [*map(_law, unknowns)]]
    for name, best in found.get("best", {}).items():
        head.append(f"best for {name.replace('_', ' ')}")
        columns.append([value if isinstance(value, str) else f"{value:.3g}" for value in best["settings"]])
    if "checks" in found:
        coverage = found["checks"]["coverage"]
        least = min(each["contained"] for each in coverage["unknowns"])
        head += [f"found again, of {coverage['papers']}", "width of the interval over the prior's"]
        columns.append([str(each["contained"]) for each in coverage["unknowns"]])
        columns.append([f"{each['width']:.2f}" for each in coverage["unknowns"]])
        yield "### Settings found again\n"
        yield _COVERED.format(**coverage, least=least)
        if not coverage["passed"]:
            yield "That is below the bound: intervals of settings from this bank are not to be relied on.\n"
    yield folded("What is open, its prior, and what was found", table(head, zip(*columns, strict=True)))


def _law(unknown: Mapping[str, Any]) -> str:
    if "choices" in unknown:
        return ", ".join(f"{name} ({part:.0%})" for name, part in unknown["choices"].items())
    return ", ".join(f"{end:.3g}" for end in unknown["quantiles"])


def _pulls(columns: Sequence[Mapping[str, Any]]) -> str:
    rows = (
        (
            each["column"].replace("_", " ", 1),
            f"{each['p_value']:.3f}",
            ", ".join(f"{far['number'].split(' ', 2)[2]} ({far['deviations']:+.1f})" for far in each["furthest"]),
        )
        for each in columns
    )
    return table(("column", "p", "furthest from what the others imply"), rows)


def _pairs(pairs: Sequence[Mapping[str, Any]]) -> str:
    rows = ((each["first"], each["second"], f"{each['p_value']:.3f}", f"{each['deviations']:.1f}") for each in pairs)
    return table(("number", "number", "p", "deviations"), rows)


def _powers(forged: Mapping[str, Any]) -> str:
    columns = forged["columns"]
    factors = list(columns[0]["called_inconsistent"])
    rows = (
        (
            each["column"].replace("_", " ", 1),
            f"{forged['scatter'][each['column']]:.2f}",
            *(f"{each['called_inconsistent'][factor]:.2f}" for factor in factors),
            f"{each['of_another_paper']:.2f}",
        )
        for each in columns
    )
    return table(("column", "scatter of a run", *(f"x {factor}" for factor in factors), "another paper's"), rows)
