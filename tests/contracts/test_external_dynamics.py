"""The example of docs/add-a-dynamics.md: dynamics of another package, found through their entry point alone."""

import json
import re

import numpy as np
import pytest
from installed_example import ROOT, distribution, example, python
from scipy.integrate import solve_ivp

EXAMPLE, PROJECT, NAME, MODULE = example("dynamics", "relnav.dynamics")


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    distribution(folder, PROJECT["name"], PROJECT["version"], {NAME: MODULE}, "relnav.dynamics")
    return [folder, EXAMPLE]


def test_they_pass_the_contract_tests(installed):
    done = python(installed, "-m", "pytest", "tests/contracts/test_dynamics.py", "-k", NAME, "-p", "no:cacheprovider")
    assert done.returncode == 0, done.stdout[-3000:]
    assert "[100%]" in done.stdout
    outcomes = "".join(re.findall(r"^([.s]+) +\[", done.stdout, re.MULTILINE))
    source = (ROOT / "tests" / "contracts" / "test_dynamics.py").read_text(encoding="utf-8")
    # Those of all kinds; the others are for dynamics that are fed or learned.
    contracts = len(re.findall(r"^def test_\w+\(dynamics\b|dynamics_kinds\(\)\)\ndef test_", source, re.MULTILINE))
    assert len(outcomes) >= contracts > 5 and outcomes.count(".") > contracts // 2, "every contract is tried"


def test_they_solve_their_equations(installed):
    """Against a Runge-Kutta integration of dx/dt = A x + drag."""
    code = (
        "import json, numpy as np\n"
        "from relnav_sim import Step, dynamics\n"
        "from relnav_sim.dynamics.context import DynamicsContext\n"
        "from relnav_sim.dynamics.process_noise import white_acceleration\n"
        "from relnav_sim.dynamics.registry import dynamics_kinds\n"
        f"options = dynamics_kinds()[{NAME!r}](along_track_m_s2=-3e-5)\n"
        "orbit = dynamics.ChiefOrbit(6.728e6, 0.0, 0.9, 0.0, 0.0, 0.0)\n"
        "built = options.build(DynamicsContext(orbit, white_acceleration(1e-9), 60.0))\n"
        "x = np.array([[10.0, -300.0, 20.0, 0.01, 0.02, 0.03]])\n"
        "print(json.dumps([orbit.mean_motion_rad_s, built.propagate(x, Step(1, 60.0))[0].tolist()]))\n"
    )
    done = python(installed, "-c", code)
    assert done.returncode == 0, done.stderr
    n, end = json.loads(done.stdout)

    def rates(t, x):
        return [*x[3:], 3 * n**2 * x[0] + 2 * n * x[4], -2 * n * x[3] - 3e-5, -(n**2) * x[2]]

    start = [10.0, -300.0, 20.0, 0.01, 0.02, 0.03]
    expected = solve_ivp(rates, (0, 60), start, rtol=1e-12, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(end, expected, rtol=0, atol=1e-9)


SCRIPT = """
import json, sys
from relnav_sim import load_campaign, open_results, run_campaign

if __name__ == "__main__":
    campaign = load_campaign(sys.argv[1], ["runs=2", "clock.step_s=5", "clock.duration_s=1200"])
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
def test_a_campaign_runs_them_on_two_workers(installed, tmp_path):
    """The workers are processes of their own, which find them by themselves; there is a bound; they do their job."""
    (tmp_path / "script.py").write_text(SCRIPT)
    done = python(installed, "script.py", str(EXAMPLE / "campaign.yaml"), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["failed"] == 0
    assert told["rms"]["cw_drag"] < 0.5 * told["rms"]["cw"]
    assert told["bounds"] == {"cw": True, "cw_drag": True}


@pytest.mark.slow
def test_the_command_line_knows_them(installed, tmp_path):
    code = (
        "import sys\n"
        "from typer.testing import CliRunner\n"
        "from relnav_sim.cli.app import app\n"
        f"campaign = {str(EXAMPLE / 'campaign.yaml')!r}\n"
        f"for words in (['list', 'dynamics'], ['show', 'dynamics', {NAME!r}], ['validate', campaign], ['schema']):\n"
        "    done = CliRunner().invoke(app, words, catch_exceptions=False)\n"
        "    assert done.exit_code == 0, done.output\n"
        "    print(done.output)\n"
    )
    done = python(installed, "-c", code, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert re.search(rf"^{NAME} +Clohessy-Wiltshire dynamics with a constant", done.stdout, re.MULTILINE)
    assert f"{NAME}: Clohessy-Wiltshire" in done.stdout and "along_track_m_s2" in done.stdout
    assert '"CwDragOptions"' in done.stdout  # in the schema


def test_a_broken_package_is_named_and_leaves_the_other_dynamics(tmp_path):
    """The example can be imported, but is unknown until it is installed."""
    head = (
        "from typing import ClassVar, Literal\n"
        "from relnav_sim import register_dynamics\n"
        "from relnav_sim.dynamics.options import DynamicsOptions\n"
    )
    bodies = {
        "breaks": "import no_such_module\n",
        "doubles": "@register_dynamics('cw')\nclass Another(DynamicsOptions):\n    kind: Literal['cw'] = 'cw'\n",
        "wants": "@register_dynamics('wants')\nclass Wants(DynamicsOptions):\n    kind: Literal['wants'] = 'wants'\n"
        "    needs: ClassVar = frozenset({'chief_fix'})\n",
    }
    for name, body in bodies.items():
        (tmp_path / f"{name}.py").write_text(head + body)
        distribution(tmp_path, f"package-{name}", "1.0", {name: name}, "relnav.dynamics")
    done = python(
        [tmp_path, EXAMPLE],
        "-c",
        "from relnav_sim.dynamics.registry import dynamics_kinds as k; print(k()['cw'].__name__, *k())",
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[0] == "CwOptions" and not {"wants", NAME} & set(done.stdout.split())
    assert re.search("the dynamics of package-breaks are left out.*no_such_module", done.stderr)
    assert re.search("package-doubles are left out.*dynamics named 'cw' are registered already", done.stderr)
    assert re.search("'wants' need 'chief_fix', which doesn't exist; there are chief_fixes, known_thrust", done.stderr)


def test_the_guide_shows_the_example_as_it_is():
    guide = (ROOT / "docs" / "add-a-dynamics.md").read_text(encoding="utf-8")
    module = (EXAMPLE / f"{MODULE}.py").read_text(encoding="utf-8")
    assert f"```python\n{module}```" in guide, "copy the module into docs/add-a-dynamics.md again"
