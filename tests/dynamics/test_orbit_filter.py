import numpy as np
import pytest
from scipy.stats import chi2

from relnav_sim.astro.constants import J2, J3, J4
from relnav_sim.dynamics.orbit_filter import OrbitFilter, OrbitFilterOptions

SIGMAS = np.repeat([30.0, 0.15], 3)
RUNS, EPOCHS, STEP = 40, 120, 10.0


@pytest.fixture
def fixes(scene):
    def make(forces=(J2,), zonals=2):
        s = scene(0.001, zonals=zonals)
        chief = s.truth(np.zeros((1, 6)), np.arange(EPOCHS) * STEP, forces)[0]
        noise = np.random.default_rng(5).normal(size=(RUNS, EPOCHS, 6)) * SIGMAS
        return s.orbit, chief, chief + noise

    return make


def orbit_filter(orbit, runs=RUNS, psd=None):
    return OrbitFilter(OrbitFilterOptions(acceleration_psd_m2_s3=psd), orbit, SIGMAS, STEP, runs)


@pytest.mark.parametrize("zonals", [2, 4])
def test_consistent_where_its_model_is_right(fixes, zonals):
    orbit, chief, z = fixes((J2, J3, J4)[: zonals - 1], zonals)
    filter = orbit_filter(orbit, psd=0.0)
    error = (filter.advance(z) - chief)[:, -1]
    nees = np.einsum("bi,bij,bj->b", error, np.linalg.inv(filter.covariance), error).sum()
    assert chi2.ppf(0.001, 6 * RUNS) < nees < chi2.ppf(0.999, 6 * RUNS)


def test_better_than_the_fixes_on_the_real_orbit(fixes):
    orbit, chief, z = fixes((J2, J3, J4))
    error = (orbit_filter(orbit).advance(z) - chief)[:, 60:]
    rms = np.sqrt(np.square(error).mean(axis=(0, 1)))
    assert (rms[:3] < 0.3 * 30).all()
    assert (rms[3:] < 0.2 * 0.15).all()


def test_higher_harmonics_make_it_better(fixes):
    """Without drag, both with their default process noise: a tenth to four tenths off each velocity in 20 minutes."""
    orbit, chief, z = fixes((J2, J3, J4), zonals=4)
    errors = [(orbit_filter(orbit.up_to(n)).advance(z) - chief)[:, 60:] for n in (2, 4)]
    without, with_them = (np.sqrt(np.square(error).mean(axis=(0, 1))) for error in errors)
    assert (with_them[3:] < 0.95 * without[3:]).all()
    assert (with_them < without).all()


def test_first_estimate_is_the_first_fix(fixes):
    orbit, _, z = fixes()
    np.testing.assert_allclose(orbit_filter(orbit).advance(z[:, :1]), z[:, :1], atol=1e-3)


def test_missing_fixes(fixes):
    orbit, chief, z = fixes()
    gaps = z.copy()
    gaps[1, 0] = np.nan
    gaps[2, 50:60, 3] = np.nan
    estimates = orbit_filter(orbit).advance(gaps)
    assert np.isfinite(estimates).all()
    assert np.abs(estimates - chief)[1, 1, :3].max() < 200
    whole = orbit_filter(orbit).advance(z)
    assert np.array_equal(estimates[0], whole[0])
    assert np.array_equal(estimates[2, :50], whole[2, :50])


def test_bits_do_not_depend_on_block_or_chunk(fixes):
    orbit, _, z = fixes()
    whole = orbit_filter(orbit).advance(z[:, :30])
    alone = orbit_filter(orbit, runs=1)
    parts = np.concatenate([alone.advance(z[7:8, :11]), alone.advance(z[7:8, 11:30])], axis=1)
    assert np.array_equal(parts[0], whole[7])


def test_it_tells_how_its_estimates_depend_on_fixes(fixes):
    """Small errors of all fixes, carried by A and G, against two runs of the filter; and it stays as it stands."""
    orbit, chief, z = fixes()
    truth = chief.reshape(-1, EPOCHS, 6)[:1, :40]
    perfect, wrong = truth.copy(), truth + 1e-2 * (z[:1, :40] - truth)
    wrong[:, 7:9] = perfect[:, 7:9] = np.nan
    one, other = orbit_filter(orbit, 1), orbit_filter(orbit, 1)
    first = one.linearised(perfect[:, :15])
    assert np.array_equal(one.advance(perfect[:, :15]), first[0][None])
    second = one.linearised(perfect[:, 15:])
    estimates, A, G = (np.concatenate(parts) for parts in zip(first, second, strict=True))
    moved, error = other.advance(wrong)[0] - estimates, np.zeros(6)
    assert not G[7:9].any()
    for k in range(40):
        error = A[k] @ error + G[k] @ np.nan_to_num(wrong - perfect)[0, k]
        assert (np.abs(moved[k] - error) < 2e-3 * np.abs(moved).max(axis=0)).all(), k
