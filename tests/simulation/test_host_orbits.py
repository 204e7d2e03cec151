"""A host's orbit between its GNSS fixes: angles and range stay, with the frame's growing error in R."""

import numpy as np
import pytest
from scipy.stats import chi2

from relnav_sim.campaign.load import parse_campaign
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.filters.run import advance
from relnav_sim.sensors import reading_probability, sensor_measurement
from relnav_sim.simulation import chunks as chunks_module
from relnav_sim.simulation import host_orbits
from relnav_sim.simulation.block import simulate_block
from relnav_sim.simulation.campaign_filter import create_campaign_filter
from relnav_sim.simulation.chunks import chunks, told
from relnav_sim.simulation.dynamics_inputs import dynamics_context
from relnav_sim.simulation.learned import Learned
from relnav_sim.simulation.start import starting_belief
from relnav_sim.streams import RandomSource
from relnav_sim.truth import nominal_chief

TEXT = """
name: carried
seed: 3
runs: 4
clock: {duration_s: 700, step_s: 2, store_every_s: 10}
truth:
  chief:
    orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0}
    mass_kg: 200
    area_m2: 1
    drag_coefficient: 2.2
  deputy:
    relative: {position_m: [200, -20000, 3000], velocity_m_s: [0.05, 0, 0.1]}
    mass_kg: 200
    area_m2: 1
    drag_coefficient: 2.2
  forces: {zonals: 4, drag: exponential}
sensors:
  radar: {range_sigma_m: 2, angle_sigma_deg: 0.0000001}
  relative_gnss: {position_sigma_m: 0.001}
  gnss: {position_sigma_m: 30, velocity_sigma_m_s: 0.15, noise: [{kind: gaussian}, OUTAGE]}
start: {kind: dispersed, position_sigma_m: [5, 5, 5], velocity_sigma_m_s: [0.1, 0.1, 0.1]}
filters:
  sight: {kind: ekf, sensors: [radar], dynamics: {kind: nonlinear_j2}, process_noise: PSD}
  fixes: {kind: ekf, sensors: [relative_gnss], dynamics: {kind: nonlinear_j2}, process_noise: PSD}
statistics: {settle_s: 20}
"""
OUTAGE = "{kind: outage, windows_s: [[60, 660]]}"
FORMS = {"radar": "spherical", "relative_gnss": "cartesian"}
COARSE = "sensors.radar.angle_sigma_deg=0.05"
TAIL = 1e-4


def campaign(outage=OUTAGE, *settings):
    return parse_campaign(
        TEXT.replace("OUTAGE", outage).replace("PSD", "{acceleration_psd_m2_s3: 1.0e-11}"), list(settings)
    )


def flight(config, runs, seed=3):
    return list(chunks(config, RandomSource(seed, tuple(runs))))


def joined(parts, config, name):
    return np.concatenate([told(part, FORMS, config)[name] for part in parts], axis=1)


def filtered(config, name, parts, source):
    """What a filter of the campaign makes of a flight, epoch 0 left out."""
    entry = config.filters[name]
    made = create_campaign_filter(entry, config, dynamics_context(entry, config, source.seed, Learned()))
    prior = starting_belief(config, parts[0], source)
    z = {each: joined(parts, config, each)[:, 1:] for each in entry.sensors}
    _, history = advance(made.filter, made.filter.start(prior, source), z, 1, 2.0)
    assert not history.failures
    return history


@pytest.fixture(scope="module")
def long_outage():
    config = campaign().cases[0].config
    return config, flight(config, range(200))


@pytest.mark.parametrize(("name", "growing"), [("radar", 2), ("relative_gnss", 0)])
def test_in_a_long_outage_residuals_have_the_covariance_that_filters_are_told(long_outage, name, growing):
    """Ten minutes without a fix, 200 runs; the sensors are so good that the frame's error is all of it."""
    config, parts = long_outage
    model = sensor_measurement(name, config.sensors, nominal_chief(config.truth), 2.0, FORMS[name], frame="told")
    truth = np.concatenate([part.truth.relative for part in parts], axis=1)
    z = model.take(joined(parts, config, name), 0)
    assert np.isfinite(z).all()
    assert (reading_probability(config.sensors, name, parts[0].truth, 0, 2.0) == 1).all()
    sigmas = {}
    for epoch in (10, 31, 100, 200, 320, 345):
        x = np.broadcast_to(truth[:, epoch], (200, 6))
        nu = model.residual(z[:, epoch], model.predict(x, epoch))
        R = model.noise(x, epoch)
        squares = np.einsum("ri,rij,rj->r", nu, np.linalg.inv(R), nu)
        low, high = chi2.ppf([TAIL, 1 - TAIL], nu.size)
        assert low < squares.sum() < high
        sigmas[epoch] = np.sqrt(R[:, growing, growing].mean())
    # At a fix the frame is that of the fix; in the outage it is the filter's, which starts better and grows.
    assert sigmas[31] < 0.3 * sigmas[10]
    assert sigmas[320] > 1.1 * sigmas[31]
    assert sigmas[345] == pytest.approx(sigmas[10], rel=1e-3)


