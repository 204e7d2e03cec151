"""What filters are told: a row for each effect that a sensor says it has, whatever sensor it is."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, Any, ClassVar, Literal, cast

import numpy as np
import pytest
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.campaign import parse_campaign
from relnav_sim.measurements.channel import Channel
from relnav_sim.options import Effect
from relnav_sim.report.told import MISSING, NOT_TOLD, NOT_USED, told_table
from relnav_sim.results.read import Results
from relnav_sim.sensors import registry
from relnav_sim.sensors.interface import RelativeSensorOptions, SensorOptions
from relnav_sim.sensors.registry import sensor_kinds

HEAD = """
name: told
seed: 1
runs: 2
clock: {duration_s: 100, step_s: 1, store_every_s: 10}
truth:
  chief: {orbit: {altitude_km: 500, i_deg: 50}, mass_kg: 100, area_m2: 1}
  deputy: {relative: {position_m: [0, 1000, 0], velocity_m_s: [0, 0, 0]}, mass_kg: 100, area_m2: 1}
start: {kind: dispersed, position_sigma_m: 10, velocity_sigma_m_s: 0.1}
statistics: {settle_s: 50}
"""


def _cells(text: str) -> dict[str, list[str]]:
    campaign = parse_campaign(HEAD + text)
    filters = tuple(campaign.content["filters"])
    sensors = [name for name, each in campaign.cases[0].config.sensors.items() if each.role == "other"]
    header = SimpleNamespace(filters=filters, variables={}, channels=dict.fromkeys(sensors, ()), stress="")
    results = SimpleNamespace(headers=(header,), campaign_content=campaign.content, nominal=(0,))
    table = told_table(cast("Results", results), 0)
    return {row.label: [cell.text for cell in row.cells] for row in table.rows}


def test_every_effect_of_every_sensor_has_a_row() -> None:
    rows = _cells("""
sensors:
  camera: {host: deputy, angle_sigma_deg: 0.02, field_of_view_deg: [10, 8], range_limits_m: [1, 5000], sunlit: true,
           sun_direction: [1, 0, 0], sun_exclusion_deg: 30}
  link: {kind: crosslink, host: deputy, range_sigma_m: 1, range_rate_sigma_m_s: 0.1, clock_bias_sigma_m: 30,
         period_s: 5,
         noise: [{kind: gaussian}, {kind: gauss_markov, tau_s: 100}, {kind: outage, windows_s: [[10, 20]]}]}
  gnss: {position_sigma_m: 10, velocity_sigma_m_s: 0.05}
  star_tracker: {cross_boresight_sigma_arcsec: 10, about_boresight_sigma_arcsec: 30, noise: [{kind: gaussian},
                 {kind: bias, value: 0.5}]}
filters:
  both:
    kind: ekf
    augment: [{kind: clock, sigma_m: 30, drift_sigma_m_s: 0.1}, {kind: attitude_error, sigma_arcsec: 5}]
  link_only: {kind: ekf, sensors: [link]}
""")
    assert rows["camera: field of view"] == ["field_of_view_deg [10, 8], boresight fixed", MISSING, NOT_USED]
    assert rows["camera: range limits"][1:] == rows["camera: Sun exclusion"][1:] == [MISSING, NOT_USED]
    assert rows["camera: light"] == ["sunlit", MISSING, NOT_USED]
    assert rows["link: noise"] == ["range_sigma_m 1, range_rate_sigma_m_s 0.1; gaussian", "told", "told"]
    assert rows["link: clock bias"] == ["clock_bias_sigma_m 30", "augmented states (clock)", NOT_TOLD]
    assert rows["link: correlated noise"][1:] == ["augmented states (clock)", NOT_TOLD]
    assert rows["link: outages"] == ["windows_s [[10, 20]]", MISSING, MISSING]
    assert rows["link: period"] == ["period_s 5", MISSING, MISSING]
    assert rows["gnss: noise"][1:] == rows["star_tracker: noise"][1:] == ["told: in R of directions", NOT_USED]
    assert rows["star_tracker: constant error"][1:] == ["augmented states (attitude_error)", NOT_USED]
    assert "link: latency" not in rows and "link: clock drift" not in rows


def test_noise_bias_latency_and_accelerometers_as_each_filter_takes_them() -> None:
    rows = _cells("""
