"""What must fit together where estimates are improved afterwards, or a start is fitted to the first measurements."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import Clock, exact
from relnav_sim.campaign.problems import Path, Problem, listed
from relnav_sim.conventions import CHUNK_EPOCHS
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.sensors import Sensors, relative_sensors
from relnav_sim.sensors.arrivals import most_epochs_late

ONLY_INNOVATIONS = (
    "a filter that goes back for late measurements (out_of_sequence: buffer), or over the whole run, has residuals "
    "that are not about a prediction made before the measurement, and only such are white when it is consistent"
)
"""Why the residuals of some filters are not tested for correlation."""


def check_afterwards(name: str, entry: FilterEntry, clock: Clock | None) -> Iterator[Problem]:
    """Yield what a filter can't have of a smoother, a fitted start and passes over the whole run."""
    path: Path = ("filters", name)
    kind = filter_kinds()[entry.kind]
    considered = [option.kind for option in entry.augment if option.mode == "consider"]
    if kind.repeats:
        yield from _check_repeated(path, entry)
    if entry.smoother is not None:
        yield from _check_smoother(path, entry, considered, clock)
    if entry.batch_start is not None:
        yield from _check_start(path, entry, considered, clock)


def _check_repeated(path: Path, entry: FilterEntry) -> Iterator[Problem]:
    """Yield what makes no sense beside a fit of the whole run without process noise."""
    form = next((form for form in ("dmc", "adaptive") if getattr(entry.process_noise, form) is not None), None)
    if form is not None:
        yield Problem(
            (*path, "process_noise", form),
            f"{entry.kind} fits one trajectory without process noise; leave it out, or smooth a filter",
        )
    if entry.batch_start is not None:
        yield Problem((*path, "batch_start"), f"{entry.kind} is fitted to all measurements itself; leave this key out")


def _check_smoother(
    path: Path, entry: FilterEntry, considered: Sequence[str], clock: Clock | None
) -> Iterator[Problem]:
    kinds, smoother = filter_kinds(), entry.smoother
    path = (*path, "smoother")
    if kinds[entry.kind].repeats:
        yield Problem(path, f"{entry.kind} knows all measurements already; leave this key out")
    elif not kinds[entry.kind].smooths:
        can = listed([kind for kind, each in kinds.items() if each.smooths], "and")
        yield Problem(
            path, f"the {entry.kind} filter is no single Gaussian, which a smoother goes back over; {can} are"
        )
    if considered:
        yield Problem(
            path,
            f"{considered[0]} is accounted for without being estimated, so that the filter's gain is not the best one, "
            "and a smoother would go back by the wrong one; take mode: estimate, or leave this key out",
        )
    if entry.batch_start is not None:
        yield Problem(path, "a smoother goes back to the campaign's start, not to a fitted one; leave batch_start out")
    if smoother is None or smoother == "rts" or clock is None:
        return
    lag_s, path = smoother.fixed_lag.lag_s, (*path, "fixed_lag", "lag_s")
    yield from check_whole_steps(lag_s, clock.step_s, path)
    if lag_s >= clock.duration_s:
        yield Problem(path, f"{lag_s:g} s is not shorter than the run of {clock.duration_s:g} s; take smoother: rts")


def _check_start(path: Path, entry: FilterEntry, considered: Sequence[str], clock: Clock | None) -> Iterator[Problem]:
    path = (*path, "batch_start", "duration_s")
    if considered:
        yield Problem(
            path[:-1],
            f"a fit would estimate {considered[0]}, which the filter is only to account for; take mode: estimate, or "
            "leave this key out",
        )
    if entry.batch_start is None or clock is None:
        return
    duration_s = entry.batch_start.duration_s
    yield from check_whole_steps(duration_s, clock.step_s, path)
    if duration_s >= clock.duration_s:
        yield Problem(path, f"{duration_s:g} s leaves the filter nothing of a run of {clock.duration_s:g} s")
    elif duration_s > (longest_s := (CHUNK_EPOCHS - 2) * clock.step_s):
        yield Problem(path, f"a start is fitted to at most {CHUNK_EPOCHS - 2} steps, {longest_s:g} s here")


