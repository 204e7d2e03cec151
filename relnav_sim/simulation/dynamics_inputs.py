"""What the dynamics of a block's filters are built from and fed with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.dynamics.context import Arrival, ChiefFixes, DynamicsContext, Shared, Timed
from relnav_sim.sensors import own_sensor
from relnav_sim.sensors.noise import noise_parts, white_variance
from relnav_sim.simulation.chunks import Chunk
from relnav_sim.simulation.learned import Learned
from relnav_sim.simulation.thrust_inputs import known_thrust
from relnav_sim.truth import nominal_chief


class SharedThings:
    """What dynamics with the same options that are told of the same thrust share in a block, by its name."""

    def __init__(self) -> None:
        self._things: dict[str, Timed] = {}

    def of(self, name: str, make: Callable[[], Shared]) -> Shared:
        """Return it; made the first time. The same options ask for the same thing by the same name."""
        if name not in self._things:
            self._things[name] = make()
        found: Shared = self._things[name]  # type: ignore[assignment]
        return found

    @property
    def cpu_s(self) -> float:
        """CPU time spent on all of it in this block, s."""
        return sum(thing.cpu_s for thing in self._things.values())


class SharedByDynamics:
    """What the dynamics of a block share.

    Args:
        config: The case.
    """

    def __init__(self, config: CaseConfig) -> None:
        self._config = config
        self._things: dict[tuple[str, str], SharedThings] = {}

    def by(self, entry: FilterEntry) -> SharedThings:
        """Return what the dynamics of a filter share with others that believe the same and are told the same thrust."""
        key = entry.dynamics.model_dump_json(), known_thrust(entry, self._config)
        return self._things.setdefault(key, SharedThings())


def dynamics_context(
    entry: FilterEntry,
    config: CaseConfig,
    seed: int,
    learned: Learned,
    runs: int | None = None,
    shared: SharedThings | None = None,
) -> DynamicsContext:
    """Return what the dynamics of a filter are built from.

    Args:
        entry: The filter.
        config: The case.
        seed: The campaign's seed.
        learned: What is learned already.
        runs: Number of runs of the block that they will be fed with; None: they are not fed.
        shared: What they share in the block; None: nothing.
    """
    needs = entry.dynamics.needs
    context = DynamicsContext(
        orbit=nominal_chief(config.truth),
        process_noise=entry.process_noise,
        step_s=config.clock.step_s,
        chief_fixes=_chief_fixes(config, runs) if runs is not None and "chief_fixes" in needs else None,
        share=(shared or SharedThings()).of,
        epoch=config.truth.start_epoch,
    )
    return replace(context, learn=learned.by(entry, config, seed)) if "training_track" in needs else context


def _chief_fixes(config: CaseConfig, runs: int) -> ChiefFixes | None:
    """Return what is known of the chief's fixes; None without a receiver on the chief."""
    found = own_sensor(config.sensors, "orbit", "chief")
    if found is None:
        return None
    name, receiver = found
    sigmas = receiver.sigmas * np.sqrt(white_variance(noise_parts(receiver.noise)) or 1.0)
    return ChiefFixes(sigmas, runs, name)


def arrival(entry: FilterEntry, context: DynamicsContext, chunk: Chunk, forces: Array | None) -> Arrival | None:
    """Return what the dynamics of a filter are fed with before a chunk; None where they need nothing.

    Args:
        entry: The filter.
        context: What they are built from.
        chunk: The epochs.
        forces: What the filter is told of thrust; None: nothing.
    """
    needs = entry.dynamics.needs
    if needs.isdisjoint({"chief_fixes", "known_thrust"}):
        return None
    fixes = None if context.chief_fixes is None else chunk.z[context.chief_fixes.sensor]
    return Arrival(chunk.first_epoch, fixes, forces if "known_thrust" in needs else None)
