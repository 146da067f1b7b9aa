"""One-sinusoid limit cycles of many loops at once: frequency and amplitudes solved together from 1 + L = 0.

Unknowns ln A_j and ln W of each loop, with every tank's damping f_j(W A_j / w_j):

    1 + L(s) = 0 ,   ln(A_j / A_t) = ln|z_j / z_t| ,   s = sigma + j W ,   sigma = 0

Let sigma float with A_t given, and its slope by ln A_t says whether the cycle attracts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sloshpy.damping import DampingLaw, ratios
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.response import transfer
from sloshpy.units import Array, BoolArray, ComplexArray

STEP = 1e-6  # of the logarithms, for derivatives by central differences
CLOSED = 1e-10  # imbalance at which a cycle is found
ROUNDS = 25


@dataclass(frozen=True, kw_only=True)
class NeutralCycles:
    """Cycles of C loops; nan where none was found.

    slosh: (C, n_tanks), m. omega: (C,), rad/s. tvc: (C,), rad.
    slope: (C,), d sigma / d ln A of the leading tank, 1/s: the cycle attracts where it is negative.
    """

    slosh: Array
    omega: Array
    tvc: Array
    slope: Array

    @property
    def attracts(self) -> BoolArray:
        """Whether a cycle was found that attracts, (C,)."""
        return np.asarray(self.slope < 0.0)


def neutral_cycles(loop: Loop, laws: Sequence[DampingLaw], tank: int, slosh: Array, omega: Array) -> NeutralCycles:
    """Return the cycle of each loop near a start, by Newton's method.

    Args:
        loop: C loops, batch (C,); its damping plays no part.
        tank: the leading tank, whose amplitude is not 0.
        slosh: (C, n_tanks), m, and omega: (C,), rad/s, where to start.
    """
    n = len(laws)
    x = np.log(np.concatenate([slosh, omega[:, None]], axis=-1))
    error = np.full(len(x), np.inf)
    for _ in range(ROUNDS):
        F = _imbalance(loop, laws, tank, x, 0.0)
        error = np.max(np.abs(F), axis=-1)
        if np.all((error < CLOSED) | np.isnan(error)):
            break
        step = _solved(_derivatives(loop, laws, tank, x), F)
        x = x - step * np.minimum(1.0, 0.7 / np.maximum(np.max(np.abs(step), axis=-1, keepdims=True), 1e-300))
    found = error < CLOSED
    J = _derivatives(loop, laws, tank, x)
    floating = np.delete(J, tank, axis=-1)
    by_growth = _imbalance(loop, laws, tank, x, STEP) - _imbalance(loop, laws, tank, x, -STEP)
    floating = np.concatenate([floating, by_growth[..., None] / (2.0 * STEP)], axis=-1)
    slope = -_solved(floating, J[..., tank])[:, -1] * np.exp(x[:, n])  # sigma was counted in parts of W
    z = _slosh(loop, laws, x, 0.0)[1]
    A, W = np.exp(x[:, :n]), np.exp(x[:, n])
    with np.errstate(divide="ignore", invalid="ignore"):
        tvc = A[:, tank] / np.abs(z[:, tank])
    return NeutralCycles(
        slosh=np.where(found[:, None], A, np.nan),
        omega=np.where(found, W, np.nan),
        tvc=np.where(found, tvc, np.nan),
        slope=np.where(found, slope, np.nan),
    )


def _slosh(loop: Loop, laws: Sequence[DampingLaw], x: Array, growth: float) -> tuple[ComplexArray, ComplexArray]:
    """Return 1 + L and z/beta at s = W (growth + j)."""
    with np.errstate(all="ignore"):
        A, W = np.exp(x[:, :-1]), np.exp(x[:, -1])
        xi = ratios(laws, W[:, None] * A / loop.plant.tank_frequency)
        parts = transfer(replace(loop, damping=xi), W * (growth + 1j))
    return 1.0 + parts.loop, parts.slosh


def _imbalance(loop: Loop, laws: Sequence[DampingLaw], tank: int, x: Array, growth: float) -> Array:
    """Return what is to vanish, (C, n_tanks + 1)."""
    one_plus_loop, z = _slosh(loop, laws, x, growth)
    with np.errstate(all="ignore"):
        shape = x[:, :-1] - np.log(np.abs(z))
    others = np.delete(shape - shape[:, [tank]], tank, axis=-1)
    return np.concatenate([np.stack([one_plus_loop.real, one_plus_loop.imag], axis=-1), others], axis=-1)


def _derivatives(loop: Loop, laws: Sequence[DampingLaw], tank: int, x: Array) -> Array:
    """Return the derivatives of the imbalance by ln A_j and ln W, (C, n_tanks + 1, n_tanks + 1)."""
    columns = []
    for i in range(x.shape[-1]):
        h = STEP * (np.arange(x.shape[-1]) == i)
        columns.append(_imbalance(loop, laws, tank, x + h, 0.0) - _imbalance(loop, laws, tank, x - h, 0.0))
    return np.stack(columns, axis=-1) / (2.0 * STEP)


def _solved(J: Array, right: Array) -> Array:
    """Solve J y = right for each loop; nan where J is singular or not known."""
    known = np.all(np.isfinite(J), axis=(-1, -2)) & np.all(np.isfinite(right), axis=-1)
    safe = np.where(known[:, None, None], J, np.eye(J.shape[-1]))
    singular = np.linalg.cond(safe) > 1e14
    safe = np.where(singular[:, None, None], np.eye(J.shape[-1]), safe)
    y = np.linalg.solve(safe, np.where(known[:, None], right, 0.0)[..., None])[..., 0]
    return np.where((known & ~singular)[:, None], y, np.nan)
