"""Dynamics learned by a Gaussian process."""
