"""Everything that filters are given is recorded: the front end makes of a recording alone what it made of the truth."""

import numpy as np
import pytest

from relnav_sim.campaign.load import parse_campaign
from relnav_sim.campaign.manoeuvres import default_thrust
from relnav_sim.recorded.readings import ReadingsError
from relnav_sim.recorded.readings_csv import write_csv
from relnav_sim.recorded.readings_files import load_readings
from relnav_sim.recorded.tdm_writing import fits_tdm
from relnav_sim.sensors import filter_inputs, known_orbits, readings_layout, relative_sensors
from relnav_sim.simulation.chunks import Chunk, chunks
from relnav_sim.simulation.host_orbits import HostOrbits, believed_gravity, fixes_of
from relnav_sim.simulation.recording import record
from relnav_sim.simulation.start import starting_belief
from relnav_sim.simulation.thrust_inputs import ThrustInputs
from relnav_sim.streams import RandomSource
from relnav_sim.truth import Truth

TEXT = """
name: recorded
seed: 5
runs: 3
clock: {duration_s: 60, step_s: 0.3, store_every_s: 3}
truth:
  chief:
    orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 10, argp_deg: 20, ta_deg: 30}
    mass_kg: 200
    area_m2: 1
    drag_coefficient: 2.2
  deputy:
    relative: {position_m: [20, -2000, 300], velocity_m_s: [0.05, 0, 0.1]}
    mass_kg: 200
    area_m2: 1
    drag_coefficient: 2.2
  forces: {zonals: 4, drag: exponential}
  manoeuvres:
    burn: {craft: deputy, time_s: 20, duration_s: 15, delta_v_m_s: [0.1, 0.2, 0]}
  dispersions: {relative_position: {kind: normal, sigma_m: [50, 50, 50]}}
sensors: SENSORS
start: START
filters:
  ekf: {kind: ekf, dynamics: {kind: cw}, process_noise: {acceleration_psd_m2_s3: 1.0e-6}}
statistics: {settle_s: 20}
"""
OUTAGE = "{kind: outage, windows_s: [[30, 33]]}"
RADAR = f"radar: {{range_sigma_m: 2, angle_sigma_deg: 0.05, latency_s: 0.4, noise: [{{kind: gaussian}}, {OUTAGE}]}}"
GNSS = "gnss: {position_sigma_m: 30, velocity_sigma_m_s: 0.15}"
SPARSE_GNSS = "gnss: {position_sigma_m: 30, velocity_sigma_m_s: 0.15, period_s: 1.2, offset_s: 0.6}"
TRACKER = "star_tracker: {cross_boresight_sigma_arcsec: 10, about_boresight_sigma_arcsec: 60}"
ACCELEROMETER = "accelerometer: {velocity_random_walk_m_s_sqrt_s: 1.0e-4, bias_sigma_m_s2: 1.0e-5}"
RELATIVE_GNSS = "relative_gnss: {velocity_sigma_m_s: 0.01, period_s: 0.6}"
CAMERA = "camera: {angle_sigma_deg: 0.01, host: deputy}"
DISPERSED = "{kind: dispersed, position_sigma_m: [5, 5, 5], velocity_sigma_m_s: [0.1, 0.1, 0.1]}"
FIRST_FIX = "{kind: first_fix, velocity_m_s: [0, 0, 0], velocity_sigma_m_s: 0.3}"

CHAINS = {
    "everything": ([RADAR, GNSS, TRACKER, ACCELEROMETER, RELATIVE_GNSS], {}),
    "fixes between which the orbit is carried": ([RADAR, SPARSE_GNSS, TRACKER, ACCELEROMETER], {}),
    "perfect attitude": ([RADAR, GNSS], {"chief": "chief_orbit"}),
    "perfect orbit": ([RADAR, TRACKER], {"chief": "chief_orbit"}),
    "perfect both": ([RADAR], {}),
    "inertial axes without a receiver": ([RELATIVE_GNSS], {"chief": "chief_orbit"}),
    "inertial axes with a receiver": ([RELATIVE_GNSS, GNSS], {}),
    "on the deputy too": ([CAMERA, RADAR, GNSS.replace("}", ", host: deputy}")], {"deputy": "deputy_orbit"}),
}


def case(sensors, start=DISPERSED):
    text = TEXT.replace("SENSORS", "{" + ", ".join(sensors) + "}").replace("START", start)
    return parse_campaign(text).cases[0].config


