"""The forces of a campaign: what they mean, and what is refused."""

import hashlib
import json

import numpy as np
import pytest

from relnav_sim import ForceModel, GravityField, propagate
from relnav_sim.astro.atmosphere import LayeredAtmosphere
from relnav_sim.astro.frames import rtn_from_eci
from relnav_sim.streams import RandomSource
from relnav_sim.truth import TruthOptions, begun_earlier, nominal_chief, truth_trajectory
from relnav_sim.truth.trajectory import force_model

EPOCH = "2010-07-27T00:00:00 UTC"
ORBIT = {"a_km": 6878, "e": 0.001, "i_deg": 97.4}
FIELD = {"gravity": {"model": "ggm05s", "degree": 4}, "drag": "none"}
SMALL = """earth_gravity_constant 3.986004415e14
radius 6378136.3
max_degree 2
norm fully_normalized
tide_system tide_free
end_of_head ====
gfc 2 0 -4.841694e-04 0.0
gfc 2 1 0.0 0.0
gfc 2 2 2.43938e-06 -1.40028e-06
"""


def truth(folder=None, **sections):
    data = {
        "epoch": EPOCH,
        "chief": {"orbit": ORBIT, "mass_kg": 200, "area_m2": 2},
        "deputy": {"shape": {"kind": "trailing", "along_track_m": -1000}, "mass_kg": 100, "area_m2": 2},
        **sections,
    }
    context = None if folder is None else {"folder": folder}
    return TruthOptions.model_validate_json(
        json.dumps({k: v for k, v in data.items() if v is not None}), context=context
    )


def test_constants_are_the_fields_own():
    options = truth(forces=FIELD)
    field = GravityField.load("ggm05s", 4)
    chief = nominal_chief(options)
    assert (chief.mu_m3_s2, chief.equatorial_radius_m) == (field.mu_m3_s2, field.radius_m)
    # Unnormalised: J_n = -C_n0 sqrt(2 n + 1); GGM05S differs from EGM96 in the eighth digit of J2.
    assert chief.j2 == pytest.approx(1.08262668e-3, rel=2e-5)
    assert (chief.j3, chief.j4) == pytest.approx((-2.5326e-6, -1.6196e-6), rel=1e-3)
    force = force_model(options)
    assert (force.mu_m3_s2, force.zonals, force.gravity.degree) == (field.mu_m3_s2, (), 4)
    again = TruthOptions.model_validate_json(options.model_dump_json())
    assert again == options


def test_the_truth_flies_under_all_of_it():
    """The same as `propagate` under the same force; the relative velocity is the rate of the relative position."""
    forces = {**FIELD, "third_bodies": ["moon", "sun"], "radiation_pressure": True, "drag": "layers"}
    options = truth(forces=forces)
    trajectory = truth_trajectory(options, 700.0, RandomSource(1, (0,)))
    truths = trajectory.at(np.array([0.0, 599.0, 600.0, 601.0]))
    force = ForceModel(
        3.986004415e14,
        6378136.3,
        (),
        LayeredAtmosphere(),
        gravity=GravityField.load("ggm05s", 4),
        epoch=EPOCH,
        third_bodies=("sun", "moon"),
        radiation=True,
    )
    states = propagate(
        np.stack([truths.chief[0, 0], truths.deputy[0, 0]]),
        [0.0, 600.0],
        force,
        np.array([2.2 * 2 / 200, 2.2 * 2 / 100]),
        radiation_m2_kg=np.array([1.3 * 2 / 200, 1.3 * 2 / 100]),
    )
    np.testing.assert_allclose(truths.chief[0, 2], states[0, 1], rtol=1e-10)
    np.testing.assert_allclose(truths.deputy[0, 2], states[1, 1], rtol=1e-10)
    slope = (truths.relative[0, 3, :3] - truths.relative[0, 1, :3]) / 2
    assert np.abs(slope - truths.relative[0, 2, 3:]).max() < 1e-8


