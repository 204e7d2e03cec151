"""What the chief does step by step, as a filter knows it: from its own GNSS fixes, or by the nominal orbit."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.kepler import initial_state
from relnav_sim.conventions import CHUNK_EPOCHS
from relnav_sim.dynamics.by_epoch import PerChunk
from relnav_sim.dynamics.motion import Motion, ZonalMotion
from relnav_sim.dynamics.orbit_filter import OrbitFilter
from relnav_sim.dynamics.relative_flow import Legs, Segment
from relnav_sim.kernels.compiling import working_cpu_s

TOGETHER = 1024
"""States whose segments are computed together: few enough for the cache."""


class ChiefSegments:
    """The segments that begin at the chief's states at some epochs; computed when first asked for, several at a time.

    Args:
        chief: The states, ECI, (runs, K, 6), m and m/s. The step to epoch k takes that of k - 1.
        first_epoch: Epoch of the first of them.
        motion: How the chief moves.

    Attributes:
        cpu_s: CPU time spent on them so far, s.
    """

    def __init__(self, chief: Array, first_epoch: int, motion: Motion) -> None:
        self.cpu_s = 0.0
        self._chief, self._first_epoch = chief, first_epoch
        self._motion = motion
        self._together = max(TOGETHER // max(len(chief), 1), 1)
        self._stacks: dict[int, Legs] = {}

    def segment(self, epoch: int) -> Segment:
        """Return the segment of the step that ends at an epoch."""
        place = epoch - 1 - self._first_epoch
        if not 0 <= place < self._chief.shape[1]:
            last = self._first_epoch + self._chief.shape[1] - 1
            raise ValueError(
                f"the step to epoch {epoch} needs the chief's state at epoch {epoch - 1}; "
                f"there are those of epochs {self._first_epoch} to {last}"
            )
        stack, within = divmod(place, self._together)
        if stack not in self._stacks:
            begin = working_cpu_s()
            first = stack * self._together
            states = self._chief[:, first : first + self._together]
            self._stacks[stack] = self._motion.legs(states, self._first_epoch + first)
            self.cpu_s += working_cpu_s() - begin
        return self._stacks[stack], within


class ChiefFollower:
    """The chief's orbit as one filter estimates it, a chunk of epochs at a time.

    Dynamics that see the same fixes and believe the same share one.

    Args:
        filter: Estimates the chief's orbit; fresh.
        motion: How the chief moves.
    """

    def __init__(self, filter: OrbitFilter, motion: Motion) -> None:
        self._filter, self._motion = filter, motion
        self._before: Array | None = None
        self._segments: ChiefSegments | None = None
        self._past_cpu_s = 0.0
        self._next_epoch = 0

    @property
    def cpu_s(self) -> float:
        """CPU time spent on the orbit so far, s, whichever of the dynamics asked first: what one alone would need."""
        return self._past_cpu_s + (0.0 if self._segments is None else self._segments.cpu_s)

    def take(self, fixes: Array, first_epoch: int, forces: Array | None = None) -> ChiefSegments:
        """Return what the chief does in the next chunk of steps.

        A chunk that is already taken is not filtered again, so each user of the follower may hand it on.

        Args:
            fixes: The chief's GNSS fixes, (runs, K, 6), ECI, NaN = none; the first of all is at epoch 0.
            first_epoch: Epoch of the first of them.
            forces: Known thrust of the chief in the steps that end there, as `OrbitFilter.advance` has it.
        """
        if self._segments is not None and first_epoch < self._next_epoch:
            return self._segments
        begin = working_cpu_s()
        self._next_epoch = first_epoch + fixes.shape[1]
        estimates = self._filter.advance(fixes, forces)
        # The first step of a chunk begins at the last epoch of the one before.
        known = estimates if self._before is None else np.concatenate([self._before, estimates], axis=1)
        self._before = estimates[:, -1:]
        self._past_cpu_s = self.cpu_s + working_cpu_s() - begin
        self._segments = ChiefSegments(known, self._next_epoch - known.shape[1], self._motion)
        return self._segments

    def linearised(self, fixes: Array, forces: Array | None = None) -> tuple[Array, Array, Array]:
        """Return what the next chunk's estimates are and depend on, see `OrbitFilter.linearised`; nothing is taken."""
        return self._filter.linearised(fixes, forces)


class NominalChief:
    """The nominal orbit by the gravity that a filter believes in, epoch by epoch: what it knows without any fix.

    Args:
        orbit: The nominal orbit; epoch 0 is its own.
        step_s: Time between epochs, s.
        motion: How the chief moves; default: under the zonal harmonics of the orbit's body.

    Attributes:
        cpu_s: CPU time spent on chunks of it so far, s.
    """

    def __init__(self, orbit: ChiefOrbit, step_s: float, motion: Motion | None = None) -> None:
        self.cpu_s = 0.0
        self._motion = motion or ZonalMotion(orbit, step_s)
        self._chunks = PerChunk(self._segments)
        self._starts = [initial_state(orbit)]

    def at(self, epoch: int) -> Array:
        """Return the state at an epoch from 0 on; at -1 it is one step before, ECI, (1, 6)."""
        if epoch < 0:
            return self._motion.walk(self._starts[0], 0, -1)[1:]
        (states, _), place = self._chunks.at(epoch)
        return states[place]

    def segment(self, epoch: int) -> Segment:
        """Return the segment of the step that ends at an epoch, from 0 on."""
        if epoch < 1:
            return self._motion.legs(self.at(epoch - 1)[None], epoch - 1), 0
        (_, legs), place = self._chunks.at(epoch - 1)
        return legs, place

    def _segments(self, epochs: Array) -> tuple[Array, Legs]:
        """Return the states of a chunk, (CHUNK_EPOCHS, 1, 6), and the legs that begin there."""
        begin = working_cpu_s()
        chunk = int(epochs[0]) // CHUNK_EPOCHS
        while len(self._starts) <= chunk:
            known = len(self._starts) - 1
            self._starts.append(self._motion.walk(self._starts[-1], known * CHUNK_EPOCHS, CHUNK_EPOCHS)[-1])
        states = self._motion.walk(self._starts[chunk], chunk * CHUNK_EPOCHS, CHUNK_EPOCHS - 1)
        legs = self._motion.legs(states[None], chunk * CHUNK_EPOCHS)
        self.cpu_s += working_cpu_s() - begin
        return states[:, None], legs
