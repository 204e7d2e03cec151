"""Elementary functions that vectorise: without branches and calls, so that a loop over lanes serves several at once.

Each takes and returns one number. Argument reduction and compensation follow Cody and Waite, Software Manual for the
Elementary Functions, 1980, and Muller, Elementary Functions: Algorithms and Implementation, 3rd ed., 2016; the
polynomials are minimax by Remez's algorithm, relative to the function. Errors stay below one unit in the last place.
"""

from __future__ import annotations

import math
import struct
from importlib import import_module
from typing import Any

import numpy as np

from relnav_sim.kernels.compiling import inlined, instruction
from relnav_sim.kernels.compiling import integer as int64
from relnav_sim.kernels.compiling import number as float64

_QUARTER_PI = math.pi / 4
_QUARTER_PI_REST = 3.061616997868383e-17
"""What pi / 4 is above its double."""
TAN_EIGHTH_PI = 0.41421356237309503
_PER_LOG_2 = 1 / math.log(2)
_LOG_2_HEAD, _LOG_2_TAIL = 0.6931467056274414, 4.7493250390316726e-07
"""ln 2 in two parts, the first with bits to spare for a factor."""
_PER_HALF_PI, _HALF_PI, _HALF_PI_REST = 2 / math.pi, math.pi / 2, 6.123233995736766e-17
_HUGE, _TINY, _SCALE = 2.0**1000, 2.0**-900, 2.0**100


def _integer_of(builder: Any, x: Any) -> Any:
    return builder.bitcast(x, import_module("llvmlite.ir").IntType(64))


def _number_of(builder: Any, bits: Any) -> Any:
    return builder.bitcast(bits, import_module("llvmlite.ir").DoubleType())


@instruction(lambda builder, a, b, c: builder.fma(a, b, c), float64, float64, float64, float64)
def fused(a: float, b: float, c: float) -> float:
    """Return a b + c with one rounding, as IEEE 754 defines it: the same bits on every machine.

    Where it is interpreted it rounds twice.
    """
    return a * b + c


@instruction(_integer_of, int64, float64)
def bits(x: float) -> int:
    """Return the 64 bits of a number as an integer."""
    return int.from_bytes(struct.pack("<d", x), "little", signed=True)


@instruction(_number_of, float64, int64)
def number(bits: int) -> float:
    """Return the number that has these bits."""
    return np.frombuffer((bits & 0xFFFFFFFFFFFFFFFF).to_bytes(8, "little"), "<f8")[0]


_ROUNDER = 1.5 * 2.0**52
"""Added to a number below 2^51, it rounds that to an integer, which then stands in the lowest bits."""
_ROUNDER_BITS = 0x4338000000000000
_ROOT_HALF_BITS, _FRACTION = 0x3FE6A09E667F3BCD, 0x000FFFFFFFFFFFFF


@inlined
def exp(x: float) -> float:
    """Return e^x = 2^k e^r, |r| <= ln 2 / 2; 0 and inf beyond the range."""
    x = -746.0 if x < -746.0 else x
    x = 710.0 if x > 710.0 else x
    shifted = fused(x, _PER_LOG_2, _ROUNDER)
    k = shifted - _ROUNDER
    head = x - k * _LOG_2_HEAD
    r = fused(-k, _LOG_2_TAIL, head)
    rest = fused(-k, _LOG_2_TAIL, head - r)
    p = 1.0 + (r + fused(r * r, _exp_rest(r), rest))
    # Two factors, because 2^k alone leaves the range before the result does.
    power = bits(shifted) - _ROUNDER_BITS
    half = power >> 1
    return p * number((half + 1023) << 52) * number((power - half + 1023) << 52)


@inlined
def exp_of_loss(x: float) -> float:
    """Return e^x, x <= 0, in two thirds of the time of `exp`; below -708 it stays as small as it is there."""
    x = -708.0 if x < -708.0 else x
    shifted = fused(x, _PER_LOG_2, _ROUNDER)
    k = shifted - _ROUNDER
    r = fused(-k, _LOG_2_TAIL, fused(-k, _LOG_2_HEAD, x))
    p = 1.0 + fused(r * r, _exp_rest(r), r)
    # k stands in the lowest bits of `shifted`; the shift leaves those alone, at the exponent's place.
    return number(bits(p) + (bits(shifted) << 52))


@inlined
def _exp_rest(r: float) -> float:
    """Return (e^r - 1 - r) / r^2, |r| <= ln 2 / 2."""
    p = 2.5000041926713554e-08
    p = fused(p, r, 2.7630306668051004e-07)
    p = fused(p, r, 2.755758671992313e-06)
    p = fused(p, r, 2.480149294855125e-05)
    p = fused(p, r, 0.00019841269505885313)
    p = fused(p, r, 0.0013888888943760945)
    p = fused(p, r, 0.008333333333494914)
    p = fused(p, r, 0.041666666666529725)
    p = fused(p, r, 0.1666666666666641)
    p = fused(p, r, 0.5000000000000011)
    return p