@pytest.mark.parametrize("name", ["sight", "fixes"])
def test_filters_stay_consistent_in_an_outage(name):
    """Normalised innovations and errors over 60 runs, with angles and positions as coarse as they are in reality.

    At 2 km the frame's error, which R calls white, is small beside what the filters reach.
    """
    near = "truth.deputy.relative.position_m=[20, -2000, 300]"
    config = campaign(OUTAGE, COARSE, near, "sensors.relative_gnss.position_sigma_m=1").cases[0].config
    source = RandomSource(5, tuple(range(60)))
    parts = list(chunks(config, source))
    history = filtered(config, name, parts, source)
    late = slice(150, 329)
    assert (history.dof[:, late] == 3).all()
    nis = history.nis[:, late]
    low, high = chi2.ppf([TAIL, 1 - TAIL], 3 * nis.size)
    assert low < nis.sum() < high
    truth = np.concatenate([part.truth.relative for part in parts], axis=1)[:, 1:]
    error = history.mean[:, 300] - truth[:, 300]
    nees = np.einsum("ri,rij,rj->r", error, np.linalg.inv(history.covariance[:, 300]), error)
    low, high = chi2.ppf([TAIL, 1 - TAIL], 6 * 60)
    assert low < nees.sum() < high


def test_with_the_star_tracker_out_the_range_goes_on():
    tracker = "{cross_boresight_sigma_arcsec: 10, about_boresight_sigma_arcsec: 30, noise: [{kind: gaussian}, %s]}"
    setting = "sensors.star_tracker=" + tracker % "{kind: outage, windows_s: [[100, 300]]}"
    config = campaign("{kind: bias, value: 0}", COARSE, setting).cases[0].config
    source = RandomSource(5, (0, 1, 2))
    parts = list(chunks(config, source))
    history = filtered(config, "sight", parts, source)
    epochs = np.arange(1, 351)
    out = (epochs >= 50) & (epochs < 150)
    assert (history.dof[:, out] == 1).all()
    assert (history.dof[:, ~out] == 3).all()
    # The range alone keeps the distance known: 100 readings of 2 m are worth some 0.2 m along the line of sight.
    truth = np.concatenate([part.truth.relative for part in parts], axis=1)[:, 149]
    sight = truth[:, :3] / np.linalg.norm(truth[:, :3], axis=1)[:, None]
    variance = np.einsum("ri,rij,rj->r", sight, history.covariance[:, 148, :3, :3], sight)
    assert (np.sqrt(variance) < 0.7).all()


def test_before_the_first_fix_there_is_a_range_and_no_direction():
    config = campaign("{kind: outage, windows_s: [[0, 100]]}", COARSE).cases[0].config
    parts = flight(config, range(2))
    radar, gnss = (joined(parts, config, name)[..., :3] for name in FORMS)
    before = np.arange(351) < 50
    assert np.isfinite(radar[..., 0]).all()
    assert np.isnan(radar[:, before, 1:]).all()
    assert np.isfinite(radar[:, ~before]).all()
    assert np.isnan(gnss[:, before]).all()
    assert np.isfinite(gnss[:, ~before]).all()
    assert np.isfinite(joined(parts, config, "radar")[..., 3:]).all()
    result = simulate_block(campaign("{kind: outage, windows_s: [[0, 100]]}", COARSE).cases[0], 3, [0, 1]).result
    assert not result.failures
    for name in FORMS:
        chance = reading_probability(config.sensors, name, parts[0].truth, 0, 2.0)
        read = np.isfinite(joined(parts, config, name)[:1, :, :3])
        np.testing.assert_array_equal(chance, read)


