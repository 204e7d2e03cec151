"""`python -m replication.wei2012.founders [RUNS]`: from how many of its first particles a particle set descends.

It flies the start of campaigns/mf_upf_depletion.yaml with 500 particles, which are not roughened.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from relnav_sim import Step, load_campaign, register_filter, run_campaign
from relnav_sim.arrays import Array, Indices
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.particle import ParticleFilter, ParticleOptions
from relnav_sim.filters.particle_set import ParticleSet
from relnav_sim.streams import RandomSource

CAMPAIGN = Path("campaigns/mf_upf_depletion.yaml")
EPOCHS = (1, 2, 3, 5, 10, 20)
_counted: list[tuple[int, Array]] = []


@register_filter("particle_founders", ParticleOptions)
class CountedParticleFilter(ParticleFilter):
    """A particle filter that remembers which first particle each particle descends from."""

    def start(self, prior: Gaussian, source: RandomSource) -> ParticleSet:
        """Return the first particles, each its own founder."""
        self._founders = np.tile(np.arange(self._particles), (len(prior.mean), 1))
        return super().start(prior, source)

    def update(self, belief: ParticleSet, z: Array, step: Step) -> tuple[ParticleSet, Any]:
        """Return the update, and note how many founders are left in each run."""
        updated = super().update(belief, z, step)
        _counted.append((step.epoch, np.array([len(np.unique(run)) for run in self._founders])))
        return updated

    def _ancestors(self, particle_set: ParticleSet, rows: Indices) -> Indices:
        chosen = super()._ancestors(particle_set, rows)
        self._founders[rows] = np.take_along_axis(self._founders[rows], chosen, axis=1)
        return chosen


def founders(runs: int, epochs: Iterable[int] = EPOCHS) -> dict[int, Array]:
    """Return the number of founders left after each epoch, (runs,)."""
    epochs = tuple(epochs)
    _counted.clear()
    overrides = [f"runs={runs}", f"clock.duration_s={max(epochs)}", "clock.store_every_s=1"]
    overrides += ["statistics.settle_s=0", "filters.pf.kind=particle_founders", "zip=null"]
    with tempfile.TemporaryDirectory() as folder:
        campaign = load_campaign(CAMPAIGN, overrides).with_filters(["pf"])
        run_campaign(campaign, Path(folder) / "founders.h5", backend="sequential")
    return {epoch: np.concatenate([counts for at, counts in _counted if at == epoch]) for epoch in epochs}


if __name__ == "__main__":
    for epoch, left in founders(int(sys.argv[1]) if len(sys.argv) > 1 else 100).items():
        line = f"epoch {epoch:2d}: one founder in {np.sum(left == 1)} of {len(left)} runs, at most {left.max()}"
        sys.stdout.write(line + "\n")
