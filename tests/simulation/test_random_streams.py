import zlib

import numpy as np
import pytest

from relnav_sim.streams import generator


@pytest.mark.parametrize("seed", [0, 7, 2**32 - 1, 2**32, 2**70])
@pytest.mark.parametrize("run", [0, 3, 2**32 - 1, 2**32])
def test_a_stream_is_numpys_of_the_seed_spawned_by_run_and_name(seed, run):
    sequence = np.random.SeedSequence(seed, spawn_key=(run, zlib.crc32(b"sensor.radar.noise")))
    expected = np.random.default_rng(sequence).bit_generator.state
    assert generator(seed, run, "sensor.radar.noise").bit_generator.state == expected


def test_a_negative_seed_is_refused():
    with pytest.raises(ValueError, match="non-negative"):
        generator(-1, 0, "sensor.radar.noise")