def test_sunlight_is_felt_and_dispersed():
    forces = {"zonals": 0, "radiation_pressure": True, "drag": "none"}
    dispersed = {"chief_radiation": {"kind": "uniform", "half_width": 0.5}}
    options = truth(forces=forces, dispersions=dispersed)
    assert options.is_dispersed
    trajectory = truth_trajectory(options, 3000.0, RandomSource(1, tuple(range(20))))
    factors = trajectory.radiation_m2_kg[0] / (1.3 * 2 / 200)
    assert 0.5 < factors.min() < 0.8 < 1.2 < factors.max() < 1.5
    np.testing.assert_allclose(trajectory.radiation_m2_kg[1], 1.3 * 2 / 100)
    at = trajectory.at(np.arange(0, 3000, 100.0))
    felt = np.linalg.norm(trajectory.felt(at, 100.0)[:, :, 0, 0], axis=-1)
    # 1361 W/m^2 at one astronomical unit (Kopp and Lean 2011); the Earth is at 1.0157 of them in late July.
    lit = felt.max(axis=1) / trajectory.radiation_m2_kg[0]
    np.testing.assert_allclose(lit, 1361 / 299_792_458 / 1.0157**2, rtol=2e-3)


@pytest.mark.parametrize("sunlight", [False, True])
def test_earlier_flights_meet_the_start_under_forces_of_the_calendar(sunlight):
    """As exactly as in `tests/truth/test_earlier.py`; sunlight moves the craft by 0.5 m meanwhile."""
    forces = {**FIELD, "third_bodies": ["sun"], "radiation_pressure": sunlight, "drag": "layers"}
    options = truth(forces=forces)
    earlier = begun_earlier(options, 4000.0)
    assert earlier.start_epoch.seconds_since(options.start_epoch) == -4000.0
    source = RandomSource(1, (0,))
    arrived = truth_trajectory(earlier, 4000.0, source).at([4000.0])
    start = truth_trajectory(options, 1.0, source).at([0.0])
    assert np.abs(arrived.chief - start.chief)[..., :3].max() < 1e-4
    assert np.abs(arrived.relative - start.relative)[..., :3].max() < 1e-5


def test_a_field_of_a_file(tmp_path):
    (tmp_path / "small.gfc").write_text(SMALL)
    options = truth(tmp_path, forces={"gravity": {"model": "small.gfc", "degree": 2}})
    gravity = options.forces.gravity
    assert gravity.sha256 == hashlib.sha256(SMALL.encode()).hexdigest()
    assert (gravity.model, gravity.order) == (str(tmp_path / "small.gfc"), 2)
    assert TruthOptions.model_validate_json(options.model_dump_json()) == options
    (tmp_path / "small.gfc").write_text(SMALL + "\n")
    with pytest.raises(ValueError, match=r"small\.gfc is another file than this digest is of"):
        TruthOptions.model_validate_json(options.model_dump_json())


