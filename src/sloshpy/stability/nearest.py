"""The point of many curves that comes nearest to the critical point in eq 24, with few angles computed."""

from typing import Any

import numpy as np

from sloshpy.units import Array, IntArray

_ROUNDING = 1e-6  # of single precision in the bound of `nearest`, several times what it is


def nearest(x: Array, y: Array, weight: float) -> tuple[IntArray, Array]:
    """Return where each row of -L = x + j y comes nearest to +1 in eq 24, and (PM_d times eq 24) squared there.

    Angles are dear. A bound in single precision, with

        |angle| >= 6 |y| a / (3 a^2 + y^2),  a = |L| + x            (2 atan(u) >= 6 u / (3 + u^2), u = |y| / a)

    leaves out every point farther off than the one where the bound is least; the others are computed in full.
    """
    rows = np.arange(len(x))
    bound = _bound(x, y, np.float32(weight))
    if not np.isfinite(np.sum(bound)):  # an infinite loop, or none: nothing to save
        with np.errstate(divide="ignore"):
            everywhere = _squared(x, y, weight)
        at = np.argmin(everywhere, axis=-1)
        return at, everywhere[rows, at]
    some = np.argmin(bound, axis=-1)
    reach = _squared(x[rows, some], y[rows, some], weight)
    reach = reach * (1.0 + 20.0 * _ROUNDING) + 0.1 * _ROUNDING  # > (sqrt(reach) + _ROUNDING)^2
    k = np.flatnonzero(bound <= reach.astype(np.float32)[:, None])
    exact = _squared(x.ravel()[k], y.ravel()[k], weight)
    row = k // x.shape[-1]
    order = np.lexsort((exact, row))
    first = order[np.searchsorted(row[order], rows)]
    return k[first] - rows * x.shape[-1], exact[first]


def _bound(x: Array, y: Array, weight: np.float32) -> Any:
    """Return a lower bound of `_squared`, but for rounding, in single precision."""
    a, y2 = x.astype(np.float32), y.astype(np.float32)
    angle = np.abs(y2)
    y2 *= y2
    p = a * a
    p += y2
    a += np.sqrt(p)
    angle *= a
    angle *= np.float32(6.0)
    a *= a
    a *= np.float32(3.0)
    a += y2
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        angle /= a
        np.log(p, out=p)
    p *= weight
    p *= p
    angle *= angle
    p += angle
    return p


def _squared(x: Array, y: Array, weight: float) -> Array:
    """Return (PM_d times eq 24) squared of -L = x + j y."""
    return np.asarray((weight * np.log(x * x + y * y)) ** 2 + np.arctan2(y, x) ** 2)
