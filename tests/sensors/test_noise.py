"""Noise kinds: their laws, and that a run's numbers depend on nothing but the run."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from relnav_sim.sensors.noise import (
    BiasNoise,
    GaussianNoise,
    GaussMarkovNoise,
    MixtureNoise,
    Noise,
    NoiseOption,
    OutageNoise,
    RampNoise,
    StepNoise,
    StuckNoise,
    WrongTargetNoise,
    check_parts,
    noise_kinds,
    white_law,
    white_variance,
)
from relnav_sim.streams import RandomSource

EXAMPLES = {
    "gaussian": GaussianNoise(scale=0.7),
    "mixture": MixtureNoise(scale=3.0, fraction="random", shared=False),
    "bias": BiasNoise(value=(0.1, -0.2, 0.3)),
    "gauss_markov": GaussMarkovNoise(tau_s=20.0, scale=0.5),
    "outage": OutageNoise(windows_s=((3.0, 5.0),), rate_per_hour=400.0, mean_duration_s=4.0),
    "step": StepNoise(from_s=3.0, until_s=9.0, value=(1.0, -2.0, 0.0)),
    "ramp": RampNoise(from_s=3.0, until_s=9.0, rate_per_s=0.5),
    "stuck": StuckNoise(from_s=3.0),
    "wrong_target": WrongTargetNoise(from_s=3.0, offset_m=(10.0, 0.0, 0.0)),
}


def sample(parts, runs=200, epochs=500, channels=3, step_s=0.2, seed=7, chunks=None):
    noise = Noise(parts, "radar", RandomSource(seed, tuple(range(runs))), channels, step_s)
    ends = np.cumsum(chunks or [epochs])
    times = np.arange(ends[-1]) * step_s
    return np.concatenate([noise.sample(part) for part in np.split(times, ends[:-1])], axis=1)


def close(measured, expected, spread, size, sigmas=5.0):
    """Whether the mean of `size` independent values with this standard deviation can be `expected`."""
    return abs(measured - expected) < sigmas * spread / np.sqrt(size)


def test_every_registered_kind_has_an_example():
    assert set(EXAMPLES) == set(noise_kinds())


@pytest.mark.parametrize("kind", EXAMPLES)
def test_bits_do_not_depend_on_chunks_or_block(kind):
    parts = [EXAMPLES[kind]]
    whole = sample(parts, runs=5, chunks=[300])
    assert np.array_equal(whole, sample(parts, runs=5, chunks=[1, 2, 97, 200]), equal_nan=True)
    for runs in ((3,), (4, 1)):
        noise = Noise(parts, "radar", RandomSource(7, runs), 3, 0.2)
        alone = noise.sample(np.arange(300) * 0.2)
        assert np.array_equal(alone, whole[list(runs)], equal_nan=True)


def test_gaussian_moments():
    v = sample([GaussianNoise(scale=2.0)])
    assert close(v.mean(), 0, 2, v.size)
    assert close(np.mean(v**2), 4, 4 * np.sqrt(2), v.size)
    assert close(np.mean(v[..., 0] * v[..., 1]), 0, 4, v[..., 0].size)


@pytest.mark.parametrize("fraction", [0.1, 0.5, "random"])
@pytest.mark.parametrize("shared", [True, False])
def test_mixture_moments(fraction, shared):
    f, s = (0.5 if fraction == "random" else fraction), 2.0
    v = sample([MixtureNoise(scale=s, fraction=fraction, shared=shared)])
    second, fourth, eighth = 1 - f + f * s**2, 3 * (1 - f + f * s**4), 105 * (1 - f + f * s**8)
    # Channels with one switch are dependent: count the epochs only.
    size = v[..., 0].size
    assert close(np.mean(v**2), second, np.sqrt(fourth - second**2), size)
    assert close(np.mean(v**4), fourth, np.sqrt(eighth - fourth**2), size)
    if f == 0.5:
        assert fourth / second**2 == pytest.approx(4.08)
    dependence = f * (1 - f) * (s**2 - 1) ** 2 if shared else 0.0
    product = v[..., 0] ** 2 * v[..., 1] ** 2
    assert close(product.mean(), second**2 + dependence, product.std(), size)


def test_fraction_per_run_is_uniform_over_runs_and_constant_in_a_run():
    runs, epochs = 2000, 400
    v = sample([MixtureNoise(scale=4.0, fraction="per_run")], runs=runs, epochs=epochs, channels=1)
    # E[v^2] = 1 + 15 f in a run with fraction f; f has mean 1/2 and variance 1/12.
    f = (np.mean(v[..., 0] ** 2, axis=1) - 1) / 15
    assert close(f.mean(), 0.5, f.std(), runs)
    within = np.var(v[..., 0] ** 2, axis=1).mean() / epochs / 15**2
    assert close(f.var() - within, 1 / 12, np.std((f - 0.5) ** 2), runs)


def test_mixture_and_gaussian_cases_differ_by_the_switch_only():
    narrow, mixed = sample([GaussianNoise()], runs=3), sample([MixtureNoise(scale=5.0, fraction=0.3)], runs=3)
    ratio = mixed / narrow
    wide = ratio > 3
    np.testing.assert_allclose(ratio, np.where(wide, 5.0, 1.0), rtol=1e-14)
    assert close(wide[..., 0].mean(), 0.3, np.sqrt(0.21), wide[..., 0].size)


def test_two_parts_of_a_kind_are_independent():
    one, two = sample([GaussianNoise()], runs=50), sample([GaussianNoise(), GaussianNoise()], runs=50)
    second = two - one
    assert close(np.mean(second**2), 1, np.sqrt(2), second.size)
    assert close(np.mean(second * one), 0, 1, second.size)


def test_bias_and_parts_add():
    base, shifted = sample([GaussianNoise()], runs=3), sample([GaussianNoise(), BiasNoise(value=0.5)], runs=3)
    np.testing.assert_array_equal(shifted, base + 0.5)
    np.testing.assert_array_equal(sample([BiasNoise(value=(1.0, 2.0, 3.0))], runs=2)[1, 4], [1, 2, 3])


def test_gauss_markov_autocorrelation_from_the_first_epoch():
    runs, tau, step, scale = 20000, 3.0, 0.5, 1.5
    v = sample([GaussMarkovNoise(tau_s=tau, scale=scale)], runs=runs, epochs=25, channels=1, step_s=step)[..., 0]
    for start in (0, 10):
        for lag in (0, 1, 4, 12):
            expected = scale**2 * np.exp(-lag * step / tau)
            product = v[:, start] * v[:, start + lag]
            assert close(product.mean(), expected, product.std(), runs)


def test_gauss_markov_averages_like_the_equivalent_white_noise():
    runs, tau, step, epochs = 3000, 2.0, 0.2, 500
    v = sample([GaussMarkovNoise(tau_s=tau)], runs=runs, epochs=epochs, channels=1, step_s=step)[..., 0]
    equivalent = 1 / np.tanh(step / (2 * tau))
    means = v.mean(axis=1)
    # The ends of the average cost a share tau / duration of it.
    assert abs(means.var() * epochs / equivalent - 1) < 5 * np.sqrt(2 / runs) + tau / (epochs * step)
    assert equivalent == pytest.approx(2 * tau / step, rel=1e-2)


def test_outage_windows_are_half_open():
    v = sample([GaussianNoise(), OutageNoise(windows_s=((1.0, 2.0), (4.0, 4.2)))], runs=2, epochs=50)
    out = np.isnan(v).all(axis=-1)
    assert np.array_equal(out, np.isnan(v).any(axis=-1))
    assert np.flatnonzero(out[0]).tolist() == [5, 6, 7, 8, 9, 20]
    assert np.array_equal(out[0], out[1])


def test_random_outages_have_the_stated_rate_and_length():
    runs, epochs, step, mean_working, mean_out = 400, 4000, 1.0, 60.0, 20.0
    part = OutageNoise(rate_per_hour=3600 / mean_working, mean_duration_s=mean_out)
    out = np.isnan(sample([part], runs=runs, epochs=epochs, channels=1, step_s=step)[..., 0])
    assert not out[:, 0].any()
    settled = out[:, 500:]
    assert close(settled.mean(), mean_out / (mean_working + mean_out), settled.mean(axis=1).std(), runs)
    starts = (out[:, 1:] & ~out[:, :-1]).sum()
    # Outages that fit between two epochs are not seen: a share of about step / mean_out of them, halved by chance.
    length = out.sum() / starts
    assert abs(length - mean_out) < 5 * mean_out / np.sqrt(starts) + step
    cycles = runs * epochs * step / (mean_working + mean_out)
    assert abs(starts / cycles - 1) < 5 / np.sqrt(cycles) + step / mean_out


def test_law_is_the_law_of_the_samples():
    parts = [GaussianNoise(scale=0.6), MixtureNoise(scale=3.0, fraction=0.2, shared=False), BiasNoise(value=0.0)]
    law = white_law(parts, 3)
    assert law.weights.sum() == pytest.approx(1)
    assert len(law.weights) == 8
    variance = law.weights @ law.scales**2
    np.testing.assert_allclose(variance, white_variance(parts))
    v = sample(parts)
    assert close(np.mean(v**2), white_variance(parts), np.std(v**2), v.size)
    np.testing.assert_allclose(law.nominal, np.sqrt(1.36))
    joint = np.prod(law.scales**2, axis=1) @ law.weights
    product = np.prod(v**2, axis=-1)
    assert close(product.mean(), joint, product.std(), product.size)


@pytest.mark.parametrize(("fraction", "components"), [(0.0, 1), (1.0, 1), (0.3, 2), ("random", 2), ("per_run", 2)])
def test_law_keeps_what_can_happen(fraction, components):
    law = white_law([MixtureNoise(scale=3.0, fraction=fraction)], 3)
    assert len(law.weights) == components
    np.testing.assert_array_equal(law.nominal, 1)
    if fraction == 1.0:
        np.testing.assert_array_equal(law.scales, 3)


def test_option_takes_one_part_or_a_list():
    option = TypeAdapter(NoiseOption)
    assert option.validate_json('{"kind": "gaussian"}') == GaussianNoise()
    parts = option.validate_json('[{"kind": "gaussian"}, {"kind": "outage", "windows_s": [[1, 2]]}]')
    assert parts == (GaussianNoise(), OutageNoise(windows_s=((1.0, 2.0),)))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"kind": "mixture", "scale": 0, "fraction": 0.5}', "greater than 0"),
        ('{"kind": "mixture", "scale": 2, "fraction": 1.5}', "less than or equal to 1"),
        ('{"kind": "gauss_markov", "tau_s": -1}', "greater than 0"),
        ('{"kind": "outage"}', "windows_s, or rate_per_hour"),
        ('{"kind": "outage", "rate_per_hour": 2}', "both rate_per_hour and mean_duration_s"),
        ('{"kind": "outage", "windows_s": [[5, 4]]}', "must end after it starts"),
        ('{"kind": "glint"}', "does not match any"),
    ],
)
def test_bad_parts_are_refused(text, says):
    with pytest.raises(ValidationError, match=says):
        TypeAdapter(NoiseOption).validate_json(text)


def test_parts_must_fit_the_sensor():
    with pytest.raises(ValueError, match="one mixture"):
        check_parts([MixtureNoise(scale=2.0, fraction=0.5)] * 2, 3)
    with pytest.raises(ValueError, match="2 values; this sensor has 3"):
        check_parts([BiasNoise(value=(1.0, 2.0))], 3)