@inlined
def log(x: float) -> float:
    """Return ln x = k ln 2 + ln(1 + f), 1 + f within 2^-1/2 and 2^1/2, by s = f / (2 + f).

    -inf at zero and NaN below.
    """
    subnormal = x < 2.2250738585072014e-308
    scaled = x * 18014398509481984.0 if subnormal else x  # by 2^54
    # The exponent counts from 2^-1/2 instead of 1.
    above = bits(scaled) - _ROOT_HALF_BITS
    power = above >> 52
    f = number((above & _FRACTION) + _ROOT_HALF_BITS) - 1.0
    k = number(power + _ROUNDER_BITS) - _ROUNDER
    k = k - 54.0 if subnormal else k
    s = f / (2.0 + f)
    z = s * s
    p = 0.14797508217555186
    p = fused(p, z, 0.15313903309495017)
    p = fused(p, z, 0.18183569732552246)
    p = fused(p, z, 0.22222198476224614)
    p = fused(p, z, 0.285714287432593)
    p = fused(p, z, 0.3999999999941111)
    p = fused(p, z, 0.6666666666666735)
    half_square = 0.5 * f * f
    result = fused(k, _LOG_2_HEAD, f - (half_square - fused(s, half_square + z * p, k * _LOG_2_TAIL)))
    result = x if x == math.inf else result
    result = -math.inf if x == 0.0 else result
    return result if x >= 0.0 else math.nan


@inlined
def sin(x: float) -> float:
    """Return the sine of an angle within 1e5 rad; next to a zero its error is up to 1e-27, whatever the last place."""
    return _sine_of_quarters(x, 0)


@inlined
def cos(x: float) -> float:
    """Return the cosine as `sin` the sine; where both are taken of one angle, most of it is done once."""
    return _sine_of_quarters(x, 1)


@inlined
def _sine_of_quarters(x: float, quarters: int) -> float:
    """Return sin(x + quarters pi/2), x = k pi/2 + r, |r| <= pi/4, by the sine or the cosine of r."""
    shifted = fused(x, _PER_HALF_PI, _ROUNDER)
    k = shifted - _ROUNDER
    head = fused(-k, _HALF_PI, x)  # exact, as all digits that cancel are there
    r = fused(-k, _HALF_PI_REST, head)
    rest = fused(-k, _HALF_PI_REST, head - r)
    s = r * r
    p = 1.589682797208026e-10
    p = fused(p, s, -2.5050758654059164e-08)
    p = fused(p, s, 2.7557313695231838e-06)
    p = fused(p, s, -0.00019841269829816966)
    p = fused(p, s, 0.008333333333322425)
    p = fused(p, s, -0.16666666666666632)
    sine = r + fused(r * s, p, rest)
    q = -1.1359669919201633e-11
    q = fused(q, s, 2.08757236853627e-09)
    q = fused(q, s, -2.7557314355248025e-07)
    q = fused(q, s, 2.4801587289491847e-05)
    q = fused(q, s, -0.0013888888888874138)
    q = fused(q, s, 0.0416666666666666)
    half = 0.5 * s
    most = 1.0 - half
    cosine = most + (((1.0 - most) - half) + fused(s * s, q, -r * rest))
    quarter = bits(shifted) + quarters
    value = cosine if (quarter & 1) == 1 else sine
    return -value if (quarter & 2) == 2 else value


@inlined
def wrapped(angle: float) -> float:
    """Return an angle, or a difference of two, within [-pi, pi]."""
    return angle - 2 * math.pi * np.rint(angle / (2 * math.pi))


@inlined
def atan_rest(t: float) -> float:
    """Return atan t - t, |t| <= tan pi/8."""
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
    return t * s * p


NARROW = 0.25
"""The largest tangent of `atan_narrow` and `hypot_narrow`."""


@inlined
def atan_narrow(t: float) -> float:
    """Return atan t, |t| <= NARROW, in a quarter of the time of `atan2`."""
    s = t * t
    p = 0.04609314856111983
    p = fused(p, s, -0.06526171404791306)
    p = fused(p, s, 0.07683764991911785)
    p = fused(p, s, -0.09090604830037022)
    p = fused(p, s, 0.11111104766156756)
    p = fused(p, s, -0.14285714212325928)
    p = fused(p, s, 0.19999999999588905)
    p = fused(p, s, -0.33333333333332543)
    return fused(t * s, p, t)


@inlined
def hypot_narrow(x: float, t: float) -> float:
    """Return x (1 + t^2)^1/2, |t| <= NARROW: the length of (x, y) from x and t = y / x, without a root."""
    s = t * t
    p = -0.01043081295212776
    p = fused(p, s, 0.015818674187636977)
    p = fused(p, s, -0.020489870626111413)
    p = fused(p, s, 0.027343110344065353)
    p = fused(p, s, -0.03906248665165501)
    p = fused(p, s, 0.06249999984552624)
    p = fused(p, s, -0.12499999999913432)
    p = fused(p, s, 0.49999999999999833)
    return fused(x * s, p, x)


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
    turned = small > TAN_EIGHTH_PI * large
    above = small - large if turned else small
    below = large + small if turned else large
    # a - b and a + b are rounded themselves; what they lose (Knuth's two-sum with |b| >= |a|) belongs to the quotient.
    above_rest = small - (above + large) if turned else 0.0
    below_rest = small - (below - large) if turned else 0.0
    inverse = 1.0 / below
    t = above * inverse
    rest = (fused(-t, below, above) + above_rest - t * below_rest) * inverse
    rest += atan_rest(t)
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
    return math.copysign(angle + rest, y)
