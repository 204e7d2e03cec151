"""The formation of Wei, Song and Zhang (2012) under J2, and dynamics learned from it."""

from __future__ import annotations

from functools import cache

import numpy as np

from relnav_sim import ForceModel, LinearDynamics, eci_from_rtn, propagate, rtn_from_eci
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from relnav_sim.dynamics.gp.fit import Transitions, fit_gp_dynamics

MU = 398600.4e9
ORBIT = ChiefOrbit(7e6, 0.0, np.pi / 6, np.pi / 4, np.pi / 6, 0.0, MU, 6378137.0, 1.08263e-3)
N = ORBIT.mean_motion_rad_s
STEP_S = 10.0
STEPS_PER_REVOLUTION = 583
START = np.array([300.0, -0.4 / N, -400.0, -0.2, -600.0 * N, 0.1])
F = cw_transition(N, STEP_S)
CW = LinearDynamics(F, np.zeros((6, 6)))


@cache
def flight(in_plane=1.0, out_of_plane=1.0, steps=3 * STEPS_PER_REVOLUTION):
    """Return true relative states (steps + 1, 6), RTN, one every 10 s; factors scale the ellipse."""
    force = ForceModel(MU, ORBIT.equatorial_radius_m, zonals=(ORBIT.j2,))
    node, turn = ORBIT.raan_rad, ORBIT.argument_of_perigee_rad
    tilt, radius = ORBIT.inclination_rad, ORBIT.semi_major_axis_m
    ahead = np.array([np.cos(node), np.sin(node), 0.0])
    side = np.array([-np.sin(node) * np.cos(tilt), np.cos(node) * np.cos(tilt), np.sin(tilt)])
    up, along = np.cos(turn) * ahead + np.sin(turn) * side, np.cos(turn) * side - np.sin(turn) * ahead
    chief = np.concatenate([radius * up, np.sqrt(MU / radius) * along])[None]
    scale = np.array([in_plane, in_plane, out_of_plane] * 2)
    deputy = eci_from_rtn(chief, START * scale, force.normal_acceleration(chief))
    states = propagate(np.concatenate([chief, deputy]), STEP_S * np.arange(steps + 1), force)
    return rtn_from_eci(states[0], states[1], force.normal_acceleration(states[0]))


def training_rows(selection):
    """Return 500 steps: the first ones, or random ones of the first revolution."""
    if selection == "consecutive":
        return np.arange(500)
    return np.sort(np.random.default_rng(0).choice(STEPS_PER_REVOLUTION - 1, 500, replace=False))


@cache
def learned(target="residual", selection="random", variance="exact", calibrate=False):
    """Return dynamics learned from the first revolution, calibrated on the second if asked for."""
    x, rows = flight(), training_rows(selection)
    base = CW if target == "residual" else None
    second = slice(STEPS_PER_REVOLUTION, 2 * STEPS_PER_REVOLUTION)
    held_out = Transitions(x[:-1][second], x[1:][second]) if calibrate else None
    return fit_gp_dynamics(x[rows], x[rows + 1], STEP_S, base, target, variance=variance, held_out=held_out, restarts=0)


def position_and_velocity_rms(error):
    """Return the RMS of position and velocity errors (..., 6), both vectors."""
    squares = np.square(error)
    return np.sqrt(squares[..., :3].sum(axis=-1).mean()), np.sqrt(squares[..., 3:].sum(axis=-1).mean())
