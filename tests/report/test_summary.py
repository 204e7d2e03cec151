import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relnav_sim.plots.facts import case_facts
from relnav_sim.report.consistency import consistency_in_words
from relnav_sim.report.ranking import Ranking, rank
from relnav_sim.report.summary import summarise, verdict
from relnav_sim.results import open_results
from relnav_sim.statistics.consistency_verdict import Consistency, consistency_of
from relnav_sim.statistics.intervals import Interval
from relnav_sim.wording import counted, listed, significant

ResultMaker = Callable[..., Path]


def rankings_of(path: Path) -> list[Ranking]:
    with open_results(path) as results:
        return [rank(case_facts(results, index)) for index in range(len(results.headers))]


def rms(position: NDArray[np.float64]) -> NDArray[np.float64]:
    """RMS of every span and component, (runs, 2, 8), from one figure per run."""
    return np.repeat(np.repeat(position[:, None, None], 2, axis=1), 8, axis=2)


def test_the_best_filter_is_named_with_its_margin(make_result: ResultMaker) -> None:
    sentence = summarise(rankings_of(make_result(filters={"kf": 1.0, "ekf": 0.5}, runs=10)))[0]
    assert sentence.startswith("ekf has the smallest position error, RMS 0.3")
    assert re.search(r"; kf is 100 % \[[89]\d(\.\d)?, 1\d\d\] worse\.$", sentence)


def test_filters_that_differ_by_chance_are_undecided(make_result: ResultMaker) -> None:
    rng = np.random.default_rng(3)
    a, b = rng.normal(1.0, 0.1, 30), rng.normal(1.0, 0.1, 30)
    path = make_result(filters={"a": 1.0, "b": 1.0}, runs=30, summaries={"a": {"rms": rms(a)}, "b": {"rms": rms(b)}})
    (ranking,) = rankings_of(path)
    sentence = verdict(ranking)
    first, second = ("a", "b") if a.mean() < b.mean() else ("b", "a")
    assert sentence.startswith(f"No significant difference in position error between {first} and {second} at 30 runs")
    assert ranking.undecided[0].against_best is not None
    low, high = ranking.undecided[0].against_best.difference.low, ranking.undecided[0].against_best.difference.high
    assert low <= 0 <= high


def test_one_run_decides_nothing(make_result: ResultMaker) -> None:
    sentences = summarise(rankings_of(make_result(runs=1)))
    assert sentences[0].startswith("One run decides nothing.")
    assert not any("[" in sentence for sentence in sentences)


def test_too_few_runs_decide_nothing_however_far_the_filters_are_apart(make_result: ResultMaker) -> None:
    few = rankings_of(make_result(filters={"kf": 1.0, "ekf": 0.01}, runs=5))
    assert summarise(few)[0].startswith("5 runs in common can't decide between 2 filters: it takes 6 or more. Position")
    cases = rankings_of(make_result(filters={"kf": 1.0, "ekf": 0.01}, runs=5, labels=("a=1", "a=2")))
    assert summarise(cases)[0] == "5 runs in common can't decide between 2 filters: it takes 6 or more."
    enough = rankings_of(make_result(filters={"kf": 1.0, "ekf": 0.01}, runs=6))
    assert summarise(enough)[0].startswith("ekf has the smallest position error")


def test_cases_are_counted(make_result: ResultMaker) -> None:
    sentences = summarise(rankings_of(make_result(labels=("a=1", "a=2", "a=3"), filters={"kf": 1.0, "ekf": 0.5})))
    assert sentences[0] == "ekf has the smallest position error in all 3 cases (the next is 100 % worse)."
    assert sentences[2].startswith("Case 1 (a=2): ekf has the smallest")


def test_consistency_is_told_in_words(make_result: ResultMaker) -> None:
    text = " ".join(summarise(rankings_of(make_result(filters={"good": 1.0, "bold": 3.0, "shy": 0.5}, runs=40))))
    assert "good is consistent (ANEES near 1)" in text
    assert re.search(r"bold is overconfident: actual error (3|2\.9\d*|3\.0\d*) times the formal sigma", text)
    assert re.search(r"shy is conservative: formal sigma 2\S* times the actual error", text)


def test_failures_missing_runs_and_lost_convergence_are_told(make_result: ResultMaker) -> None:
    never = {"ekf": {"convergence": np.array([10.0, np.nan, 12.0, 14.0])}}
    path = make_result(runs=4, planned=10, failed={"ukf": [3]}, summaries=never)
    text = " ".join(summarise(rankings_of(path)))
    assert "Failed runs, left out of every mean: ukf 1 of 4." in text
    assert "The campaign is not finished: 18 runs of its filters still to come." in text
    assert "never reached by ekf in 1 of 4 runs" in text


def test_nothing_completed_is_no_crash(make_result: ResultMaker) -> None:
    path = make_result(runs=3, filters={"ekf": 1.0}, failed={"ekf": [0, 1, 2]})
    assert summarise(rankings_of(path))[0].startswith("No run was completed")


