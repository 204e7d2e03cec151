"""What all filters of a replay find in the readings that they share is one finding."""

from types import SimpleNamespace

import numpy as np
import pytest

from relnav_sim.measurements.channel import Channel
from relnav_sim.report.replay import shared_findings
from relnav_sim.statistics.residual_checks import FilterChecks, channel_check

N = 2000
RNG = np.random.default_rng(1)
WHITE, NOISE = RNG.standard_normal((2, 1, N))
WANDERING = NOISE + 0.5 * np.roll(NOISE, 1)  # correlation 0.4 at lag 1


def filter_with(azimuth):
    channels = [
        channel_check("radar", Channel(name, "rad", name), residual, np.ones((1, N)))
        for name, residual in (("elevation", WHITE), ("azimuth", azimuth))
    ]
    return SimpleNamespace(checks=FilterChecks(tuple(channels), (), None))


@pytest.mark.parametrize(
    "azimuths, said", [([WANDERING] * 3, True), ([WANDERING, WHITE], False), ([WANDERING], False), ([WHITE] * 2, False)]
)
def test_only_what_every_one_of_several_finds_is_shared(azimuths, said):
    sentence = shared_findings([filter_with(each) for each in azimuths])
    assert bool(sentence) == said
    if said:
        assert sentence.startswith("All 3 filters find the residuals of radar azimuth not white")
        assert "one finding and not 3" in sentence and "chance (5 %" in sentence
