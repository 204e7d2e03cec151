"""The names that other people's code imports, and what it costs to import them."""

import inspect
import subprocess
import sys

import pytest

import relnav_sim

SIGNATURES = {
    "load_campaign": ["path"],
    "run_campaign": ["campaign", "out", "workers", "backend"],
    "open_results": ["path"],
    "propagate": ["state0", "times_s", "force", "ballistic_m2_kg", "rtol"],
    "ForceModel": ["mu_m3_s2", "radius_m", "zonals", "atmosphere", "rotation_rad_s"],
    "ExponentialAtmosphere": ["base_altitude_m", "density_kg_m3", "scale_height_m"],
    "rtn_from_eci": ["chief", "deputy", "normal_acceleration_m_s2"],
    "eci_from_rtn": ["chief", "relative", "normal_acceleration_m_s2"],
    "eci_from_itrf": ["states", "times_s", "epoch"],
    "itrf_from_eci": ["states", "times_s", "epoch"],
    "simulate": ["campaign", "case", "runs"],
    "error_budget": ["campaign", "case", "filter"],
    "create_filter": ["name", "dynamics", "measurement"],
    "LinearDynamics": ["transition", "process_noise"],
    "LinearMeasurement": ["matrix", "noise"],
    "FunctionMeasurement": ["predict", "noise", "jacobian", "angles"],
    "MixtureNoise": ["weights", "covariances", "shared"],
    "run_filter": ["filter", "z", "mean0", "cov0", "seed", "runs"],
    "register_filter": ["name", "options_model"],
    "register_dynamics": ["name", "options_model"],
    "smooth": ["history", "dynamics", "step_s"],
    "fit_gp_dynamics": ["now", "next", "step_s", "base", "target"],
}


@pytest.mark.parametrize("name", relnav_sim.__all__)
def test_every_public_name_is_there_and_documented(name):
    assert inspect.getdoc(getattr(relnav_sim, name)), f"{name} has no docstring"


@pytest.mark.parametrize("name, parameters", SIGNATURES.items())
def test_parameters_keep_their_names_and_order(name, parameters):
    signature = inspect.signature(getattr(relnav_sim, name))
    assert list(signature.parameters)[: len(parameters)] == parameters


def test_importing_the_package_loads_nothing_heavy():
    code = (
        "import sys, relnav_sim; "
        "heavy = ('numpy', 'scipy', 'h5py', 'matplotlib', 'sklearn', 'joblib', 'pydantic', 'numba', 'distributed'); "
        "print([name for name in heavy if name in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_a_wrong_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = relnav_sim.no_such_name
