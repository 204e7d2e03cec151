"""What packages written for relnav 0.1 import still works, and says that it goes."""

import importlib
import sys

import pytest

import relnav_sim

FORMER = {
    "dynamics": {
        "relnav_sim.dynamics.interface": ["Dynamics", "LinearDynamics", "Step"],
    },
    "measurement": {
        "relnav_sim.measurements.function": ["FunctionMeasurement"],
        "relnav_sim.measurements.given_noise": ["MixtureNoise"],
        "relnav_sim.measurements.interface": ["Measurement", "MeasurementDefaults", "Mixture"],
        "relnav_sim.measurements.linear": ["LinearMeasurement"],
    },
}


@pytest.mark.parametrize("name", FORMER)
def test_a_former_module_gives_the_same_objects_and_warns(monkeypatch, name):
    # As in a process that has not imported it yet.
    monkeypatch.delattr(relnav_sim, "models", raising=False)
    for known in [known for known in sys.modules if known.split(".")[:2] == ["relnav_sim", "models"]]:
        monkeypatch.delitem(sys.modules, known)
    with pytest.warns(DeprecationWarning, match=r"relnav_sim\.models goes with relnav 0\.3"):
        former = importlib.import_module(f"relnav_sim.models.{name}")
    for home, exported in FORMER[name].items():
        for each in exported:
            assert getattr(former, each) is getattr(importlib.import_module(home), each)
