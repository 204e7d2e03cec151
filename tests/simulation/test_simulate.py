"""Truth and measurements as arrays: shapes, the same bits for a run in any company, the same as the filters see."""

import numpy as np

import relnav_sim.simulation.chunks as module
from relnav_sim import simulate
from relnav_sim.streams import RandomSource


def test_shapes_and_start(campaign):
    simulation = simulate(campaign(), case=0, runs=range(3))
    assert simulation.times_s.tolist() == list(range(41))
    for array in (simulation.chief, simulation.deputy, simulation.relative):
        assert array.shape == (3, 41, 6)
    assert {name: z.shape for name, z in simulation.z.items()} == {
        "radar": (3, 41, 3),
        "gnss": (3, 41, 6),
        "star_tracker": (3, 41, 4),
    }
    assert simulation.inputs["radar"].shape == simulation.inputs["radar.cartesian"].shape == (3, 41, 3)
    offset = simulation.relative[:, 0, :3] - [0, -2000, 100]
    assert (np.abs(offset) > 0).all() and np.abs(offset).max() < 5 * 50


def test_a_run_is_the_same_in_any_company(campaign):
    whole = simulate(campaign(), case=1, runs=range(5))
    for runs in ([3], [1, 4], [4, 0, 2]):
        part = simulate(campaign(), case=1, runs=runs)
        for name in ("chief", "deputy", "relative"):
            assert np.array_equal(getattr(part, name), getattr(whole, name)[runs])
        for name, z in part.z.items():
            assert np.array_equal(z, whole.z[name][runs], equal_nan=True)
        for name, z in part.inputs.items():
            assert np.array_equal(z, whole.inputs[name][runs], equal_nan=True)


def test_cases_share_their_random_numbers(campaign):
    """Gaussian and mixture noise differ only where the mixture's wide component is drawn."""
    gaussian, mixture = (simulate(campaign(), case=case, runs=range(4)) for case in (0, 1))
    assert np.array_equal(gaussian.relative, mixture.relative)
    assert np.array_equal(gaussian.z["gnss"], mixture.z["gnss"])
    same = gaussian.z["radar"][..., 0] == mixture.z["radar"][..., 0]
    assert 0.8 < same.mean() < 0.98


def test_the_length_of_a_stretch_does_not_show(campaign, monkeypatch):
    whole = simulate(campaign(), case=1, runs=range(2))
    monkeypatch.setattr(module, "CHUNK_EPOCHS", 7)
    pieces = simulate(campaign(), case=1, runs=range(2))
    for name, z in whole.inputs.items():
        assert np.array_equal(z, pieces.inputs[name], equal_nan=True)
    assert np.array_equal(whole.relative, pieces.relative)


def test_without_dispersions_all_runs_share_one_truth(campaign):
    parsed = campaign("truth.dispersions={}")
    chunk = next(module.chunks(parsed.cases[0].config, RandomSource(parsed.seed, (0, 1, 2))))
    assert chunk.truth.relative.shape[0] == 1
    simulation = simulate(parsed, runs=range(3))
    assert np.array_equal(simulation.relative[0], simulation.relative[2])
