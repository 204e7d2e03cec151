"""Where each form of the covariance breaks: against a Joseph filter of 128 bits, by condition number and arithmetic.

    python benchmarks/flight_arithmetic.py [--docs]

The problems, the reference and the forms are those of tests/filters/joseph_128.py. `--docs` writes the tables into
docs/flight-arithmetic.md.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "filters"))

from joseph_128 import distance, of_filter, of_form, problem, reference  # noqa: E402

PAGE = ROOT / "docs" / "flight-arithmetic.md"
CONDITIONS = [10.0**power for power in range(4, 17, 2)]
SEEDS = range(1, 6)
ARITHMETICS = ("float64", "float32")
FORMS = {"short": "P - K H P", "joseph": "Joseph", "root": "root of P", "ud_ekf": "`ud_ekf`", "srif": "`srif`"}
COMPENSATED = "ud_ekf, compensated"
FILTERS = {
    **{kind: f"`{kind}`" for kind in ("ekf", "iekf", "two_step", "skf", "ukf", "sr_ukf")},
    COMPENSATED: "`ud_ekf`, `compensated`",
}
TABLES = {"": FORMS, " of filters": FILTERS}
OPTIONS = {"skf": {"samples": 64}, COMPENSATED: {"compensated": True}}


def columns(which, arithmetic):
    """Return the columns of a table: what has float32 alone is not in that of float64."""
    return {name: title for name, title in TABLES[which].items() if arithmetic == "float32" or name != COMPENSATED}


def worst(condition, arithmetic, which=""):
    """Return the worst error of the covariance and of the mean by column, and in how many problems it broke.

    A form breaks where its covariance is indefinite, a filter of relnav where that is or where it gives up.
    """
    found = {name: [0.0, 0.0, 0] for name in columns(which, arithmetic)}
    for seed in SEEDS:
        given = problem(condition, seed)
        exact = reference(given)
        for name, row in found.items():
            if which == "" and name not in ("ud_ekf", "srif"):
                answers, sound = of_form(name, given, arithmetic), True
            else:
                answers, sound = of_filter(name.partition(",")[0], given, arithmetic, **OPTIONS.get(name, {}))
            one = distance(answers, exact)
            broken = not one.definite or (which != "" and not sound)
            row[0], row[1], row[2] = max(row[0], one.covariance), max(row[1], one.mean), row[2] + broken
    return found


def cell(error, broken, word):
    """Return an error to one digit; in how many problems it broke where it did."""
    return f"{word} in {broken} of {len(SEEDS)}" if broken else f"{error:.0e}"


def table(rows, place, which, arithmetic):
    """Return a table of an error by condition number."""
    titles = columns(which, arithmetic).values()
    lines = ["| condition | " + " | ".join(titles) + " |", "|---|" + "---|" * len(titles)]
    for condition, found in rows.items():
        word = "fails" if which else "indefinite"
        cells = [cell(row[place], row[2] if which or place == 0 else 0, word) for row in found.values()]
        lines.append(f"| {condition:.0e} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main():
    """Print the tables, or write them into the page."""
    page = PAGE.read_text(encoding="utf-8") if "--docs" in sys.argv else ""
    for which in TABLES:
        for arithmetic in ARITHMETICS:
            rows = {condition: worst(condition, arithmetic, which) for condition in CONDITIONS}
            for what, place in (("covariance", 0), ("mean", 1)):
                made = table(rows, place, which, arithmetic)
                print(f"{arithmetic} {what}{which}\n{made}\n", flush=True)
                mark = f"<!-- {arithmetic} {what}{which} -->\n"
                page = re.sub(f"{mark}.*?\n\n", lambda found, whole=mark + made + "\n\n": whole, page, flags=re.DOTALL)
    if page:
        PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
