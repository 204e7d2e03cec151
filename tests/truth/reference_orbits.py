"""Orbits and force models that the tests of the truth share."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from relnav_sim.astro.orbits import Elements, state_from_elements
from relnav_sim.truth import ExponentialAtmosphere, ForceModel

REFERENCE = json.loads((Path(__file__).parents[1] / "reference" / "orbits_one_day.json").read_text())
CASES = {case["name"]: case for case in REFERENCE["cases"]}
MU = REFERENCE["constants"]["mu_m3_s2"]
RADIUS = REFERENCE["constants"]["radius_m"]
ZONALS = tuple(REFERENCE["constants"]["zonals"])


def force(zonals=4, drag=True):
    """Return the force model of the reference orbits with zonal harmonics up to a degree."""
    atmosphere = ExponentialAtmosphere(**REFERENCE["constants"]["atmosphere"]) if drag else None
    return ForceModel(MU, RADIUS, ZONALS[: max(zonals - 1, 0)], atmosphere, REFERENCE["constants"]["rotation_rad_s"])


def orbit(a=6.9e6, e=0.0, i=0.9, raan=0.4, argp=0.7, nu=0.3):
    """Return an ECI state (6,)."""
    return state_from_elements(Elements(a, e, i, raan, argp, nu), MU)


def dispersed(count, seed=0, spread=1.0, **elements):
    """Return ECI states (count, 6) within some km of an orbit."""
    offsets = np.random.default_rng(seed).normal(size=(count, 6)) * np.repeat([1000.0, 1.0], 3) * spread
    return orbit(**elements) + offsets


@pytest.fixture(scope="session")
def orbits():
    return SimpleNamespace(
        reference=REFERENCE,
        cases=CASES,
        mu=MU,
        radius=RADIUS,
        zonals=ZONALS,
        force=force,
        orbit=orbit,
        dispersed=dispersed,
    )


def pytest_generate_tests(metafunc):
    if "reference_case" in metafunc.fixturenames:
        metafunc.parametrize("reference_case", CASES.values(), ids=CASES.keys())
