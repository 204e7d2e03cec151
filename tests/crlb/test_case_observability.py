"""What campaigns say of the observability of their filters' sensors, before and after a run."""

import numpy as np
import pytest

from relnav_sim import LinearDynamics, open_results, run_campaign
from relnav_sim.campaign.load import parse_campaign
from relnav_sim.crlb.case_bound import case_bound
from relnav_sim.crlb.case_observability import MOST_STEPS, case_observability
from relnav_sim.dynamics.registry import build_dynamics
from relnav_sim.plots import observability_over_time, rms_over_time
from relnav_sim.plots.facts import case_facts
from relnav_sim.report.observability_table import observability_table
from relnav_sim.report.ranking import rank
from relnav_sim.report.summary import summarise
from relnav_sim.runner.warnings import observability_warnings

TEXT = """
name: bearings
seed: 3
runs: 4
clock: {duration_s: 3000, step_s: 10, store_every_s: 100}
truth:
  chief: {orbit: {a_km: 6978.137, e: 0, i_deg: 50}, mass_kg: 1, area_m2: 1}
  deputy: {relative: {position_m: [50, -3000, 100], velocity_m_s: [0.05, -0.1, 0.1]}, mass_kg: 1, area_m2: 1}
  forces: {zonals: 0, drag: none}
sensors:
  radar: {range_sigma_m: 5, angle_sigma_deg: 0.1}
  camera: {kind: seen}
start: {kind: dispersed, position_sigma_m: 50, velocity_sigma_m_s: 0.1}
statistics: {settle_s: 1000}
filters:
  both: {kind: ekf}
  camera: {kind: ekf, sensors: [camera]}
  radar: {kind: ekf, sensors: [radar]}
"""
BURN = "  manoeuvres: {burn: {time_s: 1000, delta_v_m_s: [0.3, 0, 0]}}\nsensors:"


def observed(text, *overrides):
    return case_observability(parse_campaign(text, overrides).cases[0].config)


def test_a_camera_alone_leaves_the_scale(own_sensors):
    found = observed(TEXT)
    assert found["both"].observable and found["radar"].observable
    camera = found["camera"]
    assert camera.blind == 1 and camera.weakest.startswith("the state itself")
    assert camera.ratio == pytest.approx(np.ones(31), abs=1e-9)
    assert camera.sensors == ("camera",) and found["both"].sensors == ("radar", "camera")
    start = np.array([50, -3000, 100, 0.05, -0.1, 0.1]) / np.repeat([50, 0.1], 3)
    assert abs(camera.direction @ start) / np.linalg.norm(start) == pytest.approx(1, abs=1e-6)


def test_readings_count_as_often_as_they_come():
    """Angles that never meet the attitude's own readings are none: the radar is a rangefinder."""
    text = TEXT.replace("  camera: {kind: seen}\n", "").split("filters:")[0] + "filters: {ekf: {kind: ekf}}\n"
    tracker = "  star_tracker: {cross_boresight_sigma_arcsec: 1, about_boresight_sigma_arcsec: 1, period_s: 20"
    radar = "sensors.radar.period_s=20"
    together = observed(text.replace("start:", tracker + "}\nstart:"), radar)["ekf"]
    apart = observed(text.replace("start:", tracker + ", offset_s: 10}\nstart:"), radar)["ekf"]
    assert together.observable and not apart.observable and apart.weakest == "normal position and normal velocity"
    ranges = text.replace("radar: {range_sigma_m: 5, angle_sigma_deg: 0.1}", "lidar: {range_sigma_m: 5, period_s: 20}")
    assert apart.ratio == pytest.approx(observed(ranges)["ekf"].ratio, rel=1e-9)

    once = observed(text, "sensors.radar.period_s=2000")["ekf"]
    assert once.blind == 3  # one position, and six numbers to tell
    late, begun = (observed(text, f"sensors.radar.{key}=2000")["ekf"] for key in ("latency_s", "offset_s"))
    assert late.ratio == pytest.approx(begun.ratio, rel=1e-12) and late.ratio[-1] < 0.9


