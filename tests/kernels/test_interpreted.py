"""Kernels as the plain Python that they are, for what is asked of them without a compiler."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
LOADED = "print('loaded', sorted({'numba', 'llvmlite'} & set(sys.modules)))\n"


def last_line(program, *arguments):
    done = subprocess.run([sys.executable, "-c", program, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1]


SHIPPED = sorted(path.stem for path in CAMPAIGNS.glob("*.yaml"))
SOME = ["demo"]


@pytest.mark.parametrize("names", [SOME, pytest.param(SHIPPED, marks=pytest.mark.slow)], ids=["some", "all"])
def test_campaigns_are_validated_without_the_compiler(names):
    program = (
        "import sys\n"
        "from relnav_sim.cli.app import app\n"
        "for path in sys.argv[1:]:\n"
        "    try: app(['validate', path])\n"
        "    except SystemExit as end: assert not end.code, path\n"
    )
    assert last_line(program + LOADED, *(CAMPAIGNS / f"{name}.yaml" for name in names)) == "loaded []"


AGREE = """
import json, sys
import numpy as np
from relnav_sim import load_campaign
from relnav_sim.crlb.case_observability import case_observability
from relnav_sim.kernels.compiling import interpreted
from relnav_sim.streams import RandomSource
from relnav_sim.truth import nominal_truth, truth_trajectory

def answers(config):
    truth = truth_trajectory(nominal_truth(config.truth), config.clock.duration_s, RandomSource(0, (0,)))
    states = truth.at(np.linspace(0, config.clock.duration_s, 50))
    found = case_observability(config)
    return [states.chief, states.deputy, *(each.ratio for each in found.values())]

config = load_campaign(sys.argv[1], sys.argv[2:]).cases[-1].config
with interpreted():
    plain = answers(config)
assert "numba" not in sys.modules
compiled = answers(config)
assert "numba" in sys.modules
print(json.dumps([np.abs(p - c).max() / np.abs(c).max() for p, c in zip(plain, compiled, strict=True)]))
"""


PAST_THE_BURN = ("clock.duration_s=2000", "statistics.settle_s=1500")
WHOLE = ("angles_only", "crosslink", "gnss_to_radar", "rendezvous")


@pytest.mark.parametrize(
    "name, changes",
    [("angles_only", PAST_THE_BURN), *(pytest.param(name, (), marks=pytest.mark.slow) for name in WHOLE)],
)
def test_plain_python_agrees_with_compiled_code(name, changes):
    chief, deputy, *ratios = json.loads(last_line(AGREE, CAMPAIGNS / f"{name}.yaml", *changes))
    # Steps are the same where an error estimate is not within its rounding of the tolerance.
    assert max(chief, deputy) < 1e-9
    assert ratios and max(ratios) < 1e-7


FAILS = """
import sys
import numpy as np
from relnav_sim import kernels
from relnav_sim.kernels.compiling import interpreted
with interpreted():
    L = kernels.roots.cholesky(-np.eye(2)[None])[0]
print(np.isnan(L).any(), 'numba' in sys.modules)
"""


def test_what_python_refuses_is_compiled_after_all():
    assert last_line(FAILS) == "True True"


IN_A_FIELD = """
import sys
import numpy as np
from relnav_sim import ForceModel, GravityField, propagate
from relnav_sim.kernels.compiling import interpreted

field = GravityField.load("ggm05s", 20, 20)
force = ForceModel(
    field.mu_m3_s2, field.radius_m, (), gravity=field, epoch="2010-07-27T00:00:00 GPS", third_bodies=("sun", "moon"),
    radiation=True,
)
state, times = [[6.85e6, 0.0, 0.0, 0.0, 1e3, 7.55e3]], [0.0, 300.0]
with interpreted():
    plain = propagate(state, times, force, radiation_m2_kg=0.02)
assert "numba" not in sys.modules
compiled = propagate(state, times, force, radiation_m2_kg=0.02)
assert "numba" in sys.modules
print(np.abs(plain - compiled)[..., :3].max())
"""


def test_orbits_in_a_field_agree():
    assert float(last_line(IN_A_FIELD)) < 1e-7
