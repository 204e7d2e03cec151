"""What learned dynamics have learned, kept for the other filters and blocks of a case: learning takes seconds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.dynamics.context import Learn, TrainingTrack
from relnav_sim.simulation.training import training_track

T = TypeVar("T")


class Learned:
    """What is learned, by case, options, process noise and seed; whoever computes blocks owns one and hands it on."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str, str, int], Any] = {}

    def by(self, entry: FilterEntry, config: CaseConfig, seed: int) -> Learn:
        """Return what gives the dynamics of a filter what they learn, see `DynamicsContext.learn`."""
        case = config.model_copy(update={"filters": {}})
        options, noise = entry.dynamics, entry.process_noise

        def learn(fit: Callable[[TrainingTrack], T]) -> T:
            key = (case.model_dump_json(), options.model_dump_json(), noise.model_dump_json(), seed)
            if key not in self._known:
                self._known[key] = fit(training_track(config, options, noise, seed))
            known: T = self._known[key]
            return known

        return learn
