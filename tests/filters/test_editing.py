"""Measurement editing: which measurements are rejected, what a lock-out does, and who can't edit."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from every_filter import KINDS, small_options
from scipy.stats import binom, chi2

from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.filters.run import advance
from relnav_sim.measurements.converted_radar import ConvertedRadar
from relnav_sim.measurements.spherical_radar import SightNoise
from relnav_sim.streams import RandomSource

DT = 1.0
F = np.array([[1, DT, 0, 0], [0, 1, 0, 0], [0, 0, 1, DT], [0, 0, 0, 1]])
Q = np.kron(np.eye(2), 1e-4 * np.array([[DT**3 / 3, DT**2 / 2], [DT**2 / 2, DT]]))
H = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0]])
R = np.diag([1.0, 4.0])
P0 = np.diag([4.0, 0.25, 4.0, 0.25])
EDITING = {"probability": 0.99, "max_rejects": 3}


def problem(runs=6, epochs=60, step_at=None, size=0.0, seed=1):
    """Truth and measurements of the filter's own model; from `step_at` on the first position is another."""
    rng = np.random.default_rng(seed)
    mean0 = np.zeros((runs, 4))
    x = mean0 + rng.standard_normal((runs, 4)) @ np.linalg.cholesky(P0).T
    truth, z = np.empty((runs, epochs, 4)), np.empty((runs, epochs, 2))
    for k in range(epochs):
        x = x @ F.T + rng.standard_normal((runs, 4)) @ np.linalg.cholesky(Q).T
        if k == step_at:
            x = x + np.array([size, 0, 0, 0])
        truth[:, k], z[:, k] = x, x @ H.T + rng.standard_normal((runs, 2)) @ np.sqrt(R)
    return truth, z, mean0


def made(kind="kf", measurement=None, **options):
    measurement = LinearMeasurement(H, R) if measurement is None else measurement
    return create_filter(kind, LinearDynamics(F, Q), measurement, **(small_options(kind) | options))


def transcribed(z, m, P, p, n_max, action=None, scope="sensor", inflation=10.0):
    """Return the means of one run by the text-book, a measurement after the other, and what happened to each."""
    rejects, means, events = np.zeros(1 if scope == "sensor" else 2, dtype=int), [], []
    for reading in z:
        m, P = F @ m, F @ P @ F.T + Q
        here = ~np.isnan(reading)
        told = ""
        if here.any():
            units = [np.flatnonzero(here)] if scope == "sensor" else [np.array([i]) for i in np.flatnonzero(here)]
            places = [0] if scope == "sensor" else list(np.flatnonzero(here))
            fails = []
            for unit in units:
                h, r = H[unit], R[np.ix_(unit, unit)]
                nu = reading[unit] - h @ m
                fails.append(nu @ np.linalg.inv(h @ P @ h.T + r) @ nu > chi2.ppf(p, len(unit)))
            was = rejects >= n_max
            locked_before = was.any()
            refused = []
            for place, fail in zip(places, fails, strict=True):
                rejects[place] = rejects[place] + 1 if fail else 0
                if fail and not (action == "accept" and was[place]):
                    refused.append(place)
            if action == "accept" and len(refused) < sum(fails):
                told = "accept"
            if action == "restart" and refused and locked_before:
                P, refused, told = P0 + np.diag(np.diag(P)), [], "restart"
                h, r = H[here], R[np.ix_(here, here)]
                nu = reading[here] - h @ m
                P = P * max(1.0, nu @ np.linalg.inv(h @ P @ h.T + r) @ nu / here.sum())
                rejects[:] = 0
            taken = np.concatenate([u for q, u in zip(places, units, strict=True) if q not in refused] or [[]])
            taken = taken.astype(int)
            if len(taken):
                h, r = H[taken], R[np.ix_(taken, taken)]
                K = P @ h.T @ np.linalg.inv(h @ P @ h.T + r)
                m, P = m + K @ (reading[taken] - h @ m), (np.eye(4) - K @ h) @ P
            if action == "inflate" and any(rejects[q] >= n_max for q in refused):
                P, told = inflation * P, "inflate"
        means.append(m)
        events.append(told)
    return np.array(means), events


@pytest.mark.parametrize("scope", ["sensor", "channel"])
@pytest.mark.parametrize("action", [None, "accept", "inflate", "restart"])
def test_editing_is_the_text_books_one_run_after_the_other(scope, action):
    _, z, mean0 = problem(4, 45, step_at=20, size=15.0)
    rng = np.random.default_rng(5)
    z = np.where(rng.random(z.shape) < 0.15, np.nan, z)  # partial measurements, and some that are missing altogether
    editing = EDITING | {"scope": scope, "action": action}
    history = run_filter(made(editing=editing), z, mean0, P0)
    acted = 0
    for run in range(len(z)):
        means, events = transcribed(z[run], mean0[run], P0, 0.99, 3, action, scope)
        np.testing.assert_allclose(history.mean[run], means, rtol=0, atol=1e-9)
        assert [bool(event) for event in events] == history.edits_by[""]["actions"][run].astype(bool).tolist()
        acted += sum(map(bool, events))
    assert (acted > 0) == (action is not None)


