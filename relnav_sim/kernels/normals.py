"""Standard normal numbers from uniform ones."""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import inlined, kernel, written
from relnav_sim.kernels.elementary import log

# (2 pi)^k / k! with the signs of sine and cosine.
_S1, _S3, _S5, _S7, _S9, _S11, _S13, _S15 = (
    (-1) ** (k // 2) * math.tau**k / math.factorial(k) for k in range(1, 17, 2)
)
_C2, _C4, _C6, _C8, _C10, _C12, _C14, _C16 = (
    (-1) ** (k // 2) * math.tau**k / math.factorial(k) for k in range(2, 18, 2)
)


@kernel(written(2), wide=True)
def box_muller(numbers: Array) -> None:
    """Replace numbers (runs, 2 p), uniform on [0, 1), by standard normal ones.

    With u from a run's first half and v from the same place of its second, sqrt(-2 log(1 - u)) times the cosine and
    times the sine of 2 pi (v - 1/2) (Box and Muller, Ann. Math. Statist. 29, 1958).
    """
    runs, count = numbers.shape
    pairs = count // 2
    for run in range(runs):
        for i in range(pairs):
            radius = math.sqrt(-2 * log(1 - numbers[run, i]))
            # A turn of the circle is exact in quarters, and what is left of it within an eighth.
            turn = numbers[run, pairs + i] - 0.5
            quarters = np.rint(4 * turn)
            s, c = _sine_and_cosine(turn - 0.25 * quarters)
            odd = abs(quarters) == 1
            sine, cosine = (c if odd else s), (s if odd else c)
            upper = -0.5 < quarters < 1.5
            right = -1.5 < quarters < 0.5
            numbers[run, i] = radius * (cosine if right else -cosine)
            numbers[run, pairs + i] = radius * (sine if upper else -sine)


@inlined
def _sine_and_cosine(turn: float) -> tuple[float, float]:
    """Return sine and cosine of 2 pi turn, |turn| <= 1/8, by their Taylor series."""
    z = turn * turn
    s = _S1 + z * (_S3 + z * (_S5 + z * (_S7 + z * (_S9 + z * (_S11 + z * (_S13 + z * _S15))))))
    c = 1 + z * (_C2 + z * (_C4 + z * (_C6 + z * (_C8 + z * (_C10 + z * (_C12 + z * (_C14 + z * _C16)))))))
    return turn * s, c
