"""The example of docs/add-a-sensor.md: a sensor of another package, found through its entry point alone."""

import json
import re

import pytest
from installed_example import ROOT, distribution, example, python

EXAMPLE, PROJECT, NAME, MODULE = example("sensor", "relnav.sensors")
GROUP = "relnav.sensors"


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    distribution(folder, PROJECT["name"], PROJECT["version"], {NAME: MODULE}, GROUP)
    return [folder, EXAMPLE]


@pytest.mark.slow
def test_it_passes_the_contract_tests(installed):
    done = python(installed, "-m", "pytest", "tests/contracts/test_sensors.py", "-k", NAME, "-p", "no:cacheprovider")
    assert done.returncode == 0, done.stdout[-3000:]
    outcomes = "".join(re.findall(r"^(\.+) +\[", done.stdout, re.MULTILINE))
    contracts = (ROOT / "tests" / "contracts" / "test_sensors.py").read_text(encoding="utf-8").count("\ndef test_")
    assert len(outcomes) >= contracts, "every contract is tried"


SCRIPT = """
import json, sys
from relnav_sim import load_campaign, open_results, run_campaign

if __name__ == "__main__":
    campaign = load_campaign(sys.argv[1], ["runs=4", "clock.duration_s=900", "statistics.settle_s=300"])
    path = run_campaign(campaign, out="small.h5", workers=2)
    with open_results(path) as results:
        columns = results.summary()
        bounds = {name: results.bound(0, name) is not None for name in results.filters}
    names = columns["filter"]
    print(json.dumps({
        "rms": {name: float(columns["settled_r_rms_m"][names == name].mean()) for name in dict.fromkeys(names)},
        "failed": int(columns["failed"].sum()),
        "bounds": bounds,
    }))
"""


@pytest.mark.slow
def test_a_campaign_runs_it_on_two_workers(installed, tmp_path):
    """The workers are processes of their own, which find it by themselves; there is a bound; it does its job."""
    (tmp_path / "script.py").write_text(SCRIPT)
    done = python(installed, "script.py", str(EXAMPLE / "campaign.yaml"), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["failed"] == 0
    assert told["rms"]["both"] < told["rms"]["radar_alone"]
    assert told["bounds"] == {"radar_alone": True, "both": True}


@pytest.mark.slow
def test_the_command_line_knows_it(installed, tmp_path):
    code = (
        "from typer.testing import CliRunner\n"
        "from relnav_sim.cli.app import app\n"
        f"campaign = {str(EXAMPLE / 'campaign.yaml')!r}\n"
        f"for words in (['list', 'sensors'], ['show', 'sensor', {NAME!r}], ['validate', campaign], ['schema']):\n"
        "    done = CliRunner().invoke(app, words, catch_exceptions=False)\n"
        "    assert done.exit_code == 0, done.output\n"
        "    print(done.output)\n"
    )
    done = python(installed, "-c", code, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert re.search(rf"^{NAME} +Range rate of the other craft", done.stdout, re.MULTILINE)
    assert "range_rate_sigma_m_s" in done.stdout
    assert '"DopplerOptions"' in done.stdout  # in the schema


HEAD = """
from typing import ClassVar, Literal
import numpy as np
from relnav_sim import LinearMeasurement, register_sensor
from relnav_sim.sensors import Channel, RelativeSensorOptions

@register_sensor("odd")
class Odd(RelativeSensorOptions):
    "A sensor that does not keep to its protocol."
    channels: ClassVar = (Channel("a", "m", "a"), Channel("b", "m", "b"))
    kind: Literal["odd"] = "odd"
    sigmas: ClassVar = np.ones(2)
    def sample(self, truth, streams):
        return SAMPLE
    def measurement(self, context):
        return LinearMeasurement(np.eye(2, 6), np.eye(2))
    def first_fix(self, measurement, z):
        return z, np.zeros((len(z), 3, 3))
"""


@pytest.mark.parametrize(
    ("sample", "says"),
    [
        ("np.zeros((2, 3))", "sensors.odd: sample of the odd sensor returned shape (2, 3); expected (runs, K, 2)"),
        pytest.param(
            "np.zeros((2, 3, 2))",
            "sensors.odd: first_fix's position of the odd sensor returned shape (2, 2); expected (2, 3)",
            marks=pytest.mark.slow,
        ),
        pytest.param("truth.nothing", "sensors.odd: the odd sensor raises AttributeError: ", marks=pytest.mark.slow),
        pytest.param(
            "np.zeros((2, 3, 2))\n    def in_reach(self, truth):\n        return np.ones(4, bool)",
            "sensors.odd: in_reach of the odd sensor returned shape (4,); expected (2, 3) or (1, 3)",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "np.zeros((2, 3, 2))\n    def needs_direction(self):\n        return True",
            "sensors.odd: needs_direction of the odd sensor returned shape (); expected (2,)",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "np.zeros((2, 3, 2))\n    def inputs(self, z, frame):\n        return {'mine': z}",
            "sensors.odd: inputs of the odd sensor returned no 'spherical', the usual form",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_goes_wrong_is_named_before_anything_runs(tmp_path, sample, says):
    (tmp_path / "odd_sensor.py").write_text(HEAD.replace("SAMPLE", sample))
    distribution(tmp_path, "odd-sensor", "1.0", {"odd": "odd_sensor"}, GROUP)
    text = (EXAMPLE / "campaign.yaml").read_text(encoding="utf-8")
    (tmp_path / "odd.yaml").write_text(text.replace("doppler: {range_rate_sigma_m_s: 1.0e-3, period_s: 10}", "odd: {}"))
    done = python([tmp_path], "-m", "relnav_sim", "validate", "odd.yaml", cwd=tmp_path)
    assert done.returncode == 2
    assert says in done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr


def test_the_guide_shows_the_example_as_it_is():
    guide = (ROOT / "docs" / "add-a-sensor.md").read_text(encoding="utf-8")
    module = (EXAMPLE / f"{MODULE}.py").read_text(encoding="utf-8")
    assert f"```python\n{module}```" in guide, "copy the module into docs/add-a-sensor.md again"
