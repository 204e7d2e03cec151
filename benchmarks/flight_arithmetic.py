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
FORMS = {"short": "P - K H P", "joseph": "Joseph", "root": "root of P", "ud_ekf": "`ud_ekf`", "srif": "`srif`"}
ARITHMETICS = ("float64", "float32")


def worst(condition, arithmetic):
    """Return the worst error of the covariance and of the mean by form, and in how many problems it broke."""
    found = {form: [0.0, 0.0, 0] for form in FORMS}
    for seed in SEEDS:
        given = problem(condition, seed)
        exact = reference(given)
        for form, row in found.items():
            if form in ("ud_ekf", "srif"):
                answers, _ = of_filter(form, given, arithmetic)
            else:
                answers = of_form(form, given, arithmetic)
            one = distance(answers, exact)
            row[0], row[1], row[2] = max(row[0], one.covariance), max(row[1], one.mean), row[2] + (not one.definite)
    return found


def cell(error, broken):
    """Return an error to one digit; how often the covariance was indefinite where it was."""
    return f"indefinite in {broken} of {len(SEEDS)}" if broken else f"{error:.0e}"


def table(rows, place):
    """Return a table of an error by condition number."""
    lines = ["| condition | " + " | ".join(FORMS.values()) + " |", "|---|" + "---|" * len(FORMS)]
    for condition, found in rows.items():
        cells = [cell(row[place], row[2] if place == 0 else 0) for row in found.values()]
        lines.append(f"| {condition:.0e} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main():
    """Print the tables, or write them into the page."""
    page = PAGE.read_text(encoding="utf-8") if "--docs" in sys.argv else ""
    for arithmetic in ARITHMETICS:
        rows = {condition: worst(condition, arithmetic) for condition in CONDITIONS}
        for what, place in (("covariance", 0), ("mean", 1)):
            made = table(rows, place)
            print(f"{arithmetic}, {what}\n{made}\n")
            mark = f"<!-- {arithmetic} {what} -->\n"
            page = re.sub(f"{mark}.*?\n\n", lambda found, whole=mark + made + "\n\n": whole, page, flags=re.DOTALL)
    if page:
        PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
