"""Filters: one algorithm a file, a registry, and the loop that runs them over recorded measurements."""