def check_late(name: str, entry: FilterEntry, sensors: Sensors, clock: Clock) -> Iterator[Problem]:
    """Yield what a filter can't do with measurements that arrive late."""
    if not set(entry.sensors or ()) <= set(relative_sensors(sensors)):
        return  # a sensor that is not there is said already
    drawn = {
        each: options.drawn_latency_s
        for each, options in relative_sensors(sensors, entry.sensors).items()
        if options.drawn_latency_s is not None
    }
    path: Path = ("filters", name, "out_of_sequence")
    afterwards = entry.smoother is not None or filter_kinds()[entry.kind].repeats
    if afterwards and entry.out_of_sequence is not None:
        yield Problem(path, "what is known afterwards has had all measurements in order; leave this key out")
    if not drawn:
        return
    slowest = max(drawn, key=lambda each: drawn[each][1])
    longest_s = drawn[slowest][1]
    if entry.smoother is not None and entry.smoother != "rts" and entry.smoother.fixed_lag.lag_s < longest_s:
        yield Problem(
            ("filters", name, "smoother", "fixed_lag", "lag_s"),
            f"measurements of {slowest} may arrive {longest_s:g} s late, after the estimate; take a lag no shorter",
        )
    elif entry.out_of_sequence == "buffer":
        yield from _check_buffer(path, entry, longest_s, slowest, clock)
    elif not afterwards:
        for each, (shortest_s, _) in drawn.items():
            if most_epochs_late((0.0, shortest_s), clock.step_s):
                yield Problem(
                    path,
                    f"every measurement of {each} arrives a step or more late ({shortest_s:g} s at least), so that "
                    "drop, the default, leaves the filter none of them; take buffer",
                )


def _check_buffer(path: Path, entry: FilterEntry, longest_s: float, slowest: str, clock: Clock) -> Iterator[Problem]:
    if most_epochs_late((0.0, longest_s), clock.step_s) >= CHUNK_EPOCHS:
        yield Problem(
            path,
            f"measurements of {slowest} may arrive {longest_s:g} s late, and a filter goes back at most "
            f"{CHUNK_EPOCHS - 1} steps, {(CHUNK_EPOCHS - 1) * clock.step_s:g} s here; take a larger clock.step_s, or "
            "drop",
        )
    if entry.process_noise.adaptive is not None:
        yield Problem(
            path,
            "a process noise that is found from the measurements is not gone back over; take another form of "
            "process_noise, or drop",
        )
    if entry.batch_start is not None:
        yield Problem(path, "a start is fitted to measurements that are in time; take drop, or leave out batch_start")


def tells_innovations(entry: FilterEntry) -> bool:
    """Whether each residual of a filter is about what it predicted before it had read on, as only those are white."""
    return entry.out_of_sequence != "buffer" and not filter_kinds()[entry.kind].repeats


def untested_residuals(filters: Mapping[str, FilterEntry]) -> list[str]:
    """Return a sentence on the filters that `statistics.whiteness` can't test; none where it can test all."""
    names = [name for name, entry in filters.items() if not tells_innovations(entry)]
    if not names:
        return []
    return [f"statistics.whiteness does not test the residuals of {listed(names, 'and')}: {ONLY_INNOVATIONS}."]


def check_whole_steps(value: float, step_s: float, path: Path) -> Iterator[Problem]:
    """Yield a problem where a time is no whole number of steps."""
    steps = exact(value) / exact(step_s)
    if steps.denominator == 1:
        return
    near = [float(exact(step_s) * count) for count in (steps.__floor__(), steps.__ceil__()) if count > 0]
    yield Problem(
        path,
        f"{value:g} s is no whole number of steps of {step_s:g} s; take {' or '.join(f'{x:.12g}' for x in near)}",
    )
