"""The flight before the start: going back and flying forwards again must meet the start."""

import numpy as np
import pytest

from relnav_sim.streams import RandomSource
from relnav_sim.truth import TruthOptions, begun_earlier, truth_trajectory

ORBIT = {"a_km": 6778.0, "e": 0.001, "i_deg": 51.6}
CRAFT = {"mass_kg": 100.0, "area_m2": 1.0}
RELATIVE = {"position_m": (0.0, -2000.0, 100.0), "velocity_m_s": (0.05, 0.0, 0.1)}


def options(**deputy):
    return TruthOptions.model_validate(
        {
            "chief": {"orbit": ORBIT, "mass_kg": 200.0, "area_m2": 1.0},
            "deputy": {**CRAFT, **deputy},
            "dispersions": {"density": {"kind": "uniform", "half_width": 0.5}},
        }
    )


@pytest.mark.parametrize("deputy", [{"relative": RELATIVE}, {"orbit": {**ORBIT, "ta_deg": 0.1}}])
def test_the_earlier_flight_arrives_at_the_start(deputy):
    source = RandomSource(1, (0,))
    truth = options(**deputy)
    earlier = begun_earlier(truth, 11_000.0)
    assert not earlier.is_dispersed
    arrived = truth_trajectory(earlier, 11_000.0, source).at([11_000.0])
    undispersed = truth.model_copy(update={"dispersions": earlier.dispersions})
    start = truth_trajectory(undispersed, 1.0, source).at([0.0])
    assert np.abs(arrived.chief - start.chief)[..., :3].max() < 1e-4
    assert np.abs(arrived.relative - start.relative)[..., :3].max() < 1e-5
    assert np.abs(arrived.relative - start.relative)[..., 3:].max() < 1e-8


def test_a_craft_that_comes_from_below_the_surface():
    """A perigee 100 m up in the elements of the apogee is below the surface, half a revolution before it."""
    low = {"a_km": 7000.0, "e": 0.08881, "i_deg": 30.0, "ta_deg": 180.0}
    truth = TruthOptions.model_validate({"chief": {"orbit": low, **CRAFT}, "deputy": {**CRAFT, "orbit": low}})
    with pytest.raises(ValueError, match="below the surface"):
        begun_earlier(truth, 3000.0)
