"""What must fit together where estimates are improved afterwards, or readings come late."""

from __future__ import annotations

from collections.abc import Iterator

from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import Clock, exact
from relnav_sim.campaign.problems import Path, Problem, listed
from relnav_sim.filters.registry import filter_kinds


def check_afterwards(name: str, entry: FilterEntry, clock: Clock | None) -> Iterator[Problem]:
    """Yield a smoother that the filter can't have."""
    smoother = entry.smoother
    if smoother is None:
        return
    path: Path = ("filters", name, "smoother")
    kinds = filter_kinds()
    if not kinds[entry.kind].smooths:
        can = listed([kind for kind, each in kinds.items() if each.smooths], "and")
        yield Problem(
            path, f"the {entry.kind} filter is no single Gaussian that a smoother can go back over; {can} are"
        )
    if any(option.mode == "consider" for option in entry.augment):
        yield Problem(
            path,
            "a state that is accounted for without being estimated makes the filter's gain other than the best, which "
            "a smoother can't go back by; take estimate, or leave this key out",
        )
    if smoother != "rts" and clock is not None:
        lag_s = smoother.fixed_lag.lag_s
        steps = exact(lag_s) / exact(clock.step_s)
        if steps.denominator != 1:
            near = [float(exact(clock.step_s) * each) for each in (steps.__floor__(), steps.__ceil__()) if each > 0]
            yield Problem(
                (*path, "fixed_lag", "lag_s"),
                f"{lag_s:g} s is no whole number of steps of {clock.step_s:g} s; "
                f"take {' or '.join(f'{x:.12g}' for x in near)}",
            )
        elif lag_s >= clock.duration_s:
            yield Problem(
                (*path, "fixed_lag", "lag_s"),
                f"{lag_s:g} s is not shorter than the run, {clock.duration_s:g} s; take rts",
            )