def heard(config, readings):
    """What the front end makes of a recording of one run, which is all that it is given."""
    clock, layout = config.clock, readings_layout(config.sensors)
    epochs = np.arange(clock.epochs)
    grid = {name: np.full((1, clock.epochs, len(quantities)), np.nan) for name, quantities in layout.items()}
    for name, one in readings.sensors.items():
        grid[name][0, np.rint(one.times_s / clock.step_s).astype(int)] = one.values
    nothing = np.full((1, clock.epochs, 6), np.nan)
    known = {craft: grid.pop(name) for craft, name in known_orbits(config.sensors).items()}
    states = known.get("chief", nothing), known.get("deputy", nothing)
    truth = Truth(epochs * clock.step_s, *states, nothing)
    hosts = HostOrbits(config, 1)
    chunk = Chunk(0, truth, grid, {}, {})
    forces, _ = ThrustInputs(config).of(chunk, default_thrust(config.sensors))
    orbits = hosts.advance(fixes_of(hosts.hosts, config.sensors, grid), forces) if hosts.hosts else {}
    inputs = filter_inputs(config.sensors, grid, truth, believed_gravity(config), orbits)
    return inputs, {craft: (one.states, one.frame) for craft, one in orbits.items()}, forces


def bits(array):
    return np.ascontiguousarray(array).tobytes()


@pytest.mark.parametrize("chain", CHAINS)
def test_a_recording_gives_filters_the_same_bits(chain, tmp_path):
    sensors, known = CHAINS[chain]
    config = case(sensors)
    assert known_orbits(config.sensors) == known
    runs = (0, 2)
    source = RandomSource(5, runs)
    (chunk,) = chunks(config, source)
    prior = starting_belief(config, chunk, source)
    forces, _ = ThrustInputs(config).of(chunk, default_thrust(config.sensors))
    layout = readings_layout(config.sensors)
    for place, (run, recorded) in enumerate(zip(runs, record(config, 5, runs), strict=True)):
        write_csv(tmp_path / "run.csv", recorded, layout)
        (readings,) = load_readings([tmp_path / "run.csv"], layout)
        assert readings.run == run
        assert bits(readings.start.mean) == bits(prior.mean[place])
        assert bits(readings.start.covariance) == bits(prior.covariance[place])
        inputs, orbits, own_forces = heard(config, readings)
        assert inputs.keys() == relative_sensors(config.sensors).keys()
        for name, forms in chunk.inputs.items():
            for form, z in forms.items():
                assert bits(inputs[name][form][0]) == bits(z[place])
                assert np.isfinite(z).any()
        for craft, own in chunk.orbits.items():
            assert bits(orbits[craft][0][0]) == bits(own.states[place])
            assert bits(orbits[craft][1][0]) == bits(own.frame[place])
        assert bits(own_forces[0]) == bits(np.broadcast_to(forces, (2, *forces.shape[1:]))[place])


def test_only_what_the_front_end_goes_by_is_recorded():
    """No truth but the orbits of hosts that know theirs perfectly."""
    config = case(CHAINS["everything"][0])
    (readings,) = record(config, 5, [1])
    assert list(readings.sensors) == [
        "radar",
        "gnss",
        "star_tracker",
        "chief_accelerometer",
        "deputy_accelerometer",
        "relative_gnss",
    ]


def test_readings_that_are_not_there_have_no_row():
    (readings,) = record(case(CHAINS["everything"][0]), 5, [1])
    times = readings.sensors["radar"].times_s
    assert not ((times >= 30) & (times < 33)).any()
    np.testing.assert_allclose(np.diff(readings.sensors["relative_gnss"].times_s), 0.6, rtol=1e-12)


def test_a_first_fix_is_the_start_and_a_run_without_one_has_none():
    config = case([RADAR.replace("latency_s: 0.4, ", "")], FIRST_FIX)
    (readings,) = record(config, 5, [1])
    # Velocity as the campaign says, position as the radar read it.
    assert readings.start.mean[3:].tolist() == [0, 0, 0]
    assert np.linalg.norm(readings.start.mean[:3]) == pytest.approx(readings.sensors["radar"].values[0, 0])
    blind = RADAR.replace("latency_s: 0.4, ", "").replace("[[30, 33]]", "[[0, 3]]")
    (readings,) = record(case([blind], FIRST_FIX), 5, [1])
    assert readings.start is None


def test_runs_do_not_depend_on_their_company(monkeypatch):
    config = case(CHAINS["everything"][0])
    together = {one.run: one for one in record(config, 5, [0, 1, 2])}
    monkeypatch.setattr("relnav_sim.simulation.recording._MOST_NUMBERS", 1)
    for one in record(config, 5, [2, 0]):
        for name, sensor in one.sensors.items():
            assert bits(sensor.values) == bits(together[one.run].sensors[name].values)


def test_what_a_tdm_can_hold():
    layout = readings_layout(case(CHAINS["everything"][0]).sensors)
    assert [name for name, quantities in layout.items() if fits_tdm(quantities)] == ["radar"]


def test_a_sensor_can_not_have_the_name_of_a_known_orbit():
    sensors = case([RADAR.replace("radar: {", "chief_orbit: {kind: radar, "), TRACKER]).sensors
    with pytest.raises(ReadingsError, match="sensor chief_orbit has the name that files give an orbit; rename"):
        readings_layout(sensors)
