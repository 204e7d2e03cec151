"""Bins read off the bits, and quantiles from their counts."""

import numpy as np

from relnav_sim.statistics.quantiles import BINS, bin_edges, bin_of, quantiles


def bin_counts(values: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Return how many of the values (quantities, runs, epochs) fall into each bin, (quantities, runs, BINS)."""
    return np.array(
        [[np.bincount(bin_of(x[c]), minlength=BINS) for x, c in zip(rows, counted, strict=True)] for rows in values]
    )


def test_bins_follow_their_edges() -> None:
    edges = bin_edges()
    assert len(edges) == BINS + 1 and (np.diff(edges) > 0).all()
    width = np.diff(edges[1:]) / edges[1:-1]
    assert width.max() <= 1 / 32 and width.min() > 1 / 64
    np.testing.assert_array_equal(bin_of(edges[:-1]), np.arange(BINS))
    np.testing.assert_array_equal(bin_of(np.nextafter(edges[1:], 0)), np.arange(BINS))
    assert bin_of(np.array([0.0, 5e-324, np.inf, 1e300])).tolist() == [0, 0, BINS - 1, BINS - 1]


def test_quantiles_are_right_to_a_bin() -> None:
    rng = np.random.default_rng(2)
    values = np.abs(rng.standard_cauchy((2, 3, 4000)))
    counted = rng.random((3, 4000)) < 0.7
    counted[2] = False
    counts = bin_counts(values, counted)
    np.testing.assert_array_equal(counts.sum(axis=-1), [counted.sum(axis=1)] * 2)
    levels = (0.0, 0.5, 0.9, 0.99, 1.0)
    found = quantiles(counts, levels, np.where(counted, values, 0).max(axis=-1))
    for q in range(2):
        for run in range(2):
            plain = np.quantile(values[q, run][counted[run]], levels, method="inverted_cdf")
            assert (np.abs(found[q, run] / plain - 1) < 1 / 32).all()
    assert np.isnan(found[:, 2]).all()


def test_one_value() -> None:
    counts = bin_counts(np.full((1, 1, 1), 3.0), np.ones((1, 1), dtype=bool))
    assert (quantiles(counts, (0.5, 0.99), np.array([[3.0]])) <= 3.0).all()
