"""What errors do to a filter's prediction: those of the chief's orbit as estimated, and of the thrust that is told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.budget.injection import SIZE
from relnav_sim.dynamics.context import Arrival, ChiefInFirstOrder
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.dynamics.known_thrust import KnownThrust

_NUDGES = np.repeat([10.0, 1e-2], 3)
"""Of the chief's state, m and m/s: relative motion is straight over that to a millionth."""


@dataclass(frozen=True)
class ChiefErrors:
    """The error c of the chief's orbit over a chunk of epochs: c_k = A_k c_{k-1} + G_k s_k.

    Attributes:
        transition: A, (K, 6, 6).
        response: G, (K, 6, J), columns as the injections.
        about: The dynamics about seven chiefs: as estimated, and off by one component each.
        first_epoch: Epoch of the first of them.
    """

    transition: Array
    response: Array
    about: Dynamics
    first_epoch: int

    def effect(self, before: Array, step: Step) -> Array:
        """Return B, what c_{k-1} does to the prediction of a state before, (6,), over a step, (6, 6)."""
        after = self.about.propagate(np.repeat(before[None], 7, axis=0), step)
        found: Array = (after[1:] - after[:1]).T / _NUDGES
        return found


class ChiefAlong:
    """The chief's orbit on its way along the nominal truth.

    Args:
        dynamics: Those of the filter.
    """

    def __init__(self, dynamics: Dynamics) -> None:
        self._dynamics = cast(ChiefInFirstOrder, dynamics)
        self._before: Array | None = None

    def errors(self, arrival: Arrival, fix_errors: Array) -> ChiefErrors | None:
        """Return the errors over the next chunk, before the dynamics are fed; None where dynamics do not tell.

        Args:
            arrival: What arrives when nothing errs, of one run.
            fix_errors: What the injections do to the fixes, (K, 6, J).
        """
        tell = getattr(self._dynamics, "linearised_chief", None)
        found = None if tell is None else tell(arrival)
        if found is None:
            return None
        estimates, A, G = found
        # The first step of a chunk begins at the last epoch of the one before.
        known = estimates if self._before is None else np.concatenate([self._before, estimates])
        self._before = estimates[-1:]
        chiefs = known + np.concatenate([np.zeros((1, 6)), np.diag(_NUDGES)])[:, None]
        first = arrival.first_epoch + len(estimates) - len(known)
        # Where there is no fix its error does nothing.
        response = G @ np.nan_to_num(fix_errors)
        return ChiefErrors(A, response, self._dynamics.with_chief(chiefs, first), arrival.first_epoch)


class ThrustAlong:
    """What errors of measured thrust do to a prediction, on the way along the nominal truth.

    Args:
        orbit: The chief's nominal orbit.
        step_s: Time between epochs, s.
    """

    def __init__(self, orbit: ChiefOrbit, step_s: float) -> None:
        self._linear = _Linear()
        self._told = KnownThrust(self._linear, orbit, step_s)

    def take(self, forces: Array, first_epoch: int) -> None:
        """Take the forces of the next steps, without error and with one each, (1 + J, K, 2, 2, 3)."""
        self._told.take(forces, first_epoch)

    def effect(self, before: Array, F: Array, step: Step) -> Array:
        """Return what the errors do to the prediction of a state before, (6,), by F (6, 6) over a step, (6, J)."""
        pushed = self._told.pushed(step)
        if not pushed.any():
            return np.zeros((6, len(pushed) - 1))
        self._linear.matrix = F
        after = self._told.propagate(np.repeat(before[None], len(pushed), axis=0), step)
        found: Array = (after[1:] - after[:1]).T / SIZE
        return found


class _Linear:
    """One step of linear motion: the kicks before and after it are all that is asked of `KnownThrust`."""

    dimension = 6
    linear = True
    matrix: Array

    def propagate(self, states: Array, step: Step) -> Array:
        """Return F x."""
        return np.asarray(states @ self.matrix.T)

    def transition(self, mean: Array, step: Step) -> Array:
        """Return F."""
        return self.matrix

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return none."""
        return np.zeros((6, 6))
