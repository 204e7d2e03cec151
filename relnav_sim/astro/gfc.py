"""Files of gravity fields in the form of the ICGEM (Barthelmes and Foerste 2011, The ICGEM-format), `.gfc`."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

from relnav_sim.arrays import Array

CHANGING = {"gfct", "trnd", "dot", "asin", "acos"}
"""Records of coefficients that change with time."""
NORMS = ("fully_normalized", "unnormalized")
_MU = ("earth_gravity_constant", "gravity_constant")
_KEYS = (*_MU, "radius", "max_degree", "norm", "tide_system", "modelname")


class GfcField(NamedTuple):
    """What a file says.

    Attributes:
        mu_m3_s2: Gravitational parameter, m^3/s^2.
        radius_m: Radius that the coefficients refer to, m.
        tide_system: As the file calls it; `unknown` where it does not.
        name: Of the model.
        C: Fully normalised cosine coefficients (degree + 1, degree + 1).
        S: Sine coefficients.
    """

    mu_m3_s2: float
    radius_m: float
    tide_system: str
    name: str
    C: Array
    S: Array


class _Line(NamedTuple):
    """A line of a file, and what to call it."""

    words: list[str]
    place: str


def read_gfc(path: Path, degree: int, order: int) -> GfcField:
    """Return a static field up to a degree and order.

    Degrees 0 and 1 may be missing: they are 1 and 0 then.

    Raises:
        ValueError: The file can't be read, is not of that form, or does not have all coefficients up to that degree
            and order; the message names file and line.
    """
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            lines = (_Line(line.split(), f"{path}:{number}") for number, line in enumerate(file, start=1))
            header = _header(path, lines)
            mu, radius = _positive(path, header, *_MU), _positive(path, header, "radius")
            norm = header["norm"].words[1] if "norm" in header else NORMS[0]
            if norm not in NORMS:
                raise ValueError(f"{header['norm'].place}: norm is {norm!r}; it must be {' or '.join(NORMS)}")
            has = int(_positive(path, header, "max_degree"))
            if degree > has:
                raise ValueError(
                    f"{header['max_degree'].place}: the field has degrees up to {has}, not to the {degree} asked for"
                )
            C, S = _coefficients(path, lines, degree, order)
    except OSError as error:
        raise ValueError(f"{path}: can't be read: {error.strerror}") from error
    if norm == "unnormalized":
        norms = _norms(degree)
        C, S = C / norms, S / norms
    named = {key: header[key].words[1] if key in header else "" for key in ("tide_system", "modelname")}
    return GfcField(mu, radius, named["tide_system"] or "unknown", named["modelname"] or path.stem, C, S)


def _header(path: Path, lines: Iterator[_Line]) -> dict[str, _Line]:
    """Return the lines of the head that say something, by their keyword."""
    said: dict[str, _Line] = {}
    for line in lines:
        keyword = line.words[0] if line.words else ""
        if keyword == "end_of_head":
            return said
        if keyword == "begin_of_head":
            said = {}
        # Free text may begin with such a word too.
        elif keyword in _KEYS and len(line.words) == 2:
            said[keyword] = line
    raise ValueError(f"{path}: there is no line end_of_head: this is not an ICGEM file of a gravity field")


def _positive(path: Path, header: dict[str, _Line], *keys: str) -> float:
    """Return the number of the first key that is there."""
    for key in keys:
        if key in header:
            words, place = header[key]
            value = _number(words[1], place)
            if not value > 0:
                raise ValueError(f"{place}: {key} is {words[1]}; it must be positive")
            return value
    raise ValueError(f"{path}: the head has no line {keys[0]}")


def _number(word: str, place: str) -> float:
    """Return a number, which may have a Fortran exponent."""
    try:
        value = float(word.replace("D", "e").replace("d", "e"))
    except ValueError:
        raise ValueError(f"{place}: {word!r} is not a number") from None
    if not isfinite(value):
        raise ValueError(f"{place}: {word!r} is not a finite number")
    return value


def _coefficients(path: Path, lines: Iterator[_Line], degree: int, order: int) -> tuple[Array, Array]:
    C, S = np.full((2, degree + 1, degree + 1), np.nan)
    C[:2], S[:2] = 0.0, 0.0
    C[0, 0] = 1.0
    given = np.zeros(C.shape, dtype=bool)
    for words, place in lines:
        if not words:
            continue
        if (words[0] != "gfc" and words[0] not in CHANGING) or len(words) < 5:
            raise ValueError(f"{place}: this is not a record of an ICGEM file: gfc, degree, order, C and S")
        n, m = (_whole(word, place) for word in words[1:3])
        if m > n:
            raise ValueError(f"{place}: the order {m} is above the degree {n}")
        if n > degree or m > order:
            continue
        if words[0] in CHANGING:
            raise ValueError(
                f"{place}: degree {n}, order {m} changes with time ({words[0]}); only static fields can be used"
            )
        if given[n, m]:
            raise ValueError(f"{place}: degree {n}, order {m} is given twice")
        given[n, m] = True
        C[n, m], S[n, m] = (_number(word, place) for word in words[3:5])
    missing = np.argwhere(np.isnan(np.tril(C[:, : order + 1])))
    if len(missing):
        n, m = missing[0].tolist()
        raise ValueError(f"{path}: there is no coefficient of degree {n}, order {m}")
    C[np.isnan(C)], S[np.isnan(S)] = 0.0, 0.0
    return C, S


def _whole(word: str, place: str) -> int:
    if not (word.isascii() and word.isdigit()):
        raise ValueError(f"{place}: {word!r} is not a degree or order")
    return int(word)


def _norms(degree: int) -> Array:
    """Return what norms multiply Legendre functions by: sqrt((2 - d_0m) (2n + 1) (n-m)! / (n+m)!)."""
    norms = np.ones((degree + 1, degree + 1))
    for n in range(degree + 1):
        norms[n, 0] = norm = sqrt(2 * n + 1)
        norm *= sqrt(2)
        for m in range(1, n + 1):
            norm /= sqrt((n + m) * (n - m + 1))
            norms[n, m] = norm
    return norms
