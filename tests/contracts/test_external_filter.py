"""The example of docs/add-a-filter.md: a filter of another package, found through its entry point alone."""

import json
import re

import pytest
from installed_example import ROOT, distribution, example, python

EXAMPLE, PROJECT, NAME, MODULE = example("filter", "relnav.filters")
CONTRACTS = ("tests/contracts/test_filters.py", "tests/contracts/test_readings.py")


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    distribution(folder, PROJECT["name"], PROJECT["version"], {NAME: MODULE})
    return [folder, EXAMPLE]


@pytest.mark.slow
def test_it_passes_the_contract_tests(installed):
    done = python(installed, "-m", "pytest", *CONTRACTS, "-k", NAME, "-p", "no:cacheprovider")
    assert done.returncode == 0, done.stdout[-3000:]
    assert "[100%]" in done.stdout
    dots = sum(line.count(".") for line in re.findall(r"^\.+ +\[", done.stdout, re.MULTILINE))
    contracts = sum((ROOT / path).read_text(encoding="utf-8").count("def test_") for path in CONTRACTS)
    assert dots >= contracts, "every contract is tried"


SCRIPT = """
import json, sys
from relnav_sim import load_campaign, open_results, run_campaign

if __name__ == "__main__":
    campaign = load_campaign(sys.argv[1], ["runs=2", "clock.step_s=5"])
    path = run_campaign(campaign, out="small.h5", workers=2)
    with open_results(path) as results:
        columns = results.summary()
    names = columns["filter"]
    print(json.dumps({
        "rms": {name: float(columns["settled_r_rms_m"][names == name].mean()) for name in dict.fromkeys(names)},
        "failed": int(columns["failed"].sum()),
    }))
"""


@pytest.mark.slow
def test_a_campaign_runs_it_on_two_workers(installed, tmp_path):
    """The workers are processes of their own, which find the filter by themselves; and it does what it is for."""
    (tmp_path / "script.py").write_text(SCRIPT)
    done = python(installed, "script.py", str(EXAMPLE / "campaign.yaml"), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["failed"] == 0
    assert told["rms"]["fading_100"] < 0.4 * told["rms"]["ekf"]


@pytest.mark.slow
def test_the_command_line_lists_and_shows_it(installed):
    code = (
        "from typer.testing import CliRunner\n"
        "from relnav_sim.cli.app import app\n"
        f"for words in (['list', 'filters'], ['show', 'filter', {NAME!r}]):\n"
        "    print(CliRunner().invoke(app, words, catch_exceptions=False).output)\n"
    )
    done = python(installed, "-c", code)
    assert done.returncode == 0, done.stderr
    assert re.search(rf"^{NAME} .* Fading-memory filter", done.stdout, re.MULTILINE)
    assert f"{NAME}: Fading-memory filter" in done.stdout and "memory_s" in done.stdout


def test_a_broken_package_is_named_and_leaves_the_other_filters(tmp_path):
    """The example can be imported, but is unknown until it is installed."""
    (tmp_path / "breaks.py").write_text("import no_such_module\n")
    (tmp_path / "doubles.py").write_text(
        "from relnav_sim import register_filter\n"
        "from relnav_sim.options import Options\n"
        "@register_filter('ekf', Options)\n"
        "class Another: ...\n"
    )
    distribution(tmp_path, "broken-filter", "1.0", {"breaks": "breaks"})
    distribution(tmp_path, "second-ekf", "1.0", {"doubles": "doubles"})
    code = "from relnav_sim.filters.registry import filter_kinds as k; print(k()['ekf'].factory.__name__, *k())"
    done = python([tmp_path, EXAMPLE], "-c", code)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[0] == "ExtendedKalmanFilter" and NAME not in done.stdout.split()
    assert re.search("broken-filter are left out.*no_such_module", done.stderr)
    assert re.search("second-ekf are left out.*'ekf' is registered already", done.stderr)


def test_the_guide_shows_the_example_as_it_is():
    guide = (ROOT / "docs" / "add-a-filter.md").read_text(encoding="utf-8")
    module = (EXAMPLE / f"{MODULE}.py").read_text(encoding="utf-8")
    assert f"```python\n{module}```" in guide, "copy the module into docs/add-a-filter.md again"
