"""The decision: the rule on invented evidence whose answer is known, and how often it errs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from relnav_sim.statistics.decision import OVERCONFIDENT, Candidate, CaseEvidence, Refusal, decide, decide_case
from relnav_sim.statistics.equivalence import Difference
from relnav_sim.statistics.intervals import Interval, paired_differences

RUNS = 20


def _exactly(value: float) -> Interval:
    return Interval(value, value, value, 0.95, RUNS)


def _candidate(name: str, rms: float, sigma: float = 1.0, **more: Any) -> Candidate:
    return Candidate(
        name, _exactly(rms), _exactly(rms / 1000), RUNS, errors_over_sigma={"full": _exactly(sigma)}, **more
    )


def _case(*candidates: Candidate, index: int = 0, half: float = 0.1) -> CaseEvidence:
    """Return a case in which every difference is known to within so many percent to each side."""
    differences = {}
    for second, first in itertools.combinations(sorted(candidates, key=lambda item: item.position.estimate), 2):
        above = 100 * (first.position.estimate / second.position.estimate - 1)
        verdict = "worse" if above > half else "undecided"
        percent = Interval(above, above - half, above + half, 0.95, RUNS)
        differences[first.name, second.name] = Difference(percent, verdict, percent)
    return CaseEvidence(index, candidates, differences)


def test_the_most_accurate_filter_is_chosen() -> None:
    found = decide_case(_case(_candidate("a", 2.0), _candidate("b", 1.0), _candidate("c", 1.5)), 1.0)
    assert (found.chosen, found.most_accurate) == ("b", "b")
    assert found.effects == {"c": "worse", "a": "worse"}
    assert not found.refusals


@pytest.mark.parametrize(
    ("fault", "refusal"),
    [
        ({"failed": 1}, Refusal("failed", count=1)),
        ({"diverged": 20}, Refusal("diverged", count=20)),
        ({"verdicts": {"R1": "fail"}}, Refusal("requirement", "R1")),
        ({"sigma": 1.01 * OVERCONFIDENT}, Refusal("overconfident")),
        ({"observable": False}, Refusal("not observable")),
        ({"known_when": "after the run"}, Refusal("known later", "after the run")),
    ],
)
def test_the_most_accurate_filter_is_refused_where_it_must_not_fly(fault: Mapping[str, Any], refusal: Refusal) -> None:
    found = decide_case(_case(_candidate("a", 1.0, **fault), _candidate("b", 3.0)), 1.0)
    assert found.chosen == "b"
    assert found.refusals == {"a": (refusal,)}


def test_nothing_is_recommended_where_all_are_refused() -> None:
    found = decide([_case(_candidate("a", 1.0, failed=2), _candidate("b", 1.1, sigma=9.0))], 1.0).overall
    assert found.chosen is None
    assert set(found.refusals) == {"a", "b"}
    assert found.most_accurate == "a"


def test_losses_that_a_requirement_limits_are_its_to_judge() -> None:
    told = {"limited": frozenset({"diverged"}), "diverged": 1}
    assert decide_case(_case(_candidate("a", 1.0, verdicts={"few": "pass"}, **told)), 1.0).chosen == "a"
    assert decide_case(_case(_candidate("a", 1.0, verdicts={"few": "fail"}, **told)), 1.0).chosen is None


def test_a_filter_that_meets_all_requirements_goes_before_one_that_may() -> None:
    a, b = _candidate("a", 1.0, verdicts={"R1": "undecided"}), _candidate("b", 1.2, verdicts={"R1": "pass"})
    found = decide_case(_case(a, b), 1.0)
    assert (found.chosen, found.meets_all, found.set_aside) == ("b", True, ("a",))
    alone = decide_case(_case(a, replace(b, verdicts={"R1": "undecided"})), 1.0)
    assert (alone.chosen, alone.meets_all, alone.set_aside) == ("a", False, ())


def test_a_difference_inside_the_margin_does_not_matter_though_it_is_significant() -> None:
    case = _case(_candidate("a", 1.0), _candidate("b", 1.003), _candidate("c", 1.2))
    assert decide_case(case, 1.0).effects == {"b": "equivalent", "c": "worse"}
    assert decide_case(case, 0.1).effects == {"b": "worse", "c": "worse"}
    assert decide_case(replace(case, differences={}), 1.0).effects == {"b": "undecided", "c": "undecided"}


def test_several_cases_take_the_best_worst_case_of_what_none_refuses() -> None:
    first = _case(_candidate("a", 1.0), _candidate("b", 1.2), _candidate("c", 1.1))
    second = _case(_candidate("a", 2.0), _candidate("b", 1.0), _candidate("c", 0.1, failed=1), index=1)
    found = decide([first, second], 1.0)
    assert [choice.chosen for _, choice in found.cases] == ["a", "b"]
    assert found.overall.chosen == "b"
    assert found.overall.refusals == {"c": (Refusal("failed", count=1),)}
    assert found.worst["b"] == (0, pytest.approx(20.0))
    assert found.worst["a"] == (1, pytest.approx(100.0))
    assert found.overall.effects == {"a": "undecided"}  # better in one case, worse in the other
    assert found.overall.most_accurate is None


def test_the_other_way_round_a_difference_is_in_percent_of_the_other_filter() -> None:
    above = Interval(100.0, 25.0, 300.0, 0.95, RUNS)
    case = CaseEvidence(0, (), {("a", "b"): Difference(above, "worse", above)})
    turned = case.difference("b", "a")
    assert turned is not None
    assert (turned.percent.low, turned.percent.estimate, turned.percent.high) == pytest.approx((-75, -50, -20))
    assert turned.verdict == "better"
    assert case.difference("a", "c") is None


def test_runs_to_decide_bring_the_interval_inside_the_margin() -> None:
    """Half a per cent off, known to 2 %: a half width of 0.5 % takes 16 times as many runs."""
    small, large = Interval(0.5, -1.5, 2.5, 0.95, 25), Interval(3.0, -1.0, 7.0, 0.95, 25)
    unknown = Interval(1e-6, math.nan, math.nan, 0.95, 1)
    needed = [Difference(one, "undecided", one).runs_to_decide(1.0) for one in (small, large, unknown)]
    assert needed == [400, 45, None]  # 25 (4 / 3)^2 = 44.4


def _effects(rng: np.random.Generator, above_percent: tuple[float, ...], spread: float) -> set[str]:
    """Return what the rule says of filters whose RMS truly lies so far above the first one's, on 30 common runs."""
    common = rng.gamma(40, 1 / 40, 30)
    names = [f"f{place}" for place in range(len(above_percent))]
    sizes = {
        name: common * (1 + above / 100 + spread / 100 * rng.standard_normal(30))
        for name, above in zip(names, above_percent, strict=True)
    }
    pairs = list(itertools.combinations(names, 2))
    compared = paired_differences({(b, a): sizes[b] - sizes[a] for a, b in pairs})
    found = set()
    for (first, second), comparison in compared.items():
        scale, one = 100 / sizes[second].mean(), comparison.simultaneous
        percent = replace(one, estimate=scale * one.estimate, low=scale * one.low, high=scale * one.high)
        effect = Difference(percent, comparison.verdict, percent).effect(1.0)
        true = (1 + above_percent[names.index(first)] / 100) / (1 + above_percent[names.index(second)] / 100) - 1
        if effect == "equivalent" and abs(true) >= 0.01 - 1e-12:
            found.add("wrongly equivalent")
        if effect in ("better", "worse") and abs(true) < 1e-12:
            found.add("wrongly different")
        if (effect == "worse" and true < 0) or (effect == "better" and true > 0):
            found.add("wrong side")
        found.add(effect)
    return found