def test_a_manoeuvre_helps_the_filter_that_knows_of_it(own_sensors):
    text = TEXT.replace("sensors:", BURN, 1) + "  deaf: {kind: ekf, sensors: [camera], known_thrust: none}\n"
    found = observed(text)
    assert found["camera"].observable and found["camera"].ratio[9] > 0.999
    assert found["deaf"].blind == 1
    # What the readings tell of the scale grows with the square of a burn that is small.
    small = [observed(text.replace("[0.3, 0, 0]", f"[{size}, 0, 0]"))["camera"].ratio[-1] for size in (0.01, 0.03)]
    told, more = 1 / np.square(small) - 1
    assert more / told == pytest.approx(9, rel=0.1)


def test_over_time_it_says_which_direction_is_the_weakest(own_sensors):
    """A radar needs two readings for six states; until then several directions are left, and it says how many."""
    found = observed(TEXT)
    assert found["camera"].course[-1][1].startswith("the state itself")
    assert found["camera"].weakest_at(3000) == found["camera"].weakest and found["camera"].weakest_at(0) == ""
    times = [from_s for from_s, _ in found["radar"].course]
    assert times[0] == 10 and times == sorted(times)
    few = observed(TEXT, "sensors.radar.period_s=1000")["radar"]
    assert few.weakest_at(990) == "6 of 6 directions" and few.weakest_at(1000) == "3 of 6 directions"
    assert few.weakest_at(3000) == few.weakest and few.observable


def test_it_takes_few_steps_however_many_epochs_there_are(own_sensors):
    coarse, fine = observed(TEXT), observed(TEXT, "clock.step_s=1")
    assert MOST_STEPS == 300
    # Ten times the readings, and ten times the step of the campaign's: a root of ten less of each sigma.
    assert coarse["radar"].ratio[-1] / fine["radar"].ratio[-1] == pytest.approx(np.sqrt(10), rel=0.02)
    rare = observed(TEXT, "clock.step_s=1", "sensors.radar.period_s=10")
    assert rare["radar"].ratio[-1] == pytest.approx(coarse["radar"].ratio[-1], rel=0.02)
    seldom = "sensors.star_tracker={cross_boresight_sigma_arcsec: 1, about_boresight_sigma_arcsec: 1, period_s: 7}"
    assert observed(TEXT, "clock={duration_s: 3003, step_s: 1, store_every_s: 1}", seldom)["camera"].blind == 1
    late = observed(TEXT, "sensors.radar.offset_s=3000")
    assert (late["radar"].ratio[:-1] == 1).all() and late["radar"].blind > 0


def test_a_bias_that_the_readings_do_not_tell_is_named(own_sensors):
    text = TEXT + "  told: {kind: ekf, sensors: [radar], augment: [{kind: range_bias, sigma_m: 0.001}]}\n"
    found = observed(text)
    assert found["told"].observable and found["told"].untold == ("range_bias",)
    considered = observed(text.replace("sigma_m: 0.001", "sigma_m: 0.001, mode: consider"))
    assert considered["told"].states == ("x", "y", "z", "vx", "vy", "vz")


def test_a_start_that_is_better_than_any_reading_is_no_reason(own_sensors):
    tight = observed(TEXT, "start.position_sigma_m=1e-4", "start.velocity_sigma_m_s=1e-7")
    assert tight["radar"].observable and not tight["camera"].observable


def test_filters_are_told_alike_only_where_their_motion_is(monkeypatch):
    """A plug-in's motion may follow from the process noise, or not be there with it."""

    def by_noise(options, context):
        psd = context.process_noise.acceleration_psd_m2_s3
        if psd == 1e-3:
            raise ValueError("no such motion")
        # Where nothing moves, readings of the position tell nothing of the velocity.
        return LinearDynamics(np.eye(6), np.zeros((6, 6))) if psd == 1e-4 else build_dynamics(options, context)

    monkeypatch.setattr("relnav_sim.crlb.case_observability.build_dynamics", by_noise)
    noises = {"gone": "1e-3", "still": "1e-4", "moves": "1e-6", "quieter": "1e-8"}
    filters = [
        f"  {name}: {{kind: ekf, process_noise: {{acceleration_psd_m2_s3: {psd}}}}}" for name, psd in noises.items()
    ]
    text = TEXT.replace("  camera: {kind: seen}\n", "").split("filters:")[0]
    for order in (filters, filters[::-1]):
        found = observed(text + "filters:\n" + "\n".join(order) + "\n")
        assert {name: one.blind for name, one in found.items()} == {"still": 3, "moves": 0, "quieter": 0}
        assert found["moves"] is found["quieter"]


