"""Manoeuvres: when a case plans them, for reports that mark them; and what its filters are told unless they say."""

from __future__ import annotations

from typing import NamedTuple

from relnav_sim.campaign.entries import KnownThrust
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.sensors import Sensors, own_sensor


class ManoeuvreTime(NamedTuple):
    """One planned manoeuvre; an impulse ends when it starts."""

    name: str
    craft: str
    start_s: float
    end_s: float


def default_thrust(sensors: Sensors) -> KnownThrust:
    """Return what a filter is told of thrust that does not say: what is measured where anything is, else the plan."""
    return "planned" if own_sensor(sensors, "force") is None else "measured"


def manoeuvre_times(config: CaseConfig) -> tuple[ManoeuvreTime, ...]:
    """Return when the manoeuvres of a case are planned, in order of time; s after the start of the run."""
    found = [ManoeuvreTime(name, each.craft, each.time_s, each.end_s) for name, each in config.truth.manoeuvres.items()]
    return tuple(sorted(found, key=lambda each: (each.start_s, each.name)))
