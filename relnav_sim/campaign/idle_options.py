"""Options that change nothing beside the others: what a user gave and may wrongly rely on."""

from __future__ import annotations

from collections.abc import Sequence

from relnav_sim.campaign.models import CaseConfig
from relnav_sim.sensors.noise import NoisePart, OutageNoise, noise_parts
from relnav_sim.sensors.noise.fault import FaultOptions
from relnav_sim.truth import TruthOptions
from relnav_sim.truth.force_options import AtmosphereOptions


def idle_options(config: CaseConfig) -> list[str]:
    """Return a sentence on each part of a case's truth and sensors that has no effect; none where all has."""
    truth, found = config.truth, late_windows(config)
    if not isinstance(truth, TruthOptions):
        return found
    drag = truth.forces.drag
    if drag != "exponential" and truth.forces.atmosphere != AtmosphereOptions():
        why = "the layers have densities of their own" if drag == "layers" else "there is no drag"
        found.append(
            f"truth.forces.atmosphere has no effect with drag: {drag}, as {why}; leave it out, or take exponential."
        )
    if truth.earth_orientation is not None and not _turns(config, truth):
        why = "the campaign has no date" if truth.start_epoch is None else "nothing depends on how the Earth is turned"
        found.append(f"truth.earth_orientation has no effect, as {why}; leave it out.")
    return found


def late_windows(config: CaseConfig) -> list[str]:
    """Return a sentence on each outage and fault of a sensor that begins after the end of the run."""
    end_s, found = config.clock.duration_s, []
    for name, sensor in config.flown.sensors.items():
        for part in noise_parts(sensor.noise):
            for start_s, until_s in _spans(part):
                if start_s > end_s:
                    until = "" if until_s is None else f" to {until_s:g}"
                    found.append(
                        f"sensors.{name}.noise: the {part.kind} from {start_s:g}{until} s has no effect, as the run "
                        f"ends at {end_s:g} s."
                    )
    return found


def _spans(part: NoisePart) -> Sequence[tuple[float, float | None]]:
    if isinstance(part, FaultOptions):
        return ((part.from_s, part.until_s),)
    return part.windows_s if isinstance(part, OutageNoise) else ()


def _turns(config: CaseConfig, truth: TruthOptions) -> bool:
    """Return whether something may depend on how the Earth is turned at a date."""
    if truth.start_epoch is None:
        return False
    own = [each for each in (truth.chief, truth.deputy) if each.ephemeris is not None]
    fixed = [
        each for each in (truth.chief, truth.deputy) if each.cartesian is not None and each.cartesian.frame == "ITRF"
    ]
    believing = [entry for entry in config.filters.values() if "epoch" in entry.dynamics.needs]
    return bool(truth.forces.gravity is not None or own or fixed or believing)
