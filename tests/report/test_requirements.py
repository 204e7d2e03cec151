"""`requirements:` of a campaign, judged on results whose numbers are known."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats
from typer.testing import CliRunner

from relnav_sim.campaign.requirements import ErrorsRequirement
from relnav_sim.cli.app import app
from relnav_sim.report.requirements import concerned, in_sentences, judgements, requirement_in_words, requirements_table
from relnav_sim.results import layout, open_results
from relnav_sim.results.block import ResultsError
from relnav_sim.statistics.requirements import Judgement

ResultMaker = Callable[..., Path]
RUNS = 100


def judged(path: Path) -> list[Judgement]:
    with open_results(path) as results:
        return list(judgements(results))


def one(make_result: ResultMaker, requirement: dict[str, Any], **options: Any) -> Judgement:
    options = {"runs": RUNS, "filters": {"ekf": 1.0}} | options
    (found,) = judged(make_result(requirements={"wanted": requirement}, **options))
    return found


def test_errors_are_counted_in_the_stored_series(make_result: ResultMaker) -> None:
    path = make_result(runs=40, filters={"ekf": 1.0}, failed={"ekf": [3]})
    with open_results(path) as results:
        r = np.linalg.norm(results.error(0, "ekf")[..., :3], axis=-1)[:, 1:]
    late = r[:, 9:]  # t >= 1000 s
    for kept, options in ((r, {}), (late, {"from_s": 1000.0})):
        share = float((kept < 2).mean())  # a failed run's NaN counts as too large
        found = one(
            make_result, {"kind": "errors", "below_m": 2, "share": 0.5, **options}, runs=40, failed={"ekf": [3]}
        )
        assert found.finding is not None
        assert found.finding.figure.estimate == pytest.approx(share, rel=1e-12)
        assert found.basis == "stored epochs, one in 100"


def _with_largest(make_result: ResultMaker, rule: dict[str, Any], largest: np.ndarray, **options: Any) -> Judgement:
    """Return the judgement where the largest position errors of the runs, whole and settled, are (runs, 2)."""
    values = np.ones((len(largest), 2, len(layout.QUANTITIES)))
    values[..., layout.QUANTITIES.index("r")] = largest
    return one(make_result, rule, runs=len(largest), summaries={"ekf": {"max": values}}, **options)


def _stored_largest(make_result: ResultMaker, runs: int) -> np.ndarray:
    with open_results(make_result(runs=runs, filters={"ekf": 1.0})) as results:
        r = np.linalg.norm(results.error(0, "ekf")[..., :3], axis=-1)
        settled = results.time_s(0) >= 500
    return np.stack([r[:, 1:].max(axis=1), r[:, settled].max(axis=1)], axis=1)


def test_ensemble_counts_runs_by_their_largest_error_at_every_epoch(make_result: ResultMaker) -> None:
    """Against the binomial closed form; two runs have a peak that no stored epoch shows, a third one failed."""
    stored = _stored_largest(make_result, 80)
    limit = float(stored.max()) + 0.1
    largest = stored.copy()
    largest[[4, 9], 0] = limit + 1
    rule = {"kind": "errors", "interpretation": "ensemble", "below_m": limit, "share": 0.9}
    found = _with_largest(make_result, rule, largest, failed={"ekf": [3]})
    exact = stats.binomtest(77, 80).proportion_ci(0.95, "exact")
    assert found.finding is not None and found.basis == "every epoch, by the largest error of each run"
    figure = found.finding.figure
    assert (figure.estimate, figure.low, figure.high) == pytest.approx((77 / 80, exact.low, exact.high))
    assert found.verdict == ("pass" if exact.low >= 0.9 else "undecided")
    assert found.finding.certainty == pytest.approx(1 - stats.binom.sf(76, 80, 0.9))
    # After settling the two peaks are over; the failed run stays a miss.
    late = _with_largest(make_result, rule | {"from_s": 500.0}, largest, failed={"ekf": [3]})
    assert late.finding is not None and late.finding.figure.estimate == pytest.approx(79 / 80)


def test_ensemble_is_not_decided_by_what_lies_between_stored_epochs(make_result: ResultMaker) -> None:
    """From 1000 s on no span fits: the settled maximum clears runs, and cannot tell when others had their peak."""
    stored = _stored_largest(make_result, 80)
    limit = float(stored.max()) + 0.1
    rule = {"kind": "errors", "interpretation": "ensemble", "below_m": limit, "share": 0.9, "from_s": 1000.0}
    clear = _with_largest(make_result, rule, stored)
    assert clear.verdict == "pass" and clear.finding is not None and clear.finding.figure.estimate == 1
    peaks = stored.copy()
    peaks[:20] = limit + 1
    open_ = _with_largest(make_result, rule, peaks)
    assert open_.verdict == "undecided" and open_.finding is not None
    assert open_.basis == "stored epochs, one in 100; 20 runs may exceed the limit between them"
    low, high = stats.binomtest(60, 80).proportion_ci(0.95, "exact").low, 1.0
    assert (open_.finding.figure.low, open_.finding.figure.high) == pytest.approx((low, high))
    few = _with_largest(make_result, rule | {"share": 0.5}, peaks)
    assert few.verdict == "pass"  # even if all of them do
    low_limit = float(np.sort(stored[:, 1])[10])
    missed = _with_largest(make_result, rule | {"below_m": low_limit}, peaks)
    assert missed.verdict == "fail"


def test_temporal_counts_runs_by_their_share_of_time(make_result: ResultMaker) -> None:
    path = make_result(runs=80, filters={"ekf": 1.0}, failed={"ekf": [3]})
    with open_results(path) as results:
        r = np.linalg.norm(results.error(0, "ekf")[..., :3], axis=-1)[:, 1:]
    share = 0.9
    limit = float(np.nanquantile(r, 0.95))
    kept = int(((r < limit).mean(axis=1) >= share).sum())
    assert 0 < kept < 80
    rule = {"kind": "errors", "interpretation": "temporal", "below_m": limit, "share": share, "of_runs": 0.5}
    found = one(make_result, rule, runs=80, failed={"ekf": [3]})
    exact = stats.binomtest(kept, 80).proportion_ci(0.95, "exact")
    assert found.finding is not None and found.basis == "stored epochs, one in 100"
    figure = found.finding.figure
    assert (figure.estimate, figure.low, figure.high) == pytest.approx((kept / 80, exact.low, exact.high))
    # A limit above all errors: every run but the failed one; by default 95 % of the runs must, which 80 can't show.
    loose = one(make_result, rule | {"below_m": 1e6, "of_runs": None}, runs=80, failed={"ekf": [3]})
    assert loose.verdict == "undecided" and loose.finding is not None
    assert loose.finding.figure.estimate == pytest.approx(79 / 80)


def test_all_runs_met_is_wilks(make_result: ResultMaker) -> None:
    """At 90 %, which leaves 5 % on each side, 59 runs without a miss show 95 %, and 58 do not (Wilks 1941)."""
    rule = {"kind": "errors", "interpretation": "temporal", "below_m": 1e6, "share": 0.9, "confidence": 0.9}
    assert one(make_result, rule, runs=59).verdict == "pass"
    one_less = one(make_result, rule, runs=58)
    assert one_less.verdict == "undecided" and one_less.finding is not None
    assert one_less.finding.runs_to_decide == 59


def test_the_interpretation_is_said() -> None:
    said = {
        interpretation: requirement_in_words(
            ErrorsRequirement(kind="errors", interpretation=interpretation, below_m=2, share=0.997)
        )
        for interpretation in ("ensemble", "temporal", "mixed")
    }
    assert said == {
        "ensemble": "position errors below 2 m at all times in 99.7 % of the runs, ensemble interpretation",
        "temporal": "position errors below 2 m for 99.7 % of the time in 95 % of the runs, temporal interpretation",
        "mixed": "99.7 % of position errors below 2 m, mixed interpretation",
    }


def test_errors_inside_a_distance(make_result: ResultMaker) -> None:
    """The invented truth stands 12 km off: inside 12 km is everything, inside 11 km nothing."""
    near = {"kind": "errors", "below_m": 2, "share": 0.5}
    everything = one(make_result, near)
    inside = one(make_result, near | {"inside_m": 12000})
    assert inside.finding == everything.finding
    nothing = one(make_result, near | {"inside_m": 11000})
    assert nothing.finding is None and nothing.verdict == "undecided" and nothing.basis == "no such epoch"


@pytest.mark.parametrize(("limit", "verdict"), [(0.5, "fail"), (5.0, "pass")])
def test_rms(make_result: ResultMaker, limit: float, verdict: str) -> None:
    found = one(make_result, {"kind": "rms", "below_m": limit})
    assert found.verdict == verdict and found.basis == "every epoch"


@pytest.mark.parametrize(("size", "verdict"), [(1.0, "pass"), (1.3, "fail"), (0.6, "fail"), (1.1, "undecided")])
def test_nees(make_result: ResultMaker, size: float, verdict: str) -> None:
    assert one(make_result, {"kind": "nees"}, filters={"ekf": size}).verdict == verdict


def test_converged_by_both_thresholds(make_result: ResultMaker) -> None:
    times = np.where(np.arange(RUNS) < 99, 30.0, np.nan)
    levels = np.full((RUNS, 7), np.nan)
    levels[:40, 2] = 55.0
    summary = {"ekf": {"convergence": times, "convergence_level": levels}}
    found = one(make_result, {"kind": "converged", "within_s": 60, "share": 0.9}, summaries=summary)
    assert found.finding is not None and found.finding.figure.estimate == 0.99 and found.verdict == "pass"
    rule = {"kind": "converged", "within_s": 60, "share": 0.9, "below_m": 5}
    found = one(make_result, rule, summaries=summary)
    assert found.finding is not None and found.finding.figure.estimate == 0.4 and found.verdict == "fail"


@pytest.mark.parametrize(
    ("converged", "failed", "verdict"), [(99, 0, "pass"), (30, 0, "undecided"), (60, 0, "undecided"), (30, 40, "fail")]
)
def test_converged_where_the_run_ends_within_the_hold_time(
    make_result: ResultMaker, converged: int, failed: int, verdict: str
) -> None:
    """Runs are seen to converge up to 20 s. One that does not may have done so later; one that failed has not."""
    summary = {"ekf": {"convergence": np.where(np.arange(RUNS) < converged, 10.0, np.nan)}}
    found = one(
        make_result,
        {"kind": "converged", "within_s": 60, "share": 0.8},
        summaries=summary,
        variables=[{"statistics.convergence_hold_s": 5980.0}],
        failed={"ekf": range(RUNS - failed, RUNS)} if failed else {},
    )
    assert found.verdict == verdict and "after 20 s cannot be judged" in found.basis
    early = {"kind": "converged", "within_s": 20, "share": 0.8}
    known = one(make_result, early, summaries=summary, variables=[{"statistics.convergence_hold_s": 5980.0}])
    assert known.verdict == ("pass" if converged == 99 else "fail") and known.basis == "every epoch"


@pytest.mark.usefixtures("undrawn", "unrendered")
def test_converged_where_no_run_is_longer_than_the_hold_time(make_result: ResultMaker) -> None:
    path = make_result(
        runs=20,
        filters={"ekf": 1.0},
        requirements={"quick": {"kind": "converged", "within_s": 60, "share": 0.5}},
        summaries={"ekf": {"convergence": np.full(20, np.nan)}},
        variables=[{"statistics.convergence_hold_s": 6000.0}],
    )
    (found,) = judged(path)
    assert found.finding is None and found.verdict == "undecided" and found.basis.startswith("cannot be judged")
    assert in_sentences([found])[0].endswith(
        "undecided for ekf; cannot be judged: the run is not longer than the hold time."
    )
    said = CliRunner().invoke(app, ["report", str(path), "--check", "--format", "md"])
    assert said.exit_code == 5 and "cannot be judged" in said.output


def test_lost_runs(make_result: ResultMaker) -> None:
    outside = np.where(np.arange(RUNS) < 7, 0.2, 0.0)
    options: dict[str, Any] = {"summaries": {"ekf": {"outside_late": outside}}, "failed": {"ekf": [5, 50]}}
    found = one(make_result, {"kind": "failed", "at_most": 0.1}, **options)
    assert found.finding is not None and found.finding.figure.estimate == pytest.approx(0.02)
    found = one(make_result, {"kind": "diverged", "at_most": 0.02}, **options)
    assert found.finding is not None and found.finding.figure.estimate == pytest.approx(0.08)
    assert found.verdict == "fail"


def test_only_the_filters_that_are_named(make_result: ResultMaker) -> None:
    rule = {"wanted": {"kind": "nees", "filters": ["kf"]}}
    found = judged(make_result(requirements=rule, labels=("a=1", "a=2"), runs=20))
    assert [(item.case, item.filter) for item in found] == [(0, "kf"), (1, "kf")]


def test_words_and_table(make_result: ResultMaker) -> None:
    rules = {
        "docking": {"kind": "errors", "below_m": 1, "share": 0.997, "inside_m": 500},
        "quick": {"kind": "converged", "within_s": 60, "share": 0.95},
        "sharp": {"kind": "rms", "quantity": "vx", "below_m_s": 0.001},
    }
    with open_results(make_result(requirements=rules, runs=20)) as results:
        found = judgements(results)
        table = requirements_table(results, found)
    words = list(dict.fromkeys(requirement_in_words(item.requirement) for item in found))
    assert words == [
        "99.7 % of position errors below 1 m inside 500 m, mixed interpretation",
        "converged within 60 s, first passage, in 95 % of the runs",
        "RMS of vx errors below 0.001 m/s, steady state",
    ]
    assert len(table.rows) == 9 and table.rows[0].label.startswith("docking: 99.7 %")
    assert (
        "Requirement sharp (RMS of vx errors below 0.001 m/s, steady state): missed by kf, ekf and ukf."
        in in_sentences(found)
    )


@pytest.mark.usefixtures("undrawn", "unrendered")
@pytest.mark.parametrize(
    ("rule", "code"),
    [
        ({"kind": "rms", "below_m": 100}, 0),
        ({"kind": "rms", "below_m": 0.001}, 4),
        ({"kind": "converged", "within_s": 1000, "share": 0.999}, 5),
    ],
)
def test_exit_codes(make_result: ResultMaker, rule: dict[str, Any], code: int) -> None:
    path = make_result(requirements={"wanted": rule}, runs=12, filters={"ekf": 1.0})
    found = CliRunner().invoke(app, ["report", str(path), "--check", "--format", "csv"])
    assert found.exit_code == code, found.output
    said = {
        0: "requirements: pass\n",
        4: "requirements: fail (wanted: ekf)",
        5: "requirements: undecided (wanted: ekf)",
    }
    assert said[code] in found.output
    assert (path.with_suffix("") / "tables" / "requirements.csv").is_file()


def test_whom_a_verdict_is_about_with_its_cases_where_there_are_several(make_result: ResultMaker) -> None:
    wanted = {"small": {"kind": "rms", "below_m": 0.7}, "tiny": {"kind": "rms", "below_m": 1e-6}}
    path = make_result(requirements=wanted, runs=40, labels=("a", "b"), filters={"kf": 1.0, "ekf": 0.1})
    found = judged(path)
    assert [item.case for item in found if (item.name, item.filter, item.verdict) == ("small", "kf", "fail")] == [1]
    assert concerned(found, "fail") == "small: kf (case 1); tiny: kf (cases 0 and 1), ekf (cases 0 and 1)"


def test_check_without_requirements_is_a_mistake(make_result: ResultMaker) -> None:
    found = CliRunner().invoke(app, ["report", str(make_result(runs=2, filters={"ekf": 1.0})), "--check"])
    assert found.exit_code == 2 and "has no requirements" in found.output


def test_damaged_requirements_are_one_sentence(make_result: ResultMaker) -> None:
    path = make_result(requirements={"wanted": {"kind": "nes"}}, runs=2)
    with pytest.raises(ResultsError, match="requirements are damaged"):
        judged(path)
