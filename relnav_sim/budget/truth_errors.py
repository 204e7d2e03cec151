"""What varies in the truth from run to run, one number at a time: dispersions and execution errors of manoeuvres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.budget.linearised import LinearFilter
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig, DispersedStart, FirstFixStart
from relnav_sim.simulation.thrust_inputs import known_thrust
from relnav_sim.streams import RandomSource, Streams
from relnav_sim.truth import truth_trajectory

SIZE = 0.1
"""Of an injected number, in its sigmas: far above the error of an integration, and small against what bends a path."""

_MANOEUVRE = "truth.manoeuvre."


@dataclass(frozen=True)
class TruthNumber:
    """One standardised number that the truth of a run draws.

    Attributes:
        stream: The name of its stream.
        place: Which of the numbers.
    """

    stream: str
    place: int

    @property
    def name(self) -> str:
        """What it is called."""
        words = self.stream.removeprefix("truth.").replace(".", " ")
        return f"{words} {self.place + 1}" if self.place else words


def truth_numbers(config: CaseConfig, entry: FilterEntry) -> list[TruthNumber]:
    """Return the numbers that the truth of a case draws and that a filter is not told of.

    How a manoeuvre was carried out is known where thrust is measured.
    """
    if not config.truth.is_dispersed:
        return []
    asked: list[TruthNumber] = []
    truth_trajectory(config.truth, config.clock.duration_s, _Injected(0, (0,), (), asked))
    measured = known_thrust(entry, config) == "measured"
    return [one for one in asked if not (measured and one.stream.startswith(_MANOEUVRE))]


def with_truth_errors(filter: LinearFilter, config: CaseConfig, numbers: Sequence[TruthNumber]) -> LinearFilter:
    """Return a filter whose response has a column for each number of the truth, behind those that it has.

    Where such a number moves the true state by delta, a prediction from the true state lacks delta_k - F delta_{k-1},
    and so does a start that does not follow the truth lack delta_0.
    """
    if not numbers:
        return filter
    delta = _moved(filter, config, numbers)
    columns = np.zeros((*filter.left_out.shape, len(numbers)))
    columns[1:] = filter.transition[1:] @ delta[:-1] - filter.kept[1:] @ delta[1:]
    if isinstance(config.start, FirstFixStart):
        columns[0, 3:6] = -delta[0, 3:6]
    elif not isinstance(config.start, DispersedStart):
        columns[0] = -delta[0]
    return replace(filter, response=np.concatenate([filter.response, columns], axis=2))


def _moved(filter: LinearFilter, config: CaseConfig, numbers: Sequence[TruthNumber]) -> Array:
    """Return what each number does to the true relative state, (T, n, J); zero for augmented states."""
    source = _Injected(0, tuple(range(1 + len(numbers))), tuple(numbers))
    relative = truth_trajectory(config.truth, config.clock.duration_s, source).at(filter.times_s).relative
    delta = np.zeros((*filter.left_out.shape, len(numbers)))
    delta[:, :6] = (relative[1:] - relative[:1]).transpose(1, 2, 0) / SIZE
    return delta


@dataclass(frozen=True)
class _Injected(RandomSource):
    """Random numbers none of which is drawn: zeros, and in run j the number j - 1 is `SIZE`."""

    numbers: tuple[TruthNumber, ...] = ()
    asked: list[TruthNumber] = field(default_factory=list)

    def streams(self, name: str) -> Streams:
        """Return the numbers of a stream."""
        return _InjectedStream(self, name)


class _InjectedStream(Streams):
    def __init__(self, source: _Injected, name: str) -> None:
        self._source, self._name = source, name

    def normal(self, *shape: int) -> Array:
        """Return standard normal numbers, (runs, *shape)."""
        return self._put(shape)

    def uniform(self, *shape: int) -> Array:
        """Return numbers of [0, 1) about 1/2, whose standard deviation is that of a uniform law."""
        return 0.5 + np.sqrt(1 / 12) * self._put(shape)

    def _put(self, shape: tuple[int, ...]) -> Array:
        size = int(np.prod(shape))
        self._source.asked.extend(TruthNumber(self._name, place) for place in range(size))
        values = np.zeros((len(self._source.runs), size))
        for run, one in enumerate(self._source.numbers, start=1):
            if one.stream == self._name:
                values[run, one.place] = SIZE
        return values.reshape(-1, *shape)
