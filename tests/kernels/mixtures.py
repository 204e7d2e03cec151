"""Gaussian mixtures, and their moments in NumPy."""

import numpy as np
from checks import covariances


def mixture(rng, runs, c, n):
    w = rng.uniform(0.1, 1, size=(runs, c))
    return w / w.sum(axis=1, keepdims=True), rng.normal(size=(runs, c, n)), covariances(rng, runs, c, n)


def plain_moments(w, x, P):
    mean = np.einsum("c,cn->n", w, x)
    return mean, sum(one * (p + np.outer(a - mean, a - mean)) for one, a, p in zip(w, x, P, strict=True))
