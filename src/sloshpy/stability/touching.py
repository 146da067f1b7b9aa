"""The level of damping at which a loop's curve just touches: a level of eq 24, or the critical point itself.

Newton's method on the exact response from a start near by, many loops at once. Where it does not settle inside the
bracket it says nan; what it finds is a candidate that its caller proves.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sloshpy.case import Criteria
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.response import transfer
from sloshpy.stability.nichols import nichols_disc_margin
from sloshpy.units import Array, ComplexArray, IntArray

ROUNDS = 30
SETTLED = 1e-11  # relative change of the damping in the last round; the frequency is worth its square root
FINE = 1e-2  # of a resonance's relative width, which is about the damping: the spacing of the differences

_Loops = Callable[[Array, IntArray], Loop]  # at levels of damping > 0, and which of the loops


def with_ratio(loop: Loop, index: IntArray, tank: int, ratio: Array) -> Loop:
    """Return loops of the flattened batch, each with its own damping of one tank."""
    one = loop.take(index)
    damping = np.broadcast_to(one.damping, (*np.shape(ratio), one.damping.shape[-1])).copy()
    damping[..., tank] = ratio
    return replace(one, damping=damping)


def touching_level(
    loops: _Loops, threshold: float, criteria: Criteria, start: tuple[Array, Array], ends: Array
) -> tuple[Array, Array]:
    """Return frequency, rad/s, and damping at which a minimum of eq 24 equals a threshold, (K,); nan if none is found.

    Args:
        loops: of damping and which of the K; a damping of one tank, or a level about as great as the damping it means.
        threshold: of eq 24.
        criteria: gain and phase margin of eq 24.
        start: frequencies in rad/s and dampings, (K,) each.
        ends: (2, K), the dampings between which it must lie.
    """

    def squared(x: Array, y: Array, at: IntArray) -> Array:
        L = _response(loops, x, y, at)
        return nichols_disc_margin(L, criteria.gain_margin, criteria.phase_margin) ** 2

    def step(x: Array, y: Array, at: IntArray) -> tuple[Array, Array]:
        """Solve D = threshold^2 and dD/dx = 0 for D = DM^2 by its values on a cross."""
        h = FINE * np.maximum(np.exp(y), 1e-6)
        k = np.full(len(y), 1e-4)
        dx, dy = (np.array(p) for p in zip(*[(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)], strict=True))
        D = squared(x[:, None] + h[:, None] * dx, y[:, None] + k[:, None] * dy, at).reshape(-1, 3, 3)
        D_x, D_y = (D[:, 2, 1] - D[:, 0, 1]) / (2.0 * h), (D[:, 1, 2] - D[:, 1, 0]) / (2.0 * k)
        D_xx = (D[:, 2, 1] - 2.0 * D[:, 1, 1] + D[:, 0, 1]) / h**2
        D_xy = (D[:, 2, 2] - D[:, 2, 0] - D[:, 0, 2] + D[:, 0, 0]) / (4.0 * h * k)
        D_xx = np.where(D_xx > 0.0, D_xx, np.nan)  # no minimum here
        size = D_x * D_xy - D_y * D_xx
        rest = threshold**2 - D[:, 1, 1]
        return (rest * D_xy + D_x * D_y) / size, (-D_x * D_x - rest * D_xx) / size

    return _settled(step, start, ends)


def touching_critical_point(loops: _Loops, start: tuple[Array, Array], ends: Array) -> Array:
    """Return the damping at which L(j omega) = -1 for some frequency, (K,); nan where none is found."""

    def step(x: Array, y: Array, at: IntArray) -> tuple[Array, Array]:
        h = 1e-7  # relative; central differences of an analytic function, as in `nichols`
        off = np.array([0.0, h, -h, 0.0, 0.0])
        L = _response(loops, x[:, None] + off, y[:, None] + off[[0, 3, 4, 1, 2]], at)
        L_x, L_y, rest = (L[:, 1] - L[:, 2]) / (2.0 * h), (L[:, 3] - L[:, 4]) / (2.0 * h), -1.0 - L[:, 0]
        size = (np.conj(L_x) * L_y).imag
        return -(np.conj(L_y) * rest).imag / size, (np.conj(L_x) * rest).imag / size

    return _settled(step, start, ends)[1]


def _response(loops: _Loops, x: Array, y: Array, at: IntArray) -> ComplexArray:
    """Return L at ln omega and ln damping, the first axis of both that of `at`."""
    which = np.broadcast_to(at.reshape(-1, *np.ones(x.ndim - 1, dtype=int)), x.shape)
    return transfer(loops(np.exp(y), which), 1j * np.exp(x)).loop


def _settled(
    step: Callable[[Array, Array, IntArray], tuple[Array, Array]], start: tuple[Array, Array], ends: Array
) -> tuple[Array, Array]:
    """Return where Newton's method settles from a start, nan where it does not or leaves the bracket.

    A loop that has settled is left alone, so that no loop's digits depend on its neighbours.
    """
    x, y = np.log(start[0]), np.log(start[1])
    low, high = np.log(np.maximum(ends, 1e-300))
    moved = np.full(len(y), np.inf)
    todo = np.arange(len(y))
    for _ in range(ROUNDS):
        with np.errstate(all="ignore"):  # where it fails, nan says so
            dx, dy = step(x[todo], y[todo], todo)
            scale = np.maximum(np.maximum(np.abs(dx) / np.maximum(2.0 * np.exp(y[todo]), 1e-6), np.abs(dy) / 0.3), 1.0)
        x[todo], y[todo], moved[todo] = x[todo] + dx / scale, y[todo] + dy / scale, np.abs(dy)
        todo = todo[moved[todo] >= SETTLED]  # nan has failed
        if len(todo) == 0:
            break
    inside = (moved < SETTLED) & (y >= low) & (y <= high)
    return np.where(inside, np.exp(x), np.nan), np.where(inside, np.exp(y), np.nan)
