"""Where craft start: every kind, every refusal, and every example of docs/orbits.md."""

import json
import re
from math import radians
from pathlib import Path

import numpy as np
import pytest

from relnav_sim.astro.constants import MU_M3_S2, RADIUS_M
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.orbits import Elements, elements_from_state, state_from_elements
from relnav_sim.astro.relative_elements import RelativeElements, deputy_elements
from relnav_sim.campaign.loader import load_document
from relnav_sim.streams import RandomSource
from relnav_sim.truth import TruthOptions, nominal_chief, start_warnings, truth_trajectory

ROOT = Path(__file__).parents[2]
CRAFT = {"mass_kg": 200, "area_m2": 1}
ORBIT = {"orbit": {"altitude_km": 500, "i_deg": 97.4}}
BEHIND = {"shape": {"kind": "trailing", "along_track_m": -1000}}
LINES = [
    "1 43476U 18047A   18365.89673225 +.00000266 +00000-0 +96631-5 0  9993",
    "2 43476 088.9970 209.2025 0019272 138.9449 221.3254 15.23792965033965",
]
SECOND = [
    "1 43477U 18047B   18365.89702718 +.00000263 +00000-0 +95755-5 0  9997",
    "2 43477 088.9971 209.2044 0019074 138.5411 221.7288 15.23793300033968",
]
OMM = """CCSDS_OMM_VERS = 2.0
CREATION_DATE = 2018-365T00:00:00
ORIGINATOR = SOMEONE
COMMENT the same elements
OBJECT_NAME = GRACE-FO 1
CENTER_NAME = EARTH
REF_FRAME = TEME
TIME_SYSTEM = UTC
MEAN_ELEMENT_THEORY = SGP4
EPOCH = 2018-12-31T21:31:17.6664
MEAN_MOTION = 15.23792965 [rev/day]
ECCENTRICITY = .0019272
INCLINATION = 88.9970 [deg]
RA_OF_ASC_NODE = 209.2025
ARG_OF_PERICENTER = 138.9449
MEAN_ANOMALY = 221.3254
BSTAR = .96631E-5
"""


def truth(chief=ORBIT, deputy=BEHIND, folder=None, **sections):
    data = {"chief": {**CRAFT, **chief}, "deputy": {**CRAFT, **deputy}, **sections}
    context = None if folder is None else {"folder": folder}
    return TruthOptions.model_validate_json(json.dumps(data), strict=True, context=context)


EXAMPLES = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "orbits.md").read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("number", range(len(EXAMPLES)))
def test_every_example_of_the_page_is_a_truth(number):
    document = load_document(EXAMPLES[number])
    assert not document.problems
    complete = {"chief": {**CRAFT, **ORBIT}, "deputy": {**CRAFT, **BEHIND}, **document.data}
    options = TruthOptions.model_validate_json(json.dumps(complete), strict=True, context={"folder": ROOT})
    assert np.isfinite(options.chief_state).all()
    assert TruthOptions.model_validate_json(options.model_dump_json()) == options


def test_an_altitude_is_the_perigees_above_the_radius_of_the_truth():
    orbit = {"altitude_km": 500, "e": 0.5, "i_deg": 63.4}
    chief = nominal_chief(truth({"orbit": orbit}))
    assert chief.semi_major_axis_m == pytest.approx((RADIUS_M + 500e3) / 0.5, rel=1e-15)
    state = truth({"orbit": orbit}).chief_state
    assert np.linalg.norm(state[:3]) == pytest.approx(RADIUS_M + 500e3, rel=1e-14)
    larger = truth({"orbit": {"altitude_km": 500, "i_deg": 63.4}}, constants={"radius_m": 6.4e6})
    assert nominal_chief(larger).semi_major_axis_m == 6.9e6


