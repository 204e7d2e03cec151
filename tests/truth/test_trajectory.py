"""The truth of a campaign: options, dispersions, shared and per-run trajectories."""

import copy
import json

import numpy as np
import pytest

from relnav_sim.streams import RandomSource
from relnav_sim.truth import TruthOptions, nominal_chief, truth_trajectory
from relnav_sim.truth.trajectory import force_model, nominal_relative

BASE = {
    "chief": {"orbit": {"a_km": 7137, "e": 0.001, "i_deg": 42, "raan_deg": 10}, "mass_kg": 200, "area_m2": 1},
    "deputy": {
        "relative": {"position_m": [100, 12000, -50], "velocity_m_s": [0.1, 0.2, -0.3]},
        "mass_kg": 100,
        "area_m2": 1,
    },
}
EVERYTHING = {
    "relative_position": {"kind": "normal", "sigma_m": 100},
    "relative_velocity": {"kind": "uniform", "half_width_m_s": [0.1, 0, 0.2]},
    "chief_ballistic": {"kind": "normal", "sigma": 0.1},
    "deputy_ballistic": {"kind": "uniform", "half_width": 0.2},
    "density": {"kind": "lognormal", "sigma": 0.3},
}
NOMINAL = [100, 12000, -50, 0.1, 0.2, -0.3]


def truth_options(**changes):
    """Return the options with some values replaced; `a__b` is the key b of the section a."""
    data = copy.deepcopy(BASE)
    for path, value in changes.items():
        *parents, last = path.split("__")
        section = data
        for key in parents:
            section = section.setdefault(key, {})
        if value is None:
            del section[last]
        else:
            section[last] = value
    return TruthOptions.model_validate_json(json.dumps(data), strict=True)


def trajectory(runs=(0,), duration_s=3000.0, **changes):
    return truth_trajectory(truth_options(**changes), duration_s, RandomSource(11, tuple(runs)))


def test_without_dispersions_all_runs_share_one_truth():
    truth = trajectory(range(5)).at(np.arange(0, 3000, 100.0))
    assert truth.chief.shape == truth.deputy.shape == truth.relative.shape == (1, 30, 6)
    np.testing.assert_allclose(truth.relative[0, 0], NOMINAL, atol=1e-8)
    assert not truth_options().is_dispersed


def test_a_runs_truth_does_not_depend_on_the_block_or_the_chunk():
    times = np.arange(0, 3000, 20.0)
    whole = trajectory(range(6), dispersions=EVERYTHING).at(times)
    assert truth_options(dispersions=EVERYTHING).is_dispersed
    part = trajectory([4, 2], dispersions=EVERYTHING)
    chunks = [part.at(times[k : k + 40]) for k in range(0, len(times), 40)]
    for name in ("chief", "deputy", "relative"):
        joined = np.concatenate([getattr(chunk, name) for chunk in chunks], axis=1)
        assert np.array_equal(joined, getattr(whole, name)[[4, 2]])


def test_dispersions_move_what_they_name_and_nothing_else():
    at_start = trajectory(range(300), dispersions={"relative_position": EVERYTHING["relative_position"]}).at([0.0])
    offset = at_start.relative[:, 0] - NOMINAL
    assert np.abs(offset[:, :3].std(0) / 100 - 1).max() < 4.5 / np.sqrt(600)
    assert np.abs(offset[:, 3:]).max() < 1e-9
    assert (at_start.chief == at_start.chief[0]).all()

    both = trajectory(range(3), dispersions={k: EVERYTHING[k] for k in ("relative_position", "density")}).at([0.0])
    assert np.abs(both.relative[:, 0, :3] - at_start.relative[:3, 0, :3]).max() < 1e-8

    drag = trajectory(range(300), dispersions=EVERYTHING).ballistic_m2_kg
    factor = drag / [[0.011], [0.022]]
    # Both share the density's factor; its logarithm has sigma 0.3, the craft's own about 0.1 and 0.2 / sqrt(3).
    assert np.corrcoef(np.log(factor))[0, 1] > 0.8
    assert np.log(factor[0] / factor[1]).std() == pytest.approx(np.hypot(0.1, 0.2 / np.sqrt(3)), rel=0.2)


def test_density_and_ballistic_coefficient_act_alike():
    thick = trajectory(forces__atmosphere={"density_kg_m3": 2 * 3.725e-12, "base_altitude_m": 750e3})
    heavy = trajectory(
        forces__atmosphere={"density_kg_m3": 3.725e-12, "base_altitude_m": 750e3},
        chief__mass_kg=100,
        deputy__mass_kg=50,
    )
    times = np.array([0.0, 3000.0])
    np.testing.assert_allclose(thick.at(times).chief, heavy.at(times).chief, rtol=1e-12)


def test_relative_velocity_counts_the_frames_turn():
    """Difference quotient of the relative position, with J2 tilting the orbit plane."""
    path = trajectory(dispersions=EVERYTHING, runs=[3])
    truth = path.at(np.arange(1000, 1009, 1.0))
    slope = (truth.relative[0, 5, :3] - truth.relative[0, 3, :3]) / 2
    assert np.abs(slope - truth.relative[0, 4, 3:]).max() < 3e-6  # h^2 / 6 of the third derivative


def test_a_deputy_on_its_own_orbit(orbits):
    orbit = {"a_km": 7137.1, "e": 0.0012, "i_deg": 42.01, "raan_deg": 10.02}
    options = truth_options(deputy__relative=None, deputy__orbit=orbit)
    start = truth_trajectory(options, 10.0, RandomSource(0, (0,))).at([0.0])
    expected = orbits.orbit(7137.1e3, 0.0012, np.radians(42.01), np.radians(10.02), 0.0, 0.0)
    np.testing.assert_allclose(start.deputy[0, 0], expected, atol=1e-8)
    np.testing.assert_allclose(start.relative[0, 0], nominal_relative(options), atol=1e-8)