@pytest.mark.parametrize("outage", [OUTAGE, "{kind: outage, rate_per_hour: 60, mean_duration_s: 40}"])
def test_no_bit_depends_on_the_block_or_the_chunks(monkeypatch, outage):
    case = campaign(outage, "clock.duration_s=300", COARSE).cases[0]
    together = simulate_block(case, 3, range(4)).result
    monkeypatch.setattr(chunks_module, "CHUNK_EPOCHS", 37)
    alone = simulate_block(case, 3, [2]).result
    for name in ("sight", "fixes"):
        np.testing.assert_array_equal(alone.filters[name].error[0], together.filters[name].error[2])
        assert np.isfinite(alone.filters[name].error).all()


def test_readings_between_fixes_far_apart():
    """A receiver with a period longer than the step: every reading has a direction, and R knows which are good."""
    config = campaign("{kind: bias, value: 0}", "sensors.gnss.period_s=20").cases[0].config
    z = joined(flight(config, range(3)), config, "radar")
    assert np.isfinite(z).all()
    first = z[:, :, 3]
    assert np.ptp(first[:, ::10]) == 0
    assert (first[:, 101:109] < first[:, 100:101]).all()


@pytest.mark.parametrize(
    ("outage", "settings", "hosts"),
    [
        ("{kind: bias, value: 0}", [], ()),
        ("{kind: bias, value: 0}", ["sensors.gnss.period_s=2"], ()),
        ("{kind: bias, value: 0}", ["sensors.gnss.period_s=4"], ("chief",)),
        (OUTAGE, [], ("chief",)),
        (OUTAGE, ["sensors.gnss=null"], ()),
    ],
)
def test_an_orbit_filter_runs_only_where_fixes_may_be_missing(monkeypatch, outage, settings, hosts):
    config = campaign(outage, *settings).cases[0].config
    assert host_orbits.HostOrbits(config, 1).hosts == hosts
    if not hosts:
        monkeypatch.setattr(host_orbits, "OrbitFilter", None)  # it would fail to be called
        assert flight(config, [0])[0].orbits == {}


def test_the_host_knows_of_its_own_burns():
    """A metre a second across the plane in the outage: unknown, it would turn the frame by 1.3e-4 rad."""
    burn = "truth.manoeuvres={push: {craft: chief, time_s: 200, delta_v_m_s: [0, 0, 1]}}"
    config = campaign(OUTAGE, burn).cases[0].config
    parts = flight(config, range(3))
    states = np.concatenate([part.orbits["chief"].states for part in parts], axis=1)
    chief = np.concatenate([part.truth.chief for part in parts], axis=1)
    assert np.abs(states - chief)[:, 31:330, 3:].max() < 0.2


def test_every_filter_goes_by_readings_whose_frame_is_told():
    """Outliers, lost channels and a frame that each reading tells, all at once."""
    sampling = {"alpha_kf": "samples: 100", "mkf": "samples: 100", "skf": "samples: 100"}
    noise = "[{kind: mixture, scale: 5, fraction: 0.2}, {kind: outage, windows_s: [[10, 14]]}]"
    settings = [
        "clock.duration_s=40",
        COARSE,
        f"sensors.radar.noise={noise}",
        "sensors.relative_gnss={position_sigma_m: 1, period_s: 4}",
        f"sensors.star_tracker={{cross_boresight_sigma_arcsec: 9, about_boresight_sigma_arcsec: 30, noise: {noise}}}",
    ]
    text = TEXT[: TEXT.index("filters:")].replace("OUTAGE", "{kind: outage, windows_s: [[8, 20]]}") + "filters:\n"
    learned = {"gp_ekf", "gp_ukf", "gp_particle", "mf_upf"}
    for kind in sorted(set(filter_kinds()) - learned):
        form = "cartesian" if filter_kinds()[kind].linear_only else "spherical"
        more = f", {sampling[kind]}" if kind in sampling else ", particles: 300" if "particle" in kind else ""
        text += f"  {kind}: {{kind: {kind}, dynamics: {{kind: cw}}, measurement: {form}, assumed_noise: mixture{more},"
        text += " process_noise: {acceleration_psd_m2_s3: 1.0e-6}}\n"
    outcome = simulate_block(parse_campaign(text + "statistics: {settle_s: 20}\n", settings).cases[0], 3, [0, 1])
    assert {name: each.reason for name, each in outcome.broken.items()} == {}
    assert outcome.result.failures == ()