def test_words() -> None:
    assert [listed(["a"]), listed(["a", "b"]), listed(["a", "b", "c"])] == ["a", "a and b", "a, b and c"]
    assert [counted(1, "run"), counted(2, "run")] == ["1 run", "2 runs"]
    assert [significant(0.012345), significant(123.4), significant(0.0), significant(3e-9)] == [
        "0.0123",
        "123",
        "0",
        "3.00e-09",
    ]


def test_the_runs_to_look_at_are_named(make_result: ResultMaker) -> None:
    a, b = np.linspace(1.0, 1.1, 9), np.linspace(2.0, 1.9, 9)
    a[6], b[6], b[2] = 2.1, 4.9, 5.85
    path = make_result(
        filters={"a": 1.0, "b": 1.0, "c": 1.0},
        runs=9,
        summaries={"a": {"rms": rms(a)}, "b": {"rms": rms(b)}, "c": {"rms": rms(a)}},
    )
    (found,) = [sentence for sentence in summarise(rankings_of(path)) if sentence.startswith("Look at")]
    assert found.startswith("Look at run 2 (b, 3 times the median) and run 6 (a and c, 2 times the median): ")


def test_runs_that_a_filter_lost_are_told(make_result: ResultMaker) -> None:
    late = {"ekf": {"outside_late": np.array([0.0, 0.3, 0.0, 0.0])}}
    text = " ".join(summarise(rankings_of(make_result(runs=4, summaries=late))))
    assert "Diverged, yet in every mean: ekf in 1 of 4 runs." in text


def _with_ratios(ranking: Ranking, ratios: dict[str, Interval], mixtures: tuple[str, ...] = ()) -> Ranking:
    """Return a ranking with other ratios to the bound."""
    standings = tuple(
        replace(
            each,
            facts=replace(
                each.facts, times_bound=dict.fromkeys(("whole", "settled"), ratios[each.name]), host_mixtures=mixtures
            ),
        )
        for each in ranking.standings
    )
    return replace(ranking, standings=standings)


def test_a_ratio_surely_below_the_bound_is_explained(make_result: ResultMaker) -> None:
    (ranking,) = rankings_of(make_result(filters={"kf": 1.0, "ekf": 0.5}, runs=10))
    near, below = Interval(0.95, 0.9, 1.01, 0.95, 10), Interval(0.92, 0.87, 0.97, 0.95, 10)

    def said(ratios: dict[str, Interval], *mixtures: str) -> list[str]:
        return [each for each in summarise([_with_ratios(ranking, ratios, mixtures)]) if "he bound" in each]

    assert said({"kf": near, "ekf": near}) == []
    (sentence,) = said({"kf": near, "ekf": below})
    assert sentence.startswith("Surely below the bound: ekf. ") and "possible reasons" in sentence
    counted_by_variance = "The bound counts the mixture noise of star_tracker by its variance: a filter may be better"
    assert said({"kf": near, "ekf": near}, "star_tracker") == [f"{counted_by_variance} than it."]
    assert said({"kf": below, "ekf": below}, "star_tracker") == [
        f"{counted_by_variance} than it, as ekf and kf surely are."
    ]


def test_few_runs_are_not_called_consistent(make_result: ResultMaker) -> None:
    anees = np.repeat(np.repeat(np.array([0.1, 0.9, 2.2])[:, None, None], 2, axis=1), 3, axis=2)
    text = " ".join(
        summarise(rankings_of(make_result(filters={"ekf": 1.0}, runs=3, summaries={"ekf": {"anees": anees}})))
    )
    assert "Consistency: ekf may be consistent (its errors are " in text


def test_cases_are_judged_as_each_would_be_alone(make_result: ResultMaker) -> None:
    """One case is surely overconfident; the other one's interval contains 1, though its ANEES is as large."""
    rng = np.random.default_rng(4)
    scatter = rng.standard_normal((40, 1, 1))
    sure, unsure = (1.2 + width * (scatter - scatter.mean()) * np.ones((1, 2, 3)) for width in (0.1, 1.0))
    alone = []
    for anees in (sure, unsure):
        path = make_result(filters={"ekf": 1.0}, runs=40, summaries={"ekf": {"anees": anees}})
        alone.append(" ".join(summarise(rankings_of(path))))
    assert "ekf is overconfident: actual error 1.1 times the formal sigma" in alone[0]
    assert "ekf is consistent (ANEES near 1)" in alone[1]
    found = [consistency_of(anees[:, 1]) for anees in (sure, unsure)]
    said = consistency_in_words(found)
    assert said == (
        "is overconfident in 1 of 2 cases: actual error 1.1 times the formal sigma, "
        "is consistent in 1 of 2 cases (ANEES near 1)"
    )


def test_few_runs_far_off_are_not_said_to_be_consistent():
    far = Consistency("may be consistent", "full", 679.0, 0.0, 1638.0)
    assert consistency_in_words([far]) == (
        "seems overconfident, not surely (its errors are 0 to 1638 times as large as its formal sigma)"
    )
    one_run = Consistency("may be consistent", "full", 1.02, float("nan"), float("nan"))
    assert consistency_in_words([one_run], several=True) == "may be consistent (one run does not tell)"
