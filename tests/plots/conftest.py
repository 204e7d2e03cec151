"""Fixtures of tests/report/invented_results.py."""

from invented_results import invent, make_result

__all__ = ["invent", "make_result"]