def test_nothing_is_said_where_there_is_no_start(own_sensors):
    blind = observed(TEXT, "start={kind: first_fix}", "sensors.radar.range_limits_m=[10, 100]")
    assert blind == {}


@pytest.mark.slow
def test_validate_and_the_report_say_the_same_and_rank_the_others(own_sensors, tmp_path):
    campaign = parse_campaign(TEXT)
    (said,) = observability_warnings(campaign)
    assert said.startswith("Filter camera (sensor camera): not observable: the state itself")
    out = run_campaign(campaign, tmp_path / "out.h5", backend="sequential")
    with open_results(out) as results:
        ranking = rank(case_facts(results, 0))
        headline, second, limit, *_ = summarise([ranking])
        assert limit.startswith("Limit: ") and ("that goes by the same sensors" in limit) == (
            ranking.best.name != "both"
        )
        labels = [text.get_text() for text in rms_over_time(results).legends[0].get_texts()]
        assert labels[-3:] == ["PCRB, all sensors", "PCRB, camera", "PCRB, radar"]
        for name, ratio in ((item.name, item.times_bound["whole"].estimate) for item in ranking.case.filters):
            error, bound = results.error(0, name)[:, 1:, :3], results.perfect_bound(0, name)[1:, 6]
            assert ratio == pytest.approx(np.sqrt(np.square(error).sum(axis=2).mean() / np.square(bound).mean()))
        assert second == said
        assert "camera" not in headline and [item.name for item in ranking.ranked] != [*ranking.case.names]
        (pair,) = ranking.position
        assert {pair.first, pair.second} == {"both", "radar"}
        assert results.observability(0, "camera").blind == 1
        assert results.observability(0, "camera").course == observed(TEXT)["camera"].course
        table = observability_table(ranking.case)
        assert [row.label for row in table.rows] == ["settled, t = 1000 s", "end of the run, t = 3000 s"]
        assert [group for group, _ in table.groups] == ["both", "camera", "radar"]
        shown = [cell.value for row in table.rows for cell in row.cells[2::6]]
        np.testing.assert_allclose(shown, results.observability(0, "camera").ratio[[10, 30]])
        panel = observability_over_time(results, filters=["camera"]).axes[0]
        np.testing.assert_array_equal(panel.lines[0].get_ydata(), results.observability(0, "camera").ratio)


def test_a_case_with_nothing_observable_has_no_ranking(own_sensors, tmp_path):
    text = TEXT.partition("  both:")[0] + "  a: {kind: ekf, sensors: [camera]}\n  b: {kind: ukf, sensors: [camera]}\n"
    out = run_campaign(parse_campaign(text), tmp_path / "out.h5", backend="sequential")
    with open_results(out) as results:
        headline, second, *_ = summarise([rank(case_facts(results, 0))])
    assert headline.startswith("Not observable: no filter's sensors can tell the state")
    assert second.startswith("Filters a, b (sensor camera): not observable")


def test_each_filter_is_bounded_by_its_own_sensors(own_sensors):
    """To the bit what a campaign with these sensors alone says."""
    made = parse_campaign(TEXT)
    whole = case_bound(made.cases[0], made.seed)
    assert whole.perfect_of.keys() == {"camera", "radar"}
    for name in ("camera", "radar"):
        other = {"camera": "  radar: {range_sigma_m: 5, angle_sigma_deg: 0.1}\n", "radar": "  camera: {kind: seen}\n"}
        text = TEXT.replace(other[name], "").partition("  both:")[0] + f"  {name}: {{kind: ekf}}\n"
        alone = parse_campaign(text)
        bound = case_bound(alone.cases[0], alone.seed)
        np.testing.assert_array_equal(whole.perfect_of[name], bound.perfect)
        np.testing.assert_array_equal(whole.filters[name], bound.filters[name])
        assert bound.perfect_of == {}
        assert (whole.perfect[1:] < whole.perfect_of[name][1:]).all()
