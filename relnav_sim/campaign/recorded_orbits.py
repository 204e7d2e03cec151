"""What to know of the recorded orbits of a campaign before it runs: which rows of what files, and how well they fit."""

from __future__ import annotations

from math import isnan
from pathlib import Path

from relnav_sim.campaign.load import Campaign
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.campaign.warnings import together
from relnav_sim.recorded import Ephemeris
from relnav_sim.truth import EphemerisTruthOptions
from relnav_sim.truth.flown_orbits import flown
from relnav_sim.truth.thrust import CRAFT
from relnav_sim.wording import counted, significant


def recorded_orbits(campaign: Campaign) -> tuple[str, ...]:
    """Return a sentence on each recorded orbit that a campaign flies; none where it flies none."""
    return together([(case.label, _told(case.config)) for case in campaign.cases])


def _told(config: CaseConfig) -> list[str]:
    truth = config.truth
    if not isinstance(truth, EphemerisTruthOptions):
        return []
    epoch = truth.start_epoch
    orbits = [flown(truth.ephemeris, craft, epoch, config.clock.duration_s, truth.orientation) for craft in CRAFT]
    sentences = [_sentence(craft, orbit) for craft, orbit in zip(CRAFT, orbits, strict=True)]
    return [
        f"The run starts at {epoch.text()}.",
        *sentences,
        *dict.fromkeys(n for orbit in orbits for n in orbit.notes),
    ]


def _sentence(craft: str, orbit: Ephemeris) -> str:
    methods = dict.fromkeys(f"{s.interpolation.kind} of degree {s.interpolation.degree}" for s in orbit.spans)
    error = orbit.interpolation_error_m
    met = "too few rows to tell its error" if isnan(error) else f"withheld rows are met within {significant(error)} m"
    return (
        f"The {craft} flies {Path(orbit.path).name}: {counted(len(orbit.times_s), 'row')}, "
        f"interpolated by {' and '.join(methods)}; {met}."
    )
