"""Fixtures of tests/truth/reference_orbits.py."""

from reference_orbits import orbits, pytest_generate_tests

__all__ = ["orbits", "pytest_generate_tests"]