def test_cartesian_states_in_their_frames():
    elements = Elements(7e6, 0.01, 1.0, 2.0, 3.0, 4.0)
    state = state_from_elements(elements, MU_M3_S2)
    in_km = {"position_km": list(state[:3] / 1e3), "velocity_km_s": list(state[3:] / 1e3)}
    in_m = {"position_m": list(state[:3]), "velocity_m_s": list(state[3:])}
    np.testing.assert_allclose(truth({"cartesian": in_km}).chief_state, state, rtol=1e-15)
    assert np.array_equal(truth({"cartesian": in_m}).chief_state, state)
    chief = nominal_chief(truth({"cartesian": in_m}))
    found = (chief.semi_major_axis_m, chief.eccentricity, chief.inclination_rad, chief.raan_rad, chief.true_anomaly_rad)
    np.testing.assert_allclose(found, (7e6, 0.01, 1.0, 2.0, 4.0), rtol=1e-12)
    # The frame bias turns by 23 mas (IERS Conventions 2010, section 5.5.4), of which one axis may see little.
    biased = truth({"cartesian": {**in_m, "frame": "GCRF"}}).chief_state
    assert 0.05 < np.linalg.norm(biased[:3] - state[:3]) < 23e-3 / 206265 * 7e6 * 1.1
    assert np.linalg.norm(biased[:3]) == pytest.approx(np.linalg.norm(state[:3]), rel=1e-14)


def test_a_state_at_rest_on_the_ground_of_itrf():
    """A point fixed to the Earth moves eastwards by 465 m/s at the equator in inertial space."""
    geostationary = {"position_km": [42164.17, 0, 0], "velocity_km_s": [0, 0, 0], "frame": "ITRF"}
    options = truth({"cartesian": geostationary}, epoch="2026-03-20T00:00:00 UTC")
    elements = options.chief_elements
    assert float(elements.semi_major_axis_m) == pytest.approx(42164.17e3, rel=1e-5)
    assert float(elements.eccentricity) < 1e-5
    # UT1 - UTC turns the Earth by 15 arcsec a second.
    turned = truth(
        {"cartesian": geostationary}, epoch="2026-03-20T00:00:00 UTC", earth_orientation={"ut1_utc_s": 0.5}
    ).chief_state
    angle = np.linalg.norm(turned[:3] - options.chief_state[:3]) / 42164.17e3
    assert angle == pytest.approx(0.5 * 7.292115e-5, rel=1e-4)


def test_two_line_elements_by_lines_file_or_omm_are_one_start(tmp_path):
    pair = "GRACE-FO 1\n" + "\n".join(LINES) + "\nGRACE-FO 2\n" + "\n".join(SECOND) + "\n"
    (tmp_path / "pair.tle").write_text(pair)
    (tmp_path / "one.omm").write_text(OMM)
    given = truth({"tle": {"lines": LINES}})
    named = truth({"tle": {"file": "pair.tle", "name": "GRACE-FO 1"}}, folder=tmp_path)
    numbered = truth({"tle": {"file": "pair.tle", "name": "43476"}}, folder=tmp_path)
    plain = truth({"tle": {"file": "pair.tle", "name": 43476}}, folder=tmp_path)
    message = truth({"omm": {"file": "one.omm"}}, folder=tmp_path)
    assert plain == numbered
    assert given.start_epoch == Epoch.parse("2018-12-31T21:31:17.6664 UTC") == message.start_epoch
    assert given.chief.tle.lines == named.chief.tle.lines == numbered.chief.tle.lines
    np.testing.assert_allclose(message.chief_state, given.chief_state, rtol=1e-9)
    # 491 km up: the mean altitude of GRACE-FO at the end of 2018.
    assert float(given.chief_elements.semi_major_axis_m) == pytest.approx(6378e3 + 494e3, abs=15e3)
    # The file is not needed any more.
    (tmp_path / "pair.tle").unlink()
    assert TruthOptions.model_validate_json(named.model_dump_json()) == named


def test_mean_elements_go_to_the_epoch_of_the_truth():
    """Ten minutes later the craft is 4500 km on along its orbit."""
    at_own = truth({"tle": {"lines": LINES}})
    later = truth({"tle": {"lines": LINES}}, epoch="2018-12-31T21:41:17.6664 UTC")
    path = truth_trajectory(at_own, 600.0, RandomSource(0, (0,))).at([600.0])
    # A kilometre: SGP4's own accuracy over ten minutes is better, tesseral terms and drag cost a few hundred metres.
    assert np.linalg.norm(path.chief[0, 0, :3] - later.chief_state[:3]) < 1000
    assert np.linalg.norm(at_own.chief_state[:3] - later.chief_state[:3]) > 4e6