@pytest.mark.parametrize("scope", ["sensor", "channel"])
def test_false_rejections_are_as_many_as_the_probability_says(scope):
    """Under the filter's own model; 99.9 % binomial interval of the tests, whose innovations are independent."""
    p, runs, epochs = 0.99, 200, 100
    _, z, mean0 = problem(runs, epochs, seed=3)
    history = run_filter(
        made(editing={"probability": p, "scope": scope, "max_rejects": 1, "action": "accept"}), z, mean0, P0
    )
    edits = history.edits_by[""]
    tests = int(edits["tests"].sum())
    assert tests == runs * epochs * (1 if scope == "sensor" else 2)
    failed = int(edits["rejected"].sum())
    low, high = binom.ppf([0.0005, 0.9995], tests, 1 - p)
    # What was rejected is missing afterwards: the filter knows that, so its NIS stays chi-square.
    assert low <= failed <= high


def test_a_step_of_the_true_state_is_lost_by_the_gate_and_recovered_in_time():
    """10 sigma of the predicted reading: lost in over 90 % of runs, back within N + k epochs by each action."""
    runs, N, at = 150, 3, 60
    free = run_filter(made(), *problem(2, 120)[1:], P0)
    S = (H @ (F @ free.covariance[0, -1] @ F.T + Q) @ H.T + R)[0, 0]
    truth, z, mean0 = problem(runs, at + 53 + 11 * N, step_at=at, size=10 * np.sqrt(S), seed=8)
    limit = chi2.ppf(0.999, 4)

    def outside(action):
        history = run_filter(made(editing={"probability": 0.999, "max_rejects": N, "action": action}), z, mean0, P0)
        e = history.mean - truth
        return np.einsum("bki,bki->bk", e, np.linalg.solve(history.covariance, e[..., None])[..., 0])[:, at:] > limit

    assert outside(None)[:, : 10 * N].all(axis=1).mean() > 0.9
    # Accepting widens nothing: it takes as long as the filter takes that rejects nothing.
    for action, k in (("restart", 1), ("inflate", 2), ("accept", 50)):
        inside = ~outside(action)[:, N + k : N + k + 10 * N].any(axis=1)
        assert inside.mean() > 0.9, action


def test_gate_probability_is_the_former_name_of_a_gate_alone():
    _, z, mean0 = problem(step_at=20, size=6.0)
    former = run_filter(made(gate_probability=0.99), z, mean0, P0)
    now = run_filter(made(editing={"probability": 0.99}), z, mean0, P0)
    for name in ("mean", "covariance", "nis", "log_likelihood"):
        assert np.array_equal(getattr(former, name), getattr(now, name))
    assert np.array_equal(former.extras["rejected"], now.extras["rejected"], equal_nan=True)
    with pytest.raises(ValueError, match="former name"):
        made(gate_probability=0.99, editing={"probability": 0.99})


@pytest.mark.parametrize("action", ["inflate", "restart"])
@pytest.mark.parametrize("kind", ["ukf", "mkf"])
def test_bits_of_a_run_do_not_depend_on_the_block(kind, action):
    _, z, mean0 = problem(4, 40, step_at=15, size=15.0)
    z[1, 16:20] = np.nan
    filter = made(kind, editing=EDITING | {"action": action})
    whole = run_filter(filter, z, mean0, P0)
    for run in range(4):
        alone = run_filter(made(kind, editing=EDITING | {"action": action}), z[[run]], mean0[[run]], P0, runs=[run])
        assert np.array_equal(alone.mean[0], whole.mean[run])
        assert np.array_equal(alone.covariance[0], whole.covariance[run])
    assert whole.edits_by[""]["actions"].sum() > 0


@pytest.mark.parametrize("kind", KINDS)
def test_every_filter_edits_or_says_why_not(kind):
    truth, z, mean0 = problem(2, 24, step_at=12, size=40.0)
    if not filter_kinds()[kind].edits:
        mixtures = {"imm", "gaussian_sum", "particle", "unscented_particle", "gp_particle", "mf_upf"}
        why = dict.fromkeys(mixtures, "its belief is no single Gaussian")
        why["batch_least_squares"] = "each measurement is part of the fit that it would be judged by"
        with pytest.raises(ValueError, match=f"the {kind} filter has no editing: {why[kind]}"):
            made(kind, editing=EDITING)
        return
    for action in ("accept", "inflate", "restart"):
        history = run_filter(made(kind, editing=EDITING | {"action": action}), z, mean0, P0)
        edits = history.edits_by[""]
        assert not history.failures
        assert (edits["lock_outs"].sum(axis=1) > 0).all()
        assert (edits["actions"].sum(axis=1) > 0).all()
        assert (edits["row_epochs"][edits["lock_outs"] > 0] == 2).all()  # three in a row of a reading each epoch
        if action == "restart":
            assert (np.abs(history.mean[:, -1, 0] - truth[:, -1, 0]) < 5).all()