REFUSED = {
    "gravity without epoch": ({"epoch": None, "forces": FIELD}, "forces.gravity", "give the start's as truth.epoch"),
    "gravity before 1972": (
        {"epoch": "1971-12-31T00:00:00 TAI", "forces": FIELD},
        "forces.gravity",
        "an epoch before 1972",
    ),
    "third bodies without epoch": (
        {"epoch": None, "forces": {"third_bodies": ["sun"]}},
        "forces.third_bodies",
        "depends on the calendar; give the start's as truth.epoch, for example 2010-07-27T00:00:00 UTC",
    ),
    "radiation without epoch": (
        {"epoch": None, "forces": {"radiation_pressure": True}},
        "forces.radiation_pressure",
        "depends on the calendar",
    ),
    "no time scale": ({"epoch": "2010-07-27T00:00:00"}, "epoch", "names no time scale"),
    "zonals beside gravity": (
        {"forces": {**FIELD, "zonals": 4}},
        "forces.zonals",
        "the gravity field has zonal harmonics of its own; leave zonals or gravity out",
    ),
    "mu beside gravity": (
        {"forces": FIELD, "constants": {"mu_m3_s2": 3.986004418e14}},
        "constants",
        "the gravity field has mu_m3_s2 of its own, 398600441500000.0; leave mu_m3_s2 out",
    ),
    "radius beside gravity": (
        {"forces": FIELD, "constants": {"radius_m": 6378137.0}},
        "constants",
        "leave radius_m out",
    ),
    "j2 beside gravity": ({"forces": FIELD, "constants": {"j2": 1.08262668e-3}}, "constants", "leave j2 out"),
    "no such field": (
        {"forces": {"gravity": {"model": "egm", "degree": 4}}},
        "forces.gravity",
        "there is no gravity field 'egm': give ggm05s, or the path of a .gfc file",
    ),
    "no such file": (
        {"forces": {"gravity": {"model": "no/such.gfc", "degree": 4}}},
        "forces.gravity.model",
        "there is no file",
    ),
    "too high a degree": (
        {"forces": {"gravity": {"model": "ggm05s", "degree": 70}}},
        "forces.gravity",
        "the field has degrees up to 60, not to the 70 asked for",
    ),
    "order above degree": (
        {"forces": {"gravity": {"model": "ggm05s", "degree": 4, "order": 5}}},
        "forces.gravity.order",
        "is 5; it must be at most the degree, 4",
    ),
    "a digest of no file": (
        {"forces": {"gravity": {"model": "ggm05s", "degree": 4, "sha256": "0" * 64}}},
        "forces.gravity.sha256",
        "ggm05s is no file; leave the digest out",
    ),
    "a body twice": ({"forces": {"third_bodies": ["sun", "sun"]}}, "forces.third_bodies", "names a body twice"),
    "radiation dispersed without it": (
        {"dispersions": {"deputy_radiation": {"kind": "normal", "sigma": 0.1}}},
        "dispersions.deputy_radiation",
        "has no effect without radiation pressure; leave it out or set forces.radiation_pressure",
    ),
    "pole in other units": (
        {"earth_orientation": {"polar_motion_arcsec": [200, 0]}},
        "earth_orientation.polar_motion_arcsec.0",
        "less than or equal to 2",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_fit_is_refused_at_its_place(case):
    sections, place, sentence = REFUSED[case]
    with pytest.raises(ValueError) as error:
        truth(**sections)
    found = {".".join(map(str, each["loc"])): each["msg"] for each in error.value.errors()}
    assert sentence in found.get(place, ""), found


def test_the_relative_rates_are_those_of_the_full_force():
    """At the start too: the deputy's relative velocity comes back from its ECI state with the field's own a_N."""
    options = truth(forces=FIELD)
    start = truth_trajectory(options, 1.0, RandomSource(1, (0,))).at([0.0])
    force = force_model(options)
    normal = force.normal_acceleration(start.chief[0, 0], 0.0, 0.0)
    assert abs(normal) > 1e-4
    np.testing.assert_allclose(start.deputy[0, 0], options.deputy_state, atol=1e-8)
    np.testing.assert_allclose(
        start.relative[0, 0], rtn_from_eci(options.chief_state, options.deputy_state, normal), atol=1e-8
    )


def test_layers_without_a_calendar_leave_gravity_as_it_is():
    """Without an epoch the Earth turns about ECI z; a craft that no air brakes feels J2 to J4 alone."""
    thin = {"drag_coefficient": 0.0, "mass_kg": 200, "area_m2": 2}
    chief, deputy = {**thin, "orbit": ORBIT}, {**thin, "shape": {"kind": "hold_point", "vbar_m": 100}}
    times = np.array([0.0, 3000.0])
    layered, none = (
        truth_trajectory(
            truth(epoch=None, chief=chief, deputy=deputy, forces={"drag": drag}), 3000.0, RandomSource(1, (0,))
        ).at(times)
        for drag in ("layers", "none")
    )
    np.testing.assert_allclose(layered.chief, none.chief, rtol=1e-10)