def test_axes_of_shi_et_al_as_input():
    """12 km ahead is x there, and 1 km below is z."""
    relative = {"position_m": [12000, 0, 1000], "velocity_m_s": [0, 0.5, 0], "axes": "shi2025"}
    start = trajectory(deputy__relative=relative).at([0.0]).relative[0, 0]
    np.testing.assert_allclose(start, [-1000, 12000, 0, 0, 0, -0.5], atol=1e-8)


def test_forces_and_constants_follow_the_options():
    assert force_model(truth_options(forces={"zonals": 0, "drag": "none"})).zonals == ()
    assert force_model(truth_options(forces={"drag": "none"})).atmosphere is None
    changed = force_model(
        truth_options(constants={"j3": 1e-5, "mu_m3_s2": 4e14, "radius_m": 6.4e6, "rotation_rad_s": 0})
    )
    assert (changed.mu_m3_s2, changed.radius_m, changed.rotation_rad_s, changed.zonals[1]) == (4e14, 6.4e6, 0.0, 1e-5)
    assert [len(force_model(truth_options(forces={"zonals": n})).zonals) for n in (2, 3, 4)] == [1, 2, 3]


def test_the_filters_chief_is_the_nominal_one():
    chief = nominal_chief(truth_options(dispersions=EVERYTHING, constants={"j2": 1e-3}))
    assert (chief.semi_major_axis_m, chief.eccentricity, chief.j2) == (7137e3, 0.001, 1e-3)
    assert chief.raan_rad == np.radians(10)
    assert chief.mean_motion_rad_s == pytest.approx(np.sqrt(3.986004418e14 / 7137e3**3))


def test_a_craft_that_falls_to_the_earth_ends_its_run():
    """Air three thousand times too dense: the truth ends, says so, and stays ended in later chunks."""
    path = trajectory(duration_s=6000.0, chief__orbit__a_km=6600, forces__atmosphere={"density_kg_m3": 1e-8})
    first, second = path.at(np.arange(0, 3000, 10.0)), path.at(np.arange(3000, 6000, 10.0))
    ended = np.isnan(np.concatenate([first.relative, second.relative], axis=1)).any(axis=2)[0]
    assert np.array_equal(ended, np.arange(0, 6000, 10) >= 1530)
    radius = np.linalg.norm(first.deputy[0, :153, :3], axis=1)
    assert radius[-1] - 6378137 < 10 * 8000 and radius.min() > 6378137
    assert np.array_equal(ended[:300], np.isnan(first.chief).any(axis=2)[0] | np.isnan(first.deputy).any(axis=2)[0])
    assert list(path.failures) == [0]
    # Between the epochs: the same air and orbit in scipy's hands reach the surface there.
    assert path.failures[0] == "the deputy falls to the Earth at 1524.66 s: it goes below the surface"


def test_times_beyond_the_run_are_refused():
    with pytest.raises(ValueError, match="the truth ends at 3000 s"):
        trajectory().at([3001.0])


@pytest.mark.parametrize(
    ("changes", "place", "sentence"),
    [
        ({"chief__orbit__e": 1}, "chief.orbit.e", "less than 1"),
        ({"chief__orbit__e": -0.1}, "chief.orbit.e", "greater than or equal to 0"),
        ({"chief__orbit__a_km": 7137000}, "chief.orbit.a_km", "less than or equal to 1000000"),
        (
            {"chief__orbit__a_km": 6378},
            "chief.orbit",
            "the perigee is 6371.62 km from the Earth's centre, below the surface",
        ),
        ({"chief__orbit__e": 0.5}, "chief.orbit", "the perigee is 3568.5 km"),
        ({"constants__radius_m": 7.2e6}, "chief.orbit", "below the surface at 7200 km"),
        ({"chief__mass_kg": 0}, "chief.mass_kg", "greater than 0"),
        ({"deputy__area_m2": -1}, "deputy.area_m2", "greater than 0"),
        ({"deputy__relative": None}, "deputy", "give exactly one of relative, "),
        ({"deputy__orbit": BASE["chief"]["orbit"]}, "deputy", "give exactly one of relative, "),
        (
            {"deputy__relative__velocity_m_s": [0, -900, 0]},
            "deputy.relative",
            "puts the deputy on an orbit with its perigee",
        ),
        (
            {"deputy__relative__velocity_m_s": [0, 4000, 0]},
            "deputy.relative",
            "puts the deputy on an orbit that escapes",
        ),
        ({"forces__zonals": 1}, "forces.zonals", "0, 2, 3 or 4"),
        ({"forces__atmosphere": {"density_kg_m3": -1}}, "forces.atmosphere.density_kg_m3", "greater than 0"),
        ({"forces__drag": "none", "dispersions": EVERYTHING}, "dispersions.density", "has no effect without drag"),
        (
            {"dispersions__density": {"kind": "normal", "sigma": 0}},
            "dispersions.density.normal.sigma",
            "greater than 0",
        ),
    ],
)
def test_bad_options_are_named_with_their_place(changes, place, sentence):
    with pytest.raises(ValueError) as error:
        truth_options(**changes)
    found = {".".join(map(str, e["loc"])): e["msg"] for e in error.value.errors()}
    assert place in found
    assert sentence in found[place]
