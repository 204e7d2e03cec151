"""How often intervals hold the truth and verdicts are wrong, by simulation of runs whose truth is known.

    python tests/statistics/coverage_tables.py     writes the tables of docs/statistics.md into it; some ten minutes

The slow tests ask the same of fewer campaigns.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relnav_sim.statistics.bound_ratio import ratio_to_bound
from relnav_sim.statistics.intervals import mean_interval, paired_differences

Array = NDArray[np.float64]
Law = tuple[Callable[[np.random.Generator, tuple[int, ...]], Array], float]

PAGE = Path(__file__).parents[2] / "docs" / "statistics.md"
FILTERS = 6
CAMPAIGNS = {10: 2000, 15: 1000, 20: 1000, 50: 300, 100: 300}
"""Simulated campaigns of 15 pairs by the number of runs; each takes some 25 ms from 15 runs on."""
LAWS: dict[str, Law] = {
    "normal": (lambda rng, size: rng.standard_normal(size), 0.0),
    "Student's t(3)": (lambda rng, size: rng.standard_t(3, size), 0.0),
    "chi-square of 3": (lambda rng, size: rng.chisquare(3, size), 3.0),
    "chi-square of 1": (lambda rng, size: rng.chisquare(1, size), 1.0),
    "lognormal, 0.25": (lambda rng, size: rng.lognormal(0, 0.25, size), float(np.exp(0.25**2 / 2))),
    "lognormal, 0.5": (lambda rng, size: rng.lognormal(0, 0.5, size), float(np.exp(0.5**2 / 2))),
    "lognormal, 1": (lambda rng, size: rng.lognormal(0, 1, size), float(np.exp(0.5))),
}
"""Figures of one run and their mean."""


def wrong_verdicts(law: str, runs: int, campaigns: int, seed: int = 1) -> tuple[float, float]:
    """Return how often any verdict on 6 equal filters is wrong, and how often that on one pair of them is.

    The filters' figures are independent and alike in law, and so exchangeable: every verdict is wrong.
    """
    rng, pairs = np.random.default_rng(seed), list(itertools.combinations(range(FILTERS), 2))
    any_wrong = one_wrong = 0
    for _ in range(campaigns):
        figures = LAWS[law][0](rng, (FILTERS, runs))
        differences = {(i, j): figures[i] - figures[j] for i, j in pairs}
        family = paired_differences(differences)
        any_wrong += any(found.verdict != "undecided" for found in family.values())
        (alone,) = paired_differences({(0, 1): differences[0, 1]}).values()
        one_wrong += alone.verdict != "undecided"
    return any_wrong / campaigns, one_wrong / campaigns


def coverage_of_a_mean(law: str, runs: int, campaigns: int, seed: int = 2) -> float:
    """Return how often the interval of a mean holds it."""
    draw, mean = LAWS[law]
    found = map(mean_interval, draw(np.random.default_rng(seed), (campaigns, runs)))
    return sum(item.low <= mean <= item.high for item in found) / campaigns


def coverage_of_a_difference(law: str, runs: int, campaigns: int, seed: int = 4) -> float:
    """Return how often the interval of a mean difference holds it where the differences themselves have this law."""
    draw, mean = LAWS[law]
    samples = draw(np.random.default_rng(seed), (campaigns, runs))
    found = (paired_differences({"": sample})[""].difference for sample in samples)
    return sum(item.low <= mean <= item.high for item in found) / campaigns


def coverage_of_a_ratio(epochs: int, runs: int, campaigns: int, seed: int = 3) -> tuple[float, float]:
    """Return how often the interval of a ratio to the bound of 2 holds it, and the mean of the ratios found.

    The error has three axes, of which one is larger, and as many independent epochs in a run as given.
    """
    rng, sigmas, bound = np.random.default_rng(seed), np.array([2.0, 1.0, 0.5]), np.linspace(1.0, 0.5, epochs)
    size = 2 * bound / np.sqrt(np.square(sigmas).sum())
    hits, ratios = 0, []
    for _ in range(campaigns):
        error = rng.standard_normal((runs, epochs, 3)) * sigmas * size[:, None]
        found = ratio_to_bound(np.linalg.norm(error, axis=-1), bound)
        hits += found.low <= 2 <= found.high
        ratios.append(found.estimate)
    return hits / campaigns, float(np.mean(ratios))


def tables(say: Callable[[str], object]) -> dict[str, str]:
    """Return the page's tables by the name of their place."""
    sizes = tuple(CAMPAIGNS)
    laws = [law for law in LAWS if law != "lognormal, 0.25"]
    means = [_row(["runs", *LAWS]), _row(["--:"] * (len(LAWS) + 1))]
    for runs in (4, 6, 8, *sizes):
        means.append(_row([str(runs), *(f"{100 * coverage_of_a_mean(law, runs, 10_000):.1f} %" for law in LAWS)]))
        say(means[-1])
    verdicts = [_row(["runs", *laws]), _row(["--:"] * (len(laws) + 1))]
    for runs in sizes:
        shares = [wrong_verdicts(law, runs, CAMPAIGNS[runs]) for law in laws]
        verdicts.append(_row([str(runs), *(f"{100 * family:.1f} % / {100 * one:.1f} %" for family, one in shares)]))
        say(verdicts[-1])
    skewed = [_row(["runs", *laws]), _row(["--:"] * (len(laws) + 1))]
    for runs in sizes:
        found = [100 * coverage_of_a_difference(law, runs, 4000 if runs < 15 else 1000) for law in laws]
        skewed.append(_row([str(runs), *(f"{hit:.1f} %" for hit in found)]))
        say(skewed[-1])
    ratios = [_row(["runs", "1 epoch", "5 epochs", "50 epochs"]), _row(["--:"] * 4)]
    for runs in (10, 20, 50, 100):
        cells = [coverage_of_a_ratio(epochs, runs, 4000) for epochs in (1, 5, 50)]
        ratios.append(_row([str(runs), *(f"{100 * hit:.1f} %, {mean:.3f}" for hit, mean in cells)]))
        say(ratios[-1])
    return {
        "means": "\n".join(means),
        "verdicts": "\n".join(verdicts),
        "skewed": "\n".join(skewed),
        "ratios": "\n".join(ratios),
    }


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _write(page: Path, found: dict[str, str]) -> None:
    text = page.read_text(encoding="utf-8")
    for name, table in found.items():
        before, start, rest = text.partition(f"<!-- simulated: {name} -->\n")
        _, end, after = rest.partition("\n<!-- end -->")
        if not start or not end:
            raise SystemExit(f"{page} has no place for the table of {name}")
        text = f"{before}{start}{table}{end}{after}"
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    _write(PAGE, tables(lambda line: print(line, file=sys.stderr, flush=True)))
