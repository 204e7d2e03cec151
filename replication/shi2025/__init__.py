"""Shi et al. (2025): the alpha-divergence Kalman filter."""
