"""Tuning as a whole: linear problems with a known answer, and the small campaign."""

import numpy as np
import pytest

from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.campaign.models import TuneOptions
from relnav_sim.tuning import TuningError, tune_campaign
from relnav_sim.tuning import tune as tuning_module
from relnav_sim.tuning.objective import Figures, objective
from relnav_sim.tuning.search import search
from relnav_sim.tuning.tune import CHECK_WORD, SEARCH_WORD, derived_seed
from relnav_sim.tuning.words import sentences

TRUE_PSD, TRUE_SIGMA, RUNS, STEPS = 1e-3, 2.0, 40, 150


def matrices(psd):
    F = np.eye(6) + np.diag(np.ones(3), 3)
    Q = psd * np.kron([[1 / 3, 1 / 2], [1 / 2, 1]], np.eye(3))
    return F, Q


@pytest.fixture(scope="module")
def flights():
    """Random walks of the velocity with the true density, and noisy positions."""
    rng = np.random.default_rng(4)
    F, Q = matrices(TRUE_PSD)
    L = np.linalg.cholesky(Q)
    x, truth = np.zeros((RUNS, 6)), []
    for _ in range(STEPS):
        x = x @ F.T + rng.standard_normal((RUNS, 6)) @ L.T
        truth.append(x)
    truth = np.stack(truth, axis=1)
    return truth, truth[..., :3] + TRUE_SIGMA * rng.standard_normal((RUNS, STEPS, 3))


def judged(flights, psd, r_scale):
    truth, z = flights
    F, Q = matrices(psd)
    measurement = LinearMeasurement(np.eye(3, 6), r_scale * TRUE_SIGMA**2 * np.eye(3))
    filter = create_filter("kf", LinearDynamics(F, Q), measurement)
    history = run_filter(filter, z, np.zeros(6), np.eye(6))
    error = (history.mean - truth)[:, 30:]
    information = np.linalg.inv(history.covariance[0, 30:])  # of a linear filter, so that of all runs
    nees = np.einsum("bki,kij,bkj->bk", error, information, error)
    rms = np.sqrt(np.square(error[..., :3]).sum(axis=2).mean(axis=1))
    return Figures(rms[None], rms[None], nees.mean(axis=1)[None] / 6, np.zeros((1, RUNS), dtype=bool))


def searched(score, ranges, start, budget=25):
    """Return the numbers that the search finds on logarithmic ranges."""

    def values(point):
        return [low * (high / low) ** u for u, (low, high) in zip(point, ranges, strict=True)]

    asking = search(
        tuple(np.log(s / low) / np.log(high / low) for s, (low, high) in zip(start, ranges, strict=True)), budget
    )
    tried, points = {}, next(asking)
    while True:
        tried |= {point: score(*values(point)) for point in points}
        try:
            points = asking.send([tried[point].value for point in points])
        except StopIteration:
            best = min(tried, key=lambda point: tried[point].value)
            return values(best), tried[best]


@pytest.mark.parametrize("kind", ["position", "consistency", "both"])
def test_the_true_process_noise_is_found(flights, kind):
    def score(psd):
        return objective(judged(flights, psd, 1.0), kind, 0.25)

    (psd,), best = searched(score, [(1e-14, 1e-2)], [1e-7])
    at_truth = score(TRUE_PSD)
    # No worse than the truth, and not better than sampling lets it be; the error is flat, so the number less sure.
    difference = at_truth.per_run - best.per_run
    assert 0 <= difference.mean() <= 4 * difference.std(ddof=1) / np.sqrt(RUNS) + 1e-3
    assert abs(np.log10(psd / TRUE_PSD)) < (0.3 if kind == "position" else 0.1)


def test_both_numbers_are_found_where_the_covariance_counts(flights):
    def score(psd, r_scale):
        return objective(judged(flights, psd, r_scale), "both", 0.25)

    (psd, r_scale), best = searched(score, [(1e-8, 1e-1), (0.1, 100)], [1e-6, 10.0], budget=40)
    assert best.value <= score(TRUE_PSD, 1.0).value + 2e-3
    assert abs(np.log10(r_scale)) < 0.3
    assert abs(np.log10(psd / TRUE_PSD)) < 0.4


def test_process_noise_makes_good_a_factor_on_the_measurement_noise(flights):
    """The gain depends on Q / R alone: each factor on R has its own best Q, and all are equally accurate."""
    found = [
        searched(lambda psd, s=scale: objective(judged(flights, psd, s), "position", 1), [(1e-8, 1.0)], [1e-5])
        for scale in (1.0, 10.0)
    ]
    ((one,), first), ((ten,), second) = found
    assert np.log10(ten / one) == pytest.approx(1, abs=0.1)
    assert first.value == pytest.approx(second.value, abs=1e-3)


SMALL = TuneOptions(budget=8, runs=3, check_runs=3)


def test_seeds_are_their_own():
    seeds = {derived_seed(seed, word) for seed in (0, 5, 20251030) for word in (SEARCH_WORD, CHECK_WORD)}
    assert len(seeds - {0, 5, 20251030}) == 6
    assert derived_seed(20251030, SEARCH_WORD) == 2046855794474721556  # as in every file tuned so far


