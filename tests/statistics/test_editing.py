"""Lock-outs, recoveries and losses, against a transcription of their definitions run by run."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from relnav_sim.results.block import EDIT_ENDS, Editing
from relnav_sim.statistics.editing import EditingAccumulator
from relnav_sim.statistics.errors import ScoringRules
from relnav_sim.statistics.recovery import recovered_in_time

N, HOLD, STEP_S, EPOCHS = 2, 20, 5.0, 200
RULES = ScoringRules(
    step_s=STEP_S, epochs=EPOCHS, store_every=1, settle_s=50.0, convergence_m=1.0, convergence_hold_s=1.0
)
LIMIT = chi2.ppf(0.999, 6)


def sequences(runs=40, seed=3):
    """NEES and counts of two sensors, in stretches inside and outside, locked and not."""
    rng = np.random.default_rng(seed)

    def stretches(p):
        switch = rng.random((runs, EPOCHS)) < p
        return np.cumsum(switch, axis=1) % 2 == 1

    nees = np.where(stretches(0.02), 100.0, 3.0)
    edits = {}
    for name in ("a", "b"):
        tests = (rng.random((runs, EPOCHS)) < 0.8).astype(int)
        locked = (stretches(0.02) & (tests > 0)).astype(int)
        lock_outs = ((rng.random((runs, EPOCHS)) < 0.01) & (tests > 0)).astype(int)
        edits[name] = {
            "tests": tests,
            "rejected": ((rng.random((runs, EPOCHS)) < 0.1) & (tests > 0)).astype(int),
            "lock_outs": lock_outs,
            "actions": lock_outs,
            "locked": locked,
            "row_epochs": lock_outs * np.minimum(rng.integers(0, 4, (runs, EPOCHS)), np.arange(EPOCHS) - 1),
        }
        for counts in edits[name].values():
            counts[:, 0] = 0  # the start
    failed = np.where(np.arange(runs) % 7 == 3, 120, -1)
    return nees, edits, failed


def accumulated(nees, edits, failed, ends=(EPOCHS,)):
    held, first = EditingAccumulator(len(nees), RULES, ("a", "b"), N), 0
    for end in ends:
        part = {name: {what: x[:, first:end] for what, x in counts.items()} for name, counts in edits.items()}
        held.add(first, nees[:, first:end], part, np.where(failed < end, failed, -1))
        first = end
    return held.result()


def transcribed(nees, edits, failed):
    """One run, by the definitions of docs/editing.md."""
    end = EPOCHS if failed < 0 else failed
    inside = [k > 0 and k < end and nees[k] <= LIMIT for k in range(EPOCHS)]
    locked, state = [], {"a": 0, "b": 0}
    for k in range(EPOCHS):
        for name in state:
            if edits[name]["tests"][k] and k < end:
                state[name] = edits[name]["locked"][k]
        locked.append(any(state.values()))
    starts = {}
    for k in range(1, end):
        rows = [edits[name]["row_epochs"][k] for name in "ab" if edits[name]["lock_outs"][k]]
        if rows:
            starts[k] = k - max(rows)
    took, since, last = [], None, None
    for k in range(1, EPOCHS):
        if k in starts:
            since, last = (starts[k] if since is None else since), k
        if (
            since is not None
            and k - HOLD + 1 >= last
            and all(inside[i] and not locked[i] for i in range(k - HOLD + 1, k + 1))
        ):
            took.append((k - HOLD + 1 - since) * STEP_S)
            since = None
    out = "".join("o" if k < end and not inside[k] else "." for k in range(1, EPOCHS))
    lost = sum(len(part) >= HOLD for part in out.split("."))
    return took, since, lost, (inside, locked, last)


def inside_now(row, inside, locked, last):
    k = EPOCHS - 1 - row
    return k >= last and inside[k] and not locked[k]


def test_the_statistics_are_those_of_the_definitions():
    nees, edits, failed = sequences()
    found = accumulated(nees, edits, failed)
    recoveries = 0
    for run in range(len(nees)):
        own = {name: {what: x[run] for what, x in counts.items()} for name, counts in edits.items()}
        took, since, lost, state = transcribed(nees[run], own, failed[run])
        assert found.recoveries[run] == len(took)
        assert np.array_equal(found.recovery[run], max(took, default=np.nan), equal_nan=True)
        assert found.lost[run] == lost
        assert (found.end[run] == EDIT_ENDS.index("none")) == (since is None)
        if since is not None:
            assert found.open[run] == (EPOCHS - 1 - since) * STEP_S
            row = 0  # epochs inside and not locked out up to the end, none of them before the last lock-out
            while inside_now(row, *state):
                row += 1
            assert found.earliest[run] == (EPOCHS - row - since) * STEP_S
        recoveries += len(took)
    assert recoveries > 5 and set(found.end.tolist()) == set(range(5)) and found.lost.sum() > 5
    sound = (failed[:, None] < 0) | (np.arange(EPOCHS) < failed[:, None])
    for place, name in enumerate("ab"):
        assert np.array_equal(found.tests[:, 0, place], (edits[name]["tests"] * sound).sum(axis=1))
        assert np.array_equal(found.rejected[:, 1, place], (edits[name]["rejected"] * sound)[:, 10:].sum(axis=1))


def test_they_do_not_depend_on_chunks():
    nees, edits, failed = sequences()
    whole, parts = accumulated(nees, edits, failed), accumulated(nees, edits, failed, (1, 2, 50, 130, EPOCHS))
    for name in ("tests", "lock_outs", "actions", "recoveries", "recovery", "lost", "open", "end"):
        assert np.array_equal(getattr(whole, name), getattr(parts, name), equal_nan=True)


@pytest.mark.parametrize(
    ("lock_outs", "lost", "recovery", "end", "earliest", "failed", "concerned", "met", "possible"),
    [
        (0, 0, np.nan, "none", np.nan, False, False, False, False),
        (1, 0, 40.0, "none", np.nan, False, True, True, True),
        (1, 1, 40.0, "none", np.nan, False, True, True, True),
        (1, 1, 80.0, "none", np.nan, False, True, False, False),
        (0, 1, np.nan, "none", np.nan, False, True, False, False),  # lost, and nobody noticed
        (1, 0, np.nan, "adopted", 500.0, False, True, False, False),
        (1, 0, np.nan, "not_seen", 30.0, False, True, False, True),
        (1, 0, np.nan, "rejecting", 61.0, False, True, False, False),
        (0, 0, np.nan, "none", np.nan, True, True, False, False),
    ],
)
def test_recovered_in_time(lock_outs, lost, recovery, end, earliest, failed, concerned, met, possible):
    zero = np.zeros((1, 2, 1), dtype=int)
    held = Editing(
        ("a",), zero, zero, np.array([[lock_outs]]), zero[:, 0], np.array([int(recovery == recovery)]),
        np.array([recovery]), np.array([lost]), np.array([earliest]), np.array([earliest]),
        np.array([EDIT_ENDS.index(end)]),
    )  # fmt: skip
    found = recovered_in_time(held, np.array([failed]), 60.0)
    assert (found.concerned[0], found.met[0], found.possible[0]) == (concerned, met, possible)