@pytest.mark.parametrize(
    "above",
    [
        (0.0, 1.0),
        (0.0, 0.0, 1.0),
        *(pytest.param(above, marks=pytest.mark.slow) for above in ((0.0, 0.0), (0.0, 1.0, 2.0))),
    ],
)
def test_wrong_claims_are_rarer_than_the_level_allows(above: tuple[float, ...]) -> None:
    """Filters alike, and filters exactly as far apart as matters: no kind of wrong claim in more than 5 % of trials.

    The bound is the 0.9999 quantile of the number of errors in as many trials at a rate of exactly 5 %.
    """
    rng, trials = np.random.default_rng(20261129), 120
    found = [_effects(rng, above, spread=0.8) for _ in range(trials)]
    most = stats.binom.ppf(0.9999, trials, 0.05)
    for wrong in ("wrongly equivalent", "wrongly different", "wrong side"):
        assert sum(wrong in one for one in found) <= most


def test_alike_filters_are_called_alike_and_far_ones_worse() -> None:
    """The power, with intervals of about a third of the margin: 30 runs of spread 0.5 % (standard error 0.13 %)."""
    rng, trials = np.random.default_rng(5), 60
    alike = [_effects(rng, (0.0, 0.1), spread=0.5) for _ in range(trials)]
    far = [_effects(rng, (0.0, 5.0), spread=0.5) for _ in range(trials)]
    assert sum(one == {"equivalent"} for one in alike) >= stats.binom.ppf(0.0001, trials, 0.99)
    assert all(one == {"worse"} for one in far)