def test_a_warning_where_mean_elements_are_too_coarse():
    two = truth({"tle": {"lines": LINES}}, {"tle": {"lines": SECOND}})
    assert start_warnings(two) == []  # 194 km apart
    same = truth({"tle": {"lines": LINES}}, {"tle": {"lines": LINES}})
    (sentence,) = start_warnings(same)
    assert sentence.startswith("The craft start 0 m apart by mean elements (TLE or OMM), whose positions are good to")
    assert start_warnings(truth({"tle": {"lines": LINES}})) == []
    late = truth({"tle": {"lines": LINES}}, epoch="2019-01-20T00:00:00 UTC")
    assert start_warnings(late) == [
        "The chief's mean elements are 19 days away from the start; SGP4 loses about 1 km a day."
    ]


@pytest.mark.parametrize(
    ("orbit", "sentence"),
    [
        ({"altitude_km": 400_000}, "altitude_km of 400000 is kilometres, beyond the geostationary ring; for 400000 m"),
        ({"altitude_km": 500_000}, "m write 500."),
        ({"a_km": 700_000}, "The chief's a_km of 700000 is kilometres, beyond the Moon at 384400 km"),
        ({"altitude_km": 35_786}, None),
        ({"a_km": 240_000, "e": 0.5}, None),
    ],
)
def test_orbits_beyond_use_are_told(orbit, sentence):
    told = start_warnings(truth({"orbit": {"i_deg": 10, **orbit}}))
    assert len(told) == (sentence is not None)
    assert sentence is None or sentence in told[0]


def test_relative_elements_and_orbits_of_their_own_agree():
    chief = truth().chief_elements
    roe = {"a_dlambda_m": -3000, "a_dex_m": 50, "a_dey_m": 20, "a_dix_m": 10, "a_diy_m": 80}
    deputy = deputy_elements(chief, RelativeElements(**roe))
    options = truth(deputy={"roe": roe})
    found = elements_from_state(options.deputy_state, MU_M3_S2)
    assert float(found.inclination_rad) == pytest.approx(float(deputy.inclination_rad), abs=1e-13)
    start = truth_trajectory(options, 1.0, RandomSource(0, (0,))).at([0.0])
    np.testing.assert_allclose(start.deputy[0, 0], options.deputy_state, atol=2e-8)


@pytest.mark.parametrize(
    "deputy",
    [
        {"shape": {"kind": "safety_ellipse", "rbar_amplitude_m": 100, "hbar_amplitude_m": 100}},
        {"shape": {"kind": "hold_point", "vbar_m": 300}},
        {"shape": {"kind": "drift_free", "rbar_m": 50, "hbar_m": 20}},
        BEHIND,
    ],
)
def test_shapes_fly_without_drift(deputy):
    """Under a point mass, from the campaign's options to the end of a revolution."""
    options = truth(deputy=deputy, forces={"zonals": 0, "drag": "none"})
    period = 2 * np.pi / nominal_chief(options).mean_motion_rad_s
    ends = truth_trajectory(options, period, RandomSource(0, (0,)), 1e-13).at([0.0, period]).relative[0]
    assert np.linalg.norm(ends[1, :3] - ends[0, :3]) < 1e-6


