"""Dispersions: moments within bounds from the number of draws, support, and streams."""

import numpy as np
import pytest

from relnav_sim.streams import RandomSource
from relnav_sim.truth import distributions as d

RUNS = 4000
STREAMS = RandomSource(7, tuple(range(RUNS)))


def draws(dispersion, name="truth.test"):
    return dispersion.draw(STREAMS.streams(name))


def check_moments(sample, mean, sigma, kurtosis=3.0):
    """Mean and standard deviation within 4.5 of their own standard errors."""
    assert np.abs(sample.mean(0) - mean).max() < 4.5 * np.max(sigma) / np.sqrt(RUNS)
    error = np.sqrt((kurtosis - 1) / 4 / RUNS)
    assert np.abs(sample.std(0) / sigma - 1).max() < 4.5 * error


@pytest.mark.parametrize(
    ("dispersion", "sigma", "kurtosis"),
    [
        (d.NormalPosition(kind="normal", sigma_m=(10.0, 20.0, 30.0)), np.array([10, 20, 30]), 3.0),
        (d.NormalVelocity(kind="normal", sigma_m_s=(0.1, 0.2, 0.3)), np.array([0.1, 0.2, 0.3]), 3.0),
        (d.UniformPosition(kind="uniform", half_width_m=(3.0, 6.0, 9.0)), np.array([3, 6, 9]) / np.sqrt(3), 1.8),
        (d.UniformVelocity(kind="uniform", half_width_m_s=(3.0, 6.0, 9.0)), np.array([3, 6, 9]) / np.sqrt(3), 1.8),
    ],
)
def test_offsets(dispersion, sigma, kurtosis):
    sample = draws(dispersion)
    assert sample.shape == (RUNS, 3)
    check_moments(sample, 0.0, sigma, kurtosis)
    correlation = np.corrcoef(sample.T) - np.eye(3)
    assert np.abs(correlation).max() < 4.5 / np.sqrt(RUNS)


def test_factors():
    normal = draws(d.NormalFactor(kind="normal", sigma=0.2))
    check_moments(normal, 1.0, 0.2)
    assert (normal >= 0).all()
    uniform = draws(d.UniformFactor(kind="uniform", half_width=0.3))
    check_moments(uniform, 1.0, 0.3 / np.sqrt(3), 1.8)
    assert (np.abs(uniform - 1) <= 0.3).all()
    lognormal = draws(d.LognormalFactor(kind="lognormal", sigma=0.5))
    check_moments(np.log(lognormal), 0.0, 0.5)


def test_one_number_means_three_and_zero_fixes_an_axis():
    one = d.NormalPosition.model_validate_json('{"kind": "normal", "sigma_m": 5}')
    three = d.NormalPosition.model_validate_json('{"kind": "normal", "sigma_m": [5, 5, 5]}')
    assert one == three
    fixed = draws(d.NormalPosition(kind="normal", sigma_m=(5.0, 0.0, 0.0)))
    assert (fixed[:, 1:] == 0).all() and (fixed[:, 0] != 0).all()


@pytest.mark.parametrize(
    ("model", "text", "sentence"),
    [
        (d.NormalPosition, '{"kind": "normal", "sigma_m": 0}', "at least one axis must vary"),
        (d.NormalPosition, '{"kind": "normal", "sigma_m": [1, -1, 1]}', "greater than or equal to 0"),
        (d.UniformVelocity, '{"kind": "uniform", "half_width_m_s": -1}', "greater than or equal to 0"),
        (d.NormalFactor, '{"kind": "normal", "sigma": 0}', "greater than 0"),
        (d.NormalFactor, '{"kind": "normal", "sigma": 0.5}', "less than or equal to 0.2"),
        (d.UniformFactor, '{"kind": "uniform", "half_width": 1.5}', "less than or equal to 1"),
        (d.LognormalFactor, '{"kind": "lognormal", "sigma": -1}', "greater than 0"),
    ],
)
def test_bad_spreads_are_refused(model, text, sentence):
    with pytest.raises(ValueError, match=sentence):
        model.model_validate_json(text)