def test_a_campaign_is_tuned(make_campaign):
    tuning = tune_campaign(make_campaign(), SMALL, workers=1)
    assert list(tuning.filters) == ["kf", "ekf"]
    assert tuning.campaign.seed not in (tuning.seed, tuning.check_seed)
    for found in tuning.filters.values():
        assert len(found.evaluations) == SMALL.budget
        assert found.best.score.value <= found.start.score.value
        assert found.check is not None
        assert found.check.tuned.position.shape == (2, 3)


def test_the_campaigns_own_numbers_stand_first(make_campaign):
    campaign = make_campaign("filters.ekf.process_noise={acceleration_psd_m2_s3: 1.23456789e-7}")
    found = tune_campaign(campaign, SMALL, ("ekf",), cases=[1], workers=1).filters["ekf"]
    assert found.start.values == (1.23456789e-7,)
    assert found.start.figures.position.shape == (1, 3)


@pytest.fixture
def fake_bench(monkeypatch):
    """Return how to replace the simulation by a function of the entry and the run."""

    def install(figure):
        class Fake:
            def __init__(self, cases, seed, runs, *rest):
                self.runs = runs

            def blocks(self, candidates):
                return []

            def figures(self, candidates):
                found = []
                for candidate in candidates:
                    entry = candidate.entries[0]
                    rows = [figure(entry, run) for run in range(self.runs)]
                    values = np.array([[np.nan if row is None else row for row in rows]])
                    found.append(Figures(values, values, np.ones_like(values), np.isnan(values)))
                return found

        monkeypatch.setattr(tuning_module, "Bench", Fake)

    return install


def psd_of(entry):
    return np.log10(entry.process_noise.acceleration_psd_m2_s3)


def test_candidates_that_fail_are_infinitely_bad(make_campaign, fake_bench):
    fake_bench(lambda entry, run: None if run == 1 and psd_of(entry) < -9 else (1 + run) * np.exp(psd_of(entry)))
    found = tune_campaign(make_campaign(), TuneOptions(runs=4), ("ekf",)).filters["ekf"]
    assert -9 <= np.log10(found.best.values[0]) < -8.5
    assert any(e.score.value == np.inf for e in found.evaluations)


def test_a_run_that_nothing_gets_through_counts_for_none(make_campaign, fake_bench):
    fake_bench(lambda entry, run: None if run == 2 else 1 + (psd_of(entry) + 5) ** 2)
    tuning = tune_campaign(make_campaign(), TuneOptions(runs=4), ("ekf",))
    assert tuning.lost == (2,)
    assert tuning.filters["ekf"].best.values[0] == pytest.approx(1e-5, rel=0.1)


def test_nothing_gets_through(make_campaign, fake_bench):
    fake_bench(lambda entry, run: None)
    with pytest.raises(TuningError, match="no filter gets through"):
        tune_campaign(make_campaign(), SMALL)


def test_a_number_that_says_nothing_stays(make_campaign, fake_bench):
    """The figures depend on the process noise alone; a hair's breadth of r_scale is no reason to change it."""
    rng = np.random.default_rng(0)
    noise = np.exp(0.1 * rng.standard_normal(100))
    fake_bench(lambda entry, run: noise[run] * (1 + (psd_of(entry) + 6.5) ** 2 + 1e-9 * entry.r_scale))
    found = tune_campaign(make_campaign(), TuneOptions(), ("kf",)).filters["kf"]
    assert found.best.values[1] == 1.0
    assert np.log10(found.best.values[0]) == pytest.approx(-6.5, abs=0.1)
    assert found.as_good()[1][1] > 1


def test_in_a_band_the_least_error_that_is_consistent_is_taken(make_campaign, monkeypatch):
    """The error falls with the process noise, and the ANEES with it: the band's lower end decides."""

    class Fake:
        def __init__(self, cases, seed, runs, *rest):
            self.runs = runs

        def blocks(self, candidates):
            return []

        def figures(self, candidates):
            psds = [psd_of(candidate.entries[0]) for candidate in candidates]
            ones, failed = np.ones((1, self.runs)), np.zeros((1, self.runs), dtype=bool)
            return [Figures(ones * np.exp(-psd), ones, ones * 10 ** (-(psd + 7) / 4), failed) for psd in psds]

    monkeypatch.setattr(tuning_module, "Bench", Fake)
    options = TuneOptions(objective="in_band", anees_band=(0.8, 1.2))
    found = tune_campaign(make_campaign(), options, ("ekf",)).filters["ekf"]
    assert found.best.score.feasible and 0.8 <= found.best.figures.anees.mean() < 0.83
    out_of_reach = TuneOptions(objective="in_band", anees_band=(1e6, 2e6))
    tuning = tune_campaign(make_campaign(), out_of_reach, ("ekf",))
    assert not tuning.filters["ekf"].best.score.feasible
    assert any("NO candidate has its ANEES in [1e+06, 2e+06]" in sentence for sentence in sentences(tuning))


def test_a_band_the_wrong_way_round_is_refused():
    with pytest.raises(ValueError, match="anees_band must be two numbers above 0, the smaller one first"):
        TuneOptions(anees_band=(1.1, 0.9))
