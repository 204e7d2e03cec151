"""An estimator that passes over all of a run again and again, in the memory of a chunk of epochs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.history import FilterHistory
from relnav_sim.filters.passes import last_pass, unfit, with_unfit
from relnav_sim.simulation.chunks import Chunk
from relnav_sim.simulation.fed_filter import FedFilter
from relnav_sim.simulation.spill import Spill


class Repeated:
    """Keeps what arrives, and passes over it as often as the estimator asks.

    Args:
        make: Makes the estimator anew; it is fed from the first chunk on in each pass.
    """

    def __init__(self, make: Callable[[], FedFilter]) -> None:
        self._make = make
        self._chunks: Spill[Chunk] = Spill()

    def add(self, chunk: Chunk) -> None:
        """Take down the next chunk."""
        self._chunks.append(chunk)

    def results(
        self, prior: Gaussian, reached: Callable[[int], None], with_residuals: bool
    ) -> Iterator[tuple[FedFilter, Chunk, FilterHistory]]:
        """Yield the chunks with the estimates of the last pass, from the first on, and the estimator as it was there.

        Args:
            prior: What is known at epoch 0.
            reached: Told of every epoch that begins, in every pass.
            with_residuals: As in `filters.run.advance`.
        """

        def go(begin: Any) -> Any:
            fed, belief = self._make(), begin
            for place in range(len(self._chunks)):
                belief, _ = fed.advance(belief, self._chunks[place], prior, reached)
            return belief

        fed = self._make()
        belief = last_pass(fed.filter, fed.start(prior), go)
        start, reasons = Gaussian(belief.mean, belief.covariance), unfit(fed.filter, belief)
        for place in range(len(self._chunks)):
            chunk = self._chunks[place]
            belief, history = fed.advance(belief, chunk, start, reached, with_residuals)
            yield fed, chunk, history if place else with_unfit(history, reasons, 0)