def test_sensors_are_judged_by_themselves():
    """One of two sensors is wrong: its measurements are rejected, the other's are not, and it stays locked out."""
    _, z, mean0 = problem(5, 50, seed=4)
    wrong = z.copy()
    wrong[:, 20:] += 30.0
    wrong[:, 30:32] = np.nan  # a lock-out outlasts epochs without a measurement
    sensors = {"right": LinearMeasurement(H, R), "wrong": LinearMeasurement(H, R)}
    filter = made(measurement=sensors, editing={"probability": 0.9999, "max_rejects": 3})
    history = run_filter(filter, {"right": z, "wrong": wrong}, mean0, P0)
    right, bad = history.edits_by["right"], history.edits_by["wrong"]
    assert right["rejected"].sum() == right["lock_outs"].sum() == 0
    there = np.isfinite(wrong[0, :, 0])
    assert (bad["tests"] == there).all()
    assert (bad["rejected"][:, there] == (np.arange(50) >= 20)[there]).all()
    assert (bad["lock_outs"] == (np.arange(50) == 22)).all()
    assert bad["locked"][:, 22:][:, there[22:]].all() and not bad["actions"].any()
    alone = run_filter(made(), z[:, :20], mean0, P0)
    assert np.array_equal(history.extras_by["right"]["rejected"].sum(axis=1), np.zeros(5)) and not alone.edits_by


@pytest.mark.parametrize(
    ("editing", "said"),
    [
        ({}, "probability: Field required"),
        ({"probability": 1.0}, "less than 1"),
        ({"probability": 0.99, "action": "pray"}, "'accept', 'inflate' or 'restart'"),
        ({"probability": 0.99, "max_rejects": 0}, "greater than or equal to 1"),
        ({"probability": 0.99, "inflation": 5.0}, "inflation needs action: inflate"),
        ({"probability": 0.99, "N": 5}, "N: Extra inputs"),
        (0.99, "must be a mapping"),
    ],
)
def test_wrong_options_are_refused_in_a_sentence(editing, said):
    with pytest.raises(ValueError, match=said):
        made(editing=editing)


def test_channels_of_a_converted_position_are_not_judged_one_by_one():
    noise = SightNoise(np.ones(1), np.ones((1, 3)), np.ones(3), np.zeros((3, 3)), "total")
    with pytest.raises(ValueError, match="count as a whole"):
        create_filter(
            "kf",
            LinearDynamics(np.eye(6), np.eye(6)),
            ConvertedRadar(np.eye(3), noise),
            editing={"probability": 0.99, "scope": "channel"},
        )


def test_the_example_of_the_page_says_what_it_prints(capsys):
    page = (Path(__file__).parents[2] / "docs" / "editing.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    exec(code, {})
    assert capsys.readouterr().out.strip() == code.rstrip().rpartition("# ")[2]


@pytest.mark.parametrize("scope", ["sensor", "channel"])
@pytest.mark.parametrize("action", [None, "restart"])
def test_residuals_by_channel_are_those_of_what_was_taken(scope, action):
    """Each rejected channel of the counts, and no other, is left out; those of a fix that restarts a run too."""
    options = {"probability": 0.9, "max_rejects": 3, "scope": scope} | ({"action": action} if action else {})
    _, z, mean0 = problem(step_at=20, size=15.0)
    z[:, ::7, 1] = np.nan
    z[2, 30:33] = np.nan
    filter = made("ekf", editing=options)
    belief = filter.start(Gaussian(mean0, np.repeat(P0[None], len(z), axis=0)), RandomSource(0, tuple(range(len(z)))))
    _, history = advance(filter, belief, z, 0, DT, with_residuals=True)
    (residuals,) = history.residuals_by.values()
    (edits,) = history.edits_by.values()
    read = ~np.isnan(z)
    np.testing.assert_array_equal(~np.isnan(residuals.residual), read)
    np.testing.assert_array_equal(np.isnan(residuals.accepted), residuals.rejected | ~read)
    judged = 1 if scope == "channel" else np.maximum(read.sum(axis=2), 1)
    counted = edits["rejected"] * judged
    restarted = edits["actions"] > 0
    np.testing.assert_array_equal(residuals.rejected.sum(axis=2)[~restarted], counted[~restarted])
    assert counted.any() and (residuals.rejected.any(axis=2)[restarted]).all()
    assert restarted.any() == (action == "restart")
    assert history.residuals_cpu_s > 0