@pytest.mark.parametrize(
    ("deputy", "bound_m"),
    [
        ({"shape": {"kind": "trailing", "along_track_m": -5000}}, 0.001),
        ({"shape": {"kind": "hold_point", "vbar_m": -200}}, 0.001),
        ({"shape": {"kind": "drift_free", "rbar_m": 100}}, 0.004),
        ({"shape": {"kind": "safety_ellipse", "rbar_amplitude_m": 100, "hbar_amplitude_m": 0}}, 0.004),
    ],
)
def test_shapes_in_the_plane_hardly_drift_under_zonal_harmonics(deputy, bound_m):
    """The table of docs/orbits.md; by linear theory an error of 1 mm in the mean semi-major axis drifts by 9.4 mm."""
    chief = {"orbit": {"altitude_km": 500, "i_deg": 51.6, "raan_deg": 100}}
    options = truth(chief, deputy, forces={"drag": "none"})
    period = 2 * np.pi / nominal_chief(options).mean_motion_rad_s
    path = truth_trajectory(options, 10 * period, RandomSource(0, (0,))).at(np.linspace(0, 10 * period, 2001))
    along = path.relative[0, :-1, 1].reshape(10, 200).mean(axis=1)
    assert abs(np.diff(along).mean()) < bound_m


NO_STATE = {"position_km": [7000, 0, 0], "velocity_km_s": [0, 7.5, 0]}
REFUSED = {
    "no start": ({}, BEHIND, "chief", "give exactly one of orbit, cartesian, tle, omm and ephemeris"),
    "two starts": ({**ORBIT, "cartesian": NO_STATE}, BEHIND, "chief", "give exactly one of orbit, cartesian, tle"),
    "two of the deputy": (ORBIT, {**BEHIND, **ORBIT}, "deputy", "give exactly one of relative, roe, shape, orbit"),
    "no size": ({"orbit": {"i_deg": 50}}, BEHIND, "chief.orbit", "give exactly one of a_km and altitude_km"),
    "two sizes": (
        {"orbit": {"i_deg": 50, "a_km": 7000, "altitude_km": 500}},
        BEHIND,
        "chief.orbit",
        "give exactly one of a_km and altitude_km",
    ),
    "no position": (
        {"cartesian": {"velocity_km_s": [0, 7.5, 0]}},
        BEHIND,
        "chief.cartesian",
        "give exactly one of position_m and position_km",
    ),
    "two velocities": (
        {"cartesian": {**NO_STATE, "velocity_m_s": [0, 7500, 0]}},
        BEHIND,
        "chief.cartesian",
        "give exactly one of velocity_m_s and velocity_km_s",
    ),
    "another frame": ({"cartesian": {**NO_STATE, "frame": "TOD"}}, BEHIND, "chief.cartesian.frame", "'EME2000'"),
    "ITRF without epoch": (
        {"cartesian": {**NO_STATE, "frame": "ITRF"}},
        BEHIND,
        "chief.cartesian",
        "the frame ITRF turns with the Earth; give the start's calendar time as truth.epoch",
    ),
    "an open orbit": (
        {"cartesian": {"position_km": [7000, 0, 0], "velocity_km_s": [0, 12, 0]}},
        BEHIND,
        "chief.cartesian",
        "the orbit escapes; check position and velocity",
    ),
    "a fall": (
        {"cartesian": {"position_km": [7000, 0, 0], "velocity_km_s": [0, 5, 0]}},
        BEHIND,
        "chief.cartesian",
        "below the surface at 6378.14 km",
    ),
    "straight down": (
        {"cartesian": {"position_km": [7000, 0, 0], "velocity_km_s": [-1, 0, 0]}},
        BEHIND,
        "chief.cartesian",
        "they span no orbit plane",
    ),
    "wrong lines": ({"tle": {"lines": LINES[::-1]}}, BEHIND, "chief.tle.lines", "line 1 of a two-line element set"),
    "a set of several": (
        {"tle": {"file": "pair.tle"}},
        BEHIND,
        "chief.tle.lines",
        "pair.tle holds 2 two-line element sets; give name: ONE, TWO",
    ),
    "another set": (
        {"tle": {"file": "pair.tle", "name": "THREE"}},
        BEHIND,
        "chief.tle.lines",
        "pair.tle holds no two-line element set named 'THREE'; there are ONE, TWO",
    ),
    "half a set": (
        {"tle": {"file": "half.tle"}},
        BEHIND,
        "chief.tle.lines",
        "half.tle:1: line 2 of the two-line element set should follow this line",
    ),
    "no set": ({"tle": {"file": "empty.tle"}}, BEHIND, "chief.tle.lines", "empty.tle:1: holds no two-line element set"),
    "no file": ({"tle": {"file": "none.tle"}}, BEHIND, "chief.tle.lines", "none.tle: No such file or directory"),
    "file and lines": (
        {"tle": {"file": "pair.tle", "lines": LINES}},
        BEHIND,
        "chief.tle.lines",
        "give exactly one of file and lines",
    ),
    "neither file nor elements": ({"omm": {}}, BEHIND, "chief.omm.elements", "give exactly one of file and elements"),
    "another theory": (
        {"omm": {"file": "dsst.omm"}},
        BEHIND,
        "chief.omm.elements",
        "dsst.omm:9: MEAN_ELEMENT_THEORY is DSST; relnav reads mean elements with SGP4",
    ),
    "no number": (
        {"omm": {"file": "word.omm"}},
        BEHIND,
        "chief.omm.elements",
        "word.omm:13: INCLINATION is 'steep'; it must be a number",
    ),
    "another unit": (
        {"omm": {"file": "unit.omm"}},
        BEHIND,
        "chief.omm.elements",
        "unit.omm:13: INCLINATION is in 'rad'; it must be in deg",
    ),
    "a key missing": (
        {"omm": {"file": "short.omm"}},
        BEHIND,
        "chief.omm.elements",
        "short.omm: the OMM gives no BSTAR",
    ),
    "no OMM": ({"omm": {"file": "pair.tle"}}, BEHIND, "chief.omm.elements", "pair.tle:1: 'ONE' stands where"),
    "no XML": ({"omm": {"file": "broken.xml"}}, BEHIND, "chief.omm.elements", "broken.xml:1: this is not valid XML"),
    "node of an equatorial orbit": (
        {"orbit": {"altitude_km": 35786, "i_deg": 0}},
        {"roe": {"a_diy_m": 100}},
        "deputy.roe",
        "a_diy_m turns the node, which an equatorial orbit does not have; give a shape instead",
    ),
    "elements of no ellipse": (ORBIT, {"roe": {"a_dex_m": 7e6}}, "deputy.roe", "put the deputy on no ellipse"),
    "through the Earth": (
        ORBIT,
        {"roe": {"a_dex_m": 1e6}},
        "deputy.roe",
        "puts the deputy on an orbit with its perigee",
    ),
    "trailing too far": (
        ORBIT,
        {"shape": {"kind": "trailing", "along_track_m": 9e6}},
        "deputy.shape",
        "more than the perigee's distance from the centre",
    ),
    "no such shape": (ORBIT, {"shape": {"kind": "helix"}}, "deputy.shape", "safety_ellipse"),
}


