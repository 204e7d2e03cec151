"""`relnav export --to oem`: the orbits of a run, true or estimated, as Orbit Ephemeris Messages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.cli.exported_runs import chosen_case, chosen_runs, file_of, writable
from relnav_sim.cli.failures import UserError
from relnav_sim.cli.output import say
from relnav_sim.wording import first_of

if TYPE_CHECKING:
    from relnav_sim.arrays import Array, Mask
    from relnav_sim.campaign import Campaign
    from relnav_sim.recorded.oem_writing import OemOrbit
    from relnav_sim.results import Results


def export_orbits(
    results: Results,
    result: Path,
    part: str,
    case: str | None,
    filter: str | None,
    runs: Sequence[int],
    out: str | None,
    overwrite: bool,
) -> None:
    """Write the orbits of some runs, simulated again, at the stored epochs: a file for each craft and run.

    Args:
        results: An open result.
        result: Its path as the user gave it.
        part: ``truth``: chief and deputy; ``estimates``: the deputy by a filter, with covariance.
        case: Number, label or id of the case; None: the first.
        filter: Whose estimates; None: those of the only filter.
        runs: Numbers of the runs; none: the first that the result holds.
        out: The file, or a folder; None: beside the result.
        overwrite: Whether files may be replaced.

    Raises:
        UserError: The result has no such run or filter, or no calendar.
    """
    from relnav_sim.astro.epoch import now
    from relnav_sim.recorded.oem_writing import write_oem
    from relnav_sim.results.atomic import written_whole
    from relnav_sim.results.stored_campaign import stored_campaign

    index = chosen_case(results, case)
    chosen = chosen_runs(results, result, runs)
    names = list(results.headers[index].filters)
    if part == "estimates" and filter is None and len(names) > 1:
        raise UserError(f"the case has several filters; give --filter, one of {first_of(names)}")
    if filter is not None and filter not in names:
        raise UserError(f"the case has no filter {filter!r}; its filters are {first_of(names)}")
    campaign = stored_campaign(results)
    if campaign.cases[index].config.flown.truth.start_epoch is None:
        raise UserError(
            "an OEM holds calendar dates, and the campaign has none; give it a truth.epoch, as 2010-07-27T00:00:00 UTC"
        )
    what = part if part == "truth" else f"estimates_{filter or names[0]}"
    stem = f"{result.stem}_{what}" + (f"_case{index}" if len(campaign.cases) > 1 else "")
    crafts = ("chief", "deputy") if part == "truth" else ("deputy",)
    planned = {(run, craft): f"{stem}_run{run}_{craft}.oem" for run in chosen for craft in crafts}
    paths = {key: file_of(result, out, name, len(planned), "orbits") for key, name in planned.items()}
    for path in paths.values():
        writable(path, result, overwrite)
    for run in chosen:
        orbits = (
            _true(campaign, index, run) if part == "truth" else _estimated(campaign, index, filter or names[0], run)
        )
        for craft, orbit in orbits.items():
            path = paths[run, craft]
            with written_whole(path) as temporary:
                write_oem(temporary, orbit, now())
            say(f"wrote {path}")


def _true(campaign: Campaign, case: int, run: int) -> dict[str, OemOrbit]:
    """Return the true orbits of both craft."""
    from relnav_sim.simulation.chunks import simulate

    flown = simulate(campaign, case, [run])
    what = "True orbit, EME2000, as simulated"
    return {
        craft: _orbit(campaign, case, run, craft, flown.times_s, states[0], None, [what])
        for craft, states in (("chief", flown.chief), ("deputy", flown.deputy))
    }


def _estimated(campaign: Campaign, case: int, filter: str, run: int) -> dict[str, OemOrbit]:
    """Return the deputy's orbit as a filter estimates it."""
    from relnav_sim.simulation.estimates import estimated_orbit

    try:
        found = estimated_orbit(campaign, case, filter, run)
    except RuntimeError as error:
        raise UserError(f"the filter {filter} raised an exception: {error}") from None
    comments = [
        f"Estimate of the filter {filter}: its relative state, set on the true orbit of the chief, EME2000.",
        "The covariance is that of the relative state alone; what is not known of the orbit of the chief is not in it.",
    ]
    return {"deputy": _orbit(campaign, case, run, "deputy", found.times_s, found.states, found.covariance, comments)}


def _orbit(
    campaign: Campaign,
    case: int,
    run: int,
    craft: str,
    times_s: Array,
    states: Array,
    covariance: Array | None,
    comments: Sequence[str],
) -> OemOrbit:
    """Return an orbit at the stored epochs, as far as it goes.

    Raises:
        UserError: It holds nothing.
    """
    from relnav_sim.recorded.oem_writing import OemOrbit

    whole = campaign.cases[case]
    epoch = whole.config.flown.truth.start_epoch
    assert epoch is not None  # or nothing is written
    stored = np.arange(0, len(times_s), whole.config.clock.store_every)
    sound: Mask = np.asarray(np.isfinite(states[stored]).all(axis=1))
    if covariance is not None:
        sound &= np.isfinite(covariance[stored]).all(axis=(1, 2))
    kept = stored[: len(sound) if sound.all() else int(np.argmin(sound))]
    if not len(kept):
        raise UserError(f"run {run} has no {craft} orbit: it failed at its start")
    where = f"Campaign {campaign.name}, seed {campaign.seed}, case {whole.label}, run {run}."
    return OemOrbit(
        name=craft.upper(),
        epoch=epoch,
        times_s=times_s[kept],
        states=states[kept],
        covariance=None if covariance is None else covariance[kept],
        comments=[where, *comments],
    )