sensors:
  radar: {range_sigma_m: 4, angle_sigma_deg: 0.1, azimuth_bias_deg: 0.05, latency_s: 1,
          noise: {kind: mixture, scale: 3, fraction: 0.1}}
  late: {kind: crosslink, range_sigma_m: 1, drawn_latency_s: [0, 3]}
  accelerometer: {velocity_random_walk_m_s_sqrt_s: 1.0e-4, bias_sigma_m_s2: 1.0e-5}
filters:
  total: {kind: kf, r_scale: 2, known_thrust: none, sensors: [radar]}
  mixture: {kind: imm, assumed_noise: mixture, assumed_latency: none, known_thrust: measured,
            augment: [{kind: azimuth_bias, sigma_deg: 0.05}]}
""")
    assert rows["radar: noise"][1:] == ["one Gaussian with the total covariance, times 2", "told: the components"]
    assert rows["radar: azimuth bias"][1:] == [NOT_TOLD, "augmented states (azimuth_bias)"]
    assert rows["radar: latency"] == ["latency_s 1", "told", NOT_TOLD]
    assert rows["late: random latency"] == ["drawn_latency_s [0, 3]", NOT_USED, "late measurements left out"]
    assert rows["accelerometer: noise"] == [
        "velocity_random_walk_m_s_sqrt_s 0.0001; gaussian", NOT_USED, "as noise of the known control input"
    ]  # fmt: skip
    assert rows["accelerometer: bias"][1:] == [NOT_USED, NOT_TOLD]


def test_a_sensor_of_another_package_says_its_effects_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    class SonarOptions(RelativeSensorOptions):
        channels: ClassVar[tuple[Channel, ...]] = (Channel("range", "m", "range"),)
        kind: Literal["sonar"] = Field(default="sonar", description="Range")
        range_sigma_m: float = Field(gt=0, description="Range noise, m")
        echo_m: Annotated[float, Effect("false echo", "never")] = Field(default=0.0, description="False echo, m")

        @property
        def sigmas(self) -> Array:
            return np.array([self.range_sigma_m])

    monkeypatch.setitem(registry._KINDS, "sonar", SonarOptions)
    content: dict[str, Any] = {"sensors": {"sonar": {"kind": "sonar", "range_sigma_m": 2.0, "echo_m": 7.0}}}
    header = SimpleNamespace(filters=("kf",), variables={}, channels={"sonar": ()}, stress="")
    results = SimpleNamespace(headers=(header,), campaign_content={**content, "filters": {"kf": {}}}, nominal=(0,))
    rows = {row.label: [cell.text for cell in row.cells] for row in told_table(cast("Results", results), 0).rows}
    assert rows["sonar: noise"] == ["range_sigma_m 2; gaussian", "told"]
    assert rows["sonar: false echo"] == ["echo_m 7", NOT_TOLD]
    monkeypatch.delitem(registry._KINDS, "sonar")
    rows = {row.label: [cell.text for cell in row.cells] for row in told_table(cast("Results", results), 0).rows}
    assert rows["sonar"][1] == "not known: this sensor is not installed"


@pytest.mark.parametrize("kind", sorted(sensor_kinds()))
def test_no_option_of_a_sensor_is_forgotten(kind: str) -> None:
    """Each is marked as an effect, is a sigma, or only says where the sensor sits and what it reads."""
    structure = {
        "kind",
        "host",
        "noise",
        "offset_s",
        "form",
        "mounting_deg",
        "sun_direction",
        "solution",
        "boresight_body",
    }
    model: type[SensorOptions] = sensor_kinds()[kind]
    for key, field in model.model_fields.items():
        marked = any(isinstance(mark, Effect) for mark in field.metadata)
        assert marked or "sigma" in key or key in structure, key
