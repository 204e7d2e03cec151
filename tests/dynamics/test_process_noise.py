"""Process noise by axis and a correlated acceleration, against Van Loan's method and each other."""

import mpmath
import numpy as np
import pytest
from pydantic import ValidationError
from taking_turns import taking_turns

from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.correlated_acceleration import CorrelatedAcceleration
from relnav_sim.dynamics.process_noise import ProcessNoiseOptions, process_noise_matrix, van_loan

A = cw_system(1.1e-3)
EQUAL = {f"{axis}_psd_m2_s3": 3e-8 for axis in ("radial", "along_track", "normal")}


def exact(axis, tau_s, step_s):
    """Return F and Q of [x; a], sigma 1, by Van Loan's exponential in 60 digits.

    In double precision it has lost every digit where the step is a hundred correlation times.
    """
    with mpmath.workdps(60):
        system = mpmath.matrix(7)
        system[:6, :6] = mpmath.matrix(A.tolist())
        system[3 + axis, 6], system[6, 6] = 1, -1 / mpmath.mpf(tau_s)
        blocks = mpmath.matrix(14)
        blocks[:7, :7], blocks[7:, 7:] = -system * step_s, system.T * step_s
        blocks[6, 13] = 2 * step_s / mpmath.mpf(tau_s)
        whole = mpmath.expm(blocks, method="taylor")
        F = whole[7:, 7:].T
        return np.array(F.tolist(), dtype=float), np.array((F * whole[:7, 7:]).tolist(), dtype=float)


def test_equal_densities_are_white_acceleration_to_the_bit():
    white = process_noise_matrix(ProcessNoiseOptions(acceleration_psd_m2_s3=3e-8), A, 7.0)
    assert np.array_equal(white, process_noise_matrix(ProcessNoiseOptions(snc_rtn=EQUAL), A, 7.0))


def test_each_axis_has_its_own_density():
    densities = np.array([1e-9, 4e-8, 2e-10])
    names = ("radial_psd_m2_s3", "along_track_psd_m2_s3", "normal_psd_m2_s3")
    Q = process_noise_matrix(ProcessNoiseOptions(snc_rtn=dict(zip(names, densities, strict=True))), A, 7.0)
    acts = np.vstack([np.zeros((3, 3)), np.eye(3)])
    expected = sum(S * van_loan(A, acts[:, [axis]], np.eye(1), 7.0)[1] for axis, S in enumerate(densities))
    assert np.allclose(Q, expected, rtol=1e-12, atol=0)


@pytest.mark.parametrize("taus, step_s", taking_turns([(1e-4,), (0.3,), (1.9,), (2.1,), (30.0,)], [0.1, 10.0, 120.0]))
def test_a_correlated_acceleration_is_van_loans(taus, step_s):
    """At both sides of the change from power series to closed form; entries in units of the noise's own sigmas."""
    for axis in range(3):
        tau_s, sigma = step_s / taus, 2e-6
        end, Q = CorrelatedAcceleration(axis, sigma, tau_s).over_step(A, step_s)
        F, expected = exact(axis, tau_s, step_s)
        sigmas = np.sqrt(np.diagonal(expected))
        sigmas = np.where(sigmas > 0, sigmas, 1.0)
        assert np.abs((Q / sigma**2 - expected) / np.outer(sigmas, sigmas)).max() < 1e-12
        assert np.abs((end - F[:, 6]) / sigmas).max() < 1e-12 * np.abs(F[:, 6] / sigmas).max()
        assert np.array_equal(Q, Q.T)


def test_it_keeps_its_sigma():
    for tau_s in (0.01, 3.0, 1e4):
        end, Q = CorrelatedAcceleration(1, 5e-6, tau_s).over_step(A, 10.0)
        assert end[6] ** 2 * 25e-12 + Q[6, 6] == pytest.approx(25e-12, rel=1e-13)


def test_a_short_correlation_is_white_acceleration():
    """At S = 2 sigma^2 tau the difference is of first order in tau: ten times shorter, ten times less."""
    step_s, S = 10.0, 1e-9
    white = van_loan(A, np.eye(6)[:, [3]], np.array([[S]]), step_s)[1]
    sigmas = np.sqrt(np.where(np.diagonal(white) > 0, np.diagonal(white), 1.0))
    apart = []
    for tau_s in (1e-2, 1e-3, 1e-4, 1e-9):
        Q = CorrelatedAcceleration(0, np.sqrt(S / 2 / tau_s), tau_s).over_step(A, step_s)[1][:6, :6]
        apart.append(np.abs((Q - white) / np.outer(sigmas, sigmas)).max())
    assert apart[0] / apart[1] == pytest.approx(10, rel=0.01) and apart[1] / apart[2] == pytest.approx(10, rel=0.01)
    assert apart[3] < 1e-9


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, "exactly one of acceleration_psd_m2_s3, diagonal, matrix, snc_rtn, dmc and adaptive"),
        ({"acceleration_psd_m2_s3": 1e-9, "snc_rtn": EQUAL}, "exactly one of"),
        ({"snc_rtn": {**EQUAL, "radial_psd_m2_s3": -1.0}}, "greater than or equal to 0"),
        ({"adaptive": {"start": {**EQUAL, "normal_psd_m2_s3": 0.0}}}, "above 0 on each axis"),
    ],
)
def test_what_is_no_process_noise(options, words):
    with pytest.raises(ValidationError, match=words):
        ProcessNoiseOptions(**options)
