"""Elementary functions that vectorise: without branches and calls, so that a loop over lanes serves several at once.

Each takes and returns one number. Argument reduction and compensation follow Cody and Waite, Software Manual for the
Elementary Functions, 1980, and Muller, Elementary Functions: Algorithms and Implementation, 3rd ed., 2016; the
polynomials are minimax by Remez's algorithm, relative to the function. Errors stay below one unit in the last place.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import intrinsic

from relnav_sim.kernels.compiling import inlined

_QUARTER_PI = math.pi / 4
_QUARTER_PI_REST = 3.061616997868383e-17
"""What pi / 4 is above its double."""
_TAN_EIGHTH_PI = 0.41421356237309503
_HUGE, _TINY, _SCALE = 2.0**1000, 2.0**-900, 2.0**100


def _fused(typing: Any, a: Any, b: Any, c: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), code


fused: Callable[[float, float, float], float] = intrinsic(_fused)  # type: ignore[assignment]  # as kernels see it
"""``fused(a, b, c)`` -> a b + c with one rounding, as IEEE 754 defines it: the same bits on every machine."""


@inlined
def atan2(y: float, x: float) -> float:
    """Return the angle of the point (x, y), in [-pi, pi]; special values as in C99.

    |angle| = j pi/4 +- atan t, |t| <= tan pi/8, with t as a quotient and its error.
    """
    along, across = abs(x), abs(y)
    steep = across > along
    large = across if steep else along
    small = along if steep else across
    infinite = large == math.inf
    finite_or_one = 1.0 if small == math.inf else small * 0.0
    small = finite_or_one if infinite else small
    large = 1.0 if infinite else large
    # Keep 1 / large and the quotient's error out of the subnormal numbers.
    scale = 1.0 / _SCALE if large > _HUGE else (_SCALE if large < _TINY else 1.0)
    small *= scale
    large = 1.0 if large == 0.0 else large * scale
    turned = small > _TAN_EIGHTH_PI * large
    above = small - large if turned else small
    below = large + small if turned else large
    # a - b and a + b are rounded themselves; what they lose (Knuth's two-sum with |b| >= |a|) belongs to the quotient.
    above_rest = small - (above + large) if turned else 0.0
    below_rest = small - (below - large) if turned else 0.0
    inverse = 1.0 / below
    t = above * inverse
    rest = (fused(-t, below, above) + above_rest - t * below_rest) * inverse
    s = t * t
    p = -0.01790352784851203
    p = fused(p, s, 0.03806078373909883)
    p = fused(p, s, -0.05039138054047605)
    p = fused(p, s, 0.058478478867107574)
    p = fused(p, s, -0.06663097673438213)
    p = fused(p, s, 0.07692059586035722)
    p = fused(p, s, -0.09090897718056758)
    p = fused(p, s, 0.11111110781911625)
    p = fused(p, s, -0.14285714280161824)
    p = fused(p, s, 0.19999999999953202)
    p = fused(p, s, -0.333333333333332)
    rest += t * s * p
    eighths = 1.0 if turned else 0.0
    eighths = 2.0 - eighths if steep else eighths
    behind = math.copysign(1.0, x) < 0.0
    eighths = 4.0 - eighths if behind else eighths
    opposite = steep != behind
    t = -t if opposite else t
    rest = -rest if opposite else rest
    base = eighths * _QUARTER_PI
    base_rest = fused(eighths, _QUARTER_PI, -base) + eighths * _QUARTER_PI_REST
    angle = base + t
    rest += (base - angle) + t + base_rest
    # x NaN passes through no comparison above; an infinite quotient has a NaN for its rest only where t is NaN too.
    return math.copysign(angle + rest, y)