@pytest.fixture
def folder(tmp_path):
    pair = "\n".join(["ONE", *LINES, "TWO", *SECOND, ""])
    texts = {
        "pair.tle": pair,
        "half.tle": LINES[0],
        "empty.tle": "",
        "dsst.omm": OMM.replace("= SGP4", "= DSST"),
        "unit.omm": OMM.replace("88.9970 [deg]", "1.5532 [rad]"),
        "word.omm": OMM.replace("88.9970 [deg]", "steep"),
        "short.omm": OMM.replace("BSTAR = .96631E-5\n", ""),
        "broken.xml": "<ndm><omm>",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_start_is_refused_at_its_place(case, folder):
    chief, deputy, place, sentence = REFUSED[case]
    with pytest.raises(ValueError) as error:
        truth(chief, deputy, folder)
    found = {".".join(map(str, each["loc"])): each["msg"] for each in error.value.errors()}
    assert sentence in found.get(place, ""), found


def test_an_omm_in_xml(tmp_path):
    rows = [line.partition("[")[0].split(" = ") for line in OMM.splitlines() if " = " in line]
    inner = "".join(f"<{key}>{value.strip()}</{key}>" for key, value in rows[1:])
    (tmp_path / "one.xml").write_text(f'<?xml version="1.0"?>\n<ndm><omm id="CCSDS_OMM_VERS">{inner}</omm></ndm>')
    (tmp_path / "one.omm").write_text(OMM)
    both = [truth({"omm": {"file": name}}, folder=tmp_path).chief.omm.elements for name in ("one.xml", "one.omm")]
    assert both[0] == both[1]
    assert both[0].i_deg == 88.997
    assert radians(both[0].i_deg) == both[0].mean.inclination_rad


OEM = """CCSDS_OEM_VERS = 2.0
CREATION_DATE = 2026-01-01T00:00:00
ORIGINATOR = SOMEONE

META_START
OBJECT_NAME = CHIEF
OBJECT_ID = 2026-001A
CENTER_NAME = EARTH
REF_FRAME = EME2000
TIME_SYSTEM = UTC
START_TIME = {first}
STOP_TIME = {last}
META_STOP

{rows}
"""


@pytest.fixture
def recorded(tmp_path):
    """A two-body orbit every 30 s for an hour."""
    epoch = Epoch.parse("2026-01-01T00:00:00 UTC")
    rows, rate = [], np.sqrt(MU_M3_S2 / 7e6**3)
    for k in range(121):
        state = state_from_elements(Elements(7e6, 0.0, 1.0, 0.5, 0.0, 30.0 * k * rate), MU_M3_S2) / 1e3
        rows.append(" ".join([epoch.later(30.0 * k).text()[:-4], *(f"{value:.12f}" for value in state)]))
    first, last = rows[0].split()[0], rows[-1].split()[0]
    (tmp_path / "chief.oem").write_text(OEM.format(first=first, last=last, rows="\n".join(rows)))
    return tmp_path


@pytest.mark.parametrize(("epoch", "after_s"), [(None, 0.0), ("2026-01-01T00:10:17 UTC", 617.0)])
def test_a_start_on_a_recorded_orbit(recorded, epoch, after_s):
    sections = {} if epoch is None else {"epoch": epoch}
    options = truth({"ephemeris": {"file": "chief.oem"}}, folder=recorded, **sections)
    angle = after_s * np.sqrt(MU_M3_S2 / 7e6**3)
    expected = state_from_elements(Elements(7e6, 0.0, 1.0, 0.5, 0.0, angle), MU_M3_S2)
    np.testing.assert_allclose(options.chief_state[:3], expected[:3], atol=1e-3)
    np.testing.assert_allclose(options.chief_state[3:], expected[3:], atol=1e-6)
    assert options.start_epoch == Epoch.parse("2026-01-01T00:00:00 UTC").later(after_s)
    assert start_warnings(options) == []
    (recorded / "chief.oem").unlink()
    assert TruthOptions.model_validate_json(options.model_dump_json()) == options


def test_a_gap_elsewhere_does_not_matter_to_a_start(recorded):
    whole = truth({"ephemeris": {"file": "chief.oem"}}, folder=recorded, epoch="2026-01-01T00:10:17 UTC")
    lines = (recorded / "chief.oem").read_text().splitlines(keepends=True)
    (recorded / "chief.oem").write_text("".join(lines[:-60] + lines[-20:]))
    torn = truth({"ephemeris": {"file": "chief.oem"}}, folder=recorded, epoch="2026-01-01T00:10:17 UTC")
    # The gap may change by which polynomial the rows are met best.
    np.testing.assert_allclose(torn.chief_state, whole.chief_state, rtol=0, atol=1e-3)


@pytest.mark.parametrize(
    ("ephemeris", "epoch", "sentence"),
    [
        (
            {"file": "chief.oem"},
            "2026-01-01T02:00:00 UTC",
            r"chief\.oem:5: the orbit is useable from .* to .*; it is needed at 2026-01-01T02:00:00 UTC",
        ),
        ({"file": "none.oem"}, None, "none.oem: No such file or directory"),
    ],
)
def test_a_recorded_orbit_that_gives_no_start(recorded, ephemeris, epoch, sentence):
    with pytest.raises(ValueError, match=sentence):
        truth({"ephemeris": ephemeris}, folder=recorded, epoch=epoch)
