"""Many loops on a common grid of frequencies, streamed: eq 24 at every point, its least value, and the slosh gain.

For surveys of many vehicles and dampings. A grid sees no resonance narrower than its spacing and so always errs on
the optimistic side; `margins` refines, and decides.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from sloshpy.case import Criteria
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.poles import greatest_growth
from sloshpy.dynamics.response import at_reference, transfer
from sloshpy.stability.nichols import nichols_disc_margin
from sloshpy.units import Array, BoolArray, ComplexArray, IntArray

BLOCK = 80000  # values worked on at a time: their scratch arrays stay in the processor's cache
_ROUNDING = 1e-6  # of single precision in the bound of `_nearest`, several times what it is


@dataclass(frozen=True, kw_only=True)
class GridSweep:
    """What a batch of loops shows on a grid; every field has the shape of the batch.

    least: least distance of eq 24 on the grid, unsigned. omega: where, rad/s. slosh: greatest |z_j/beta| over tanks and
    grid, m/rad. stable: closed-loop stability by poles.
    """

    least: Array
    omega: Array
    slosh: Array
    stable: BoolArray

    @property
    def nichols_disc_margin(self) -> Array:
        """Least distance, negative where the closed loop is unstable."""
        return np.asarray(np.where(self.stable, self.least, -self.least))


def grid_sweep(loop: Loop, omega: Array, criteria: Criteria) -> GridSweep:
    """Return least disc margin, slosh gain and stability of a batch of loops on one grid; nothing larger is kept.

    Args:
        loop: a batch, such as vehicles (P, 1) with dampings (D, n_tanks).
        omega: (F,), rad/s.
        criteria: gain and phase margin of eq 24.
    """
    batch = loop.batch
    omega = np.asarray(omega, dtype=float)
    line = _line(loop)
    found = None if line is None else _on_line(loop, line, omega, criteria)
    squared, where, gain = _one_by_one(loop, omega, criteria) if found is None else found
    return GridSweep(
        least=np.sqrt(squared).reshape(batch),
        omega=omega[where].reshape(batch),
        slosh=np.sqrt(gain).reshape(batch),
        stable=greatest_growth(loop) < 0.0,
    )


def _one_by_one(loop: Loop, omega: Array, criteria: Criteria) -> tuple[Array, IntArray, Array]:
    """Return squared least distance, its position and squared slosh gain of every loop of the flattened batch."""
    size = int(np.prod(loop.batch))
    squared, where, gain = np.empty(size), np.empty(size, dtype=int), np.empty(size)
    some = max(1, BLOCK // len(omega))
    for k in range(0, size, some):
        index = np.arange(k, min(k + some, size))
        part = transfer(loop.take(index).along(), 1j * omega)
        distance = nichols_disc_margin(part.loop, criteria.gain_margin, criteria.phase_margin)
        where[index] = np.argmin(distance, axis=-1)
        squared[index] = np.min(distance, axis=-1) ** 2
        gain[index] = np.max(np.abs(part.slosh), axis=(-1, -2)) ** 2
    return squared, where, gain


@dataclass(frozen=True)
class _Line:
    """Dampings along the last axis of a batch as base + t direction, the same for every vehicle; t >= 0, (D,)."""

    base: Array
    direction: Array
    t: Array


def _line(loop: Loop) -> _Line | None:
    """Return the line on which the dampings of a batch lie where only they change along its last axis, else None."""
    batch, xi = loop.batch, loop.damping
    n = len(loop.plant.tanks)
    if not batch or n == 0 or xi.ndim < 2 or xi.shape[-2] != batch[-1] or np.prod(xi.shape[:-2]) != 1:
        return None
    if any(shape and shape[-1] != 1 for shape in loop.others(len(batch))):
        return None
    xi = xi.reshape(batch[-1], n)
    widest = int(np.argmax(np.ptp(xi, axis=0)))
    order = np.argsort(xi[:, widest])
    base, far = xi[order[0]], xi[order[-1]]
    t = xi[:, widest] - base[widest]
    direction = (far - base) / t[order[-1]] if t[order[-1]] > 0.0 else np.zeros(n)
    if np.max(np.abs(base + t[:, None] * direction - xi)) > 1e-15:
        return None
    return _Line(base, direction, t)


def _on_line(loop: Loop, line: _Line, omega: Array, criteria: Criteria) -> tuple[Array, IntArray, Array] | None:
    """Return what `_one_by_one` does for dampings on a line, or None where a base stands on an undamped pole.

    Each vehicle is solved once at each frequency; along the line -L and z_j/beta are ratios of polynomials in t, whose
    evaluation is a matrix product. With t >= 0 no term cancels another: a damper only takes.
    """
    batch = loop.batch
    size, inner, F = int(np.prod(batch)), batch[-1], len(omega)
    squared, where, gain = np.empty(size), np.empty(size, dtype=int), np.empty(size)
    weight = 0.5 * criteria.phase_margin / np.log(criteria.gain_margin)  # of log|L|^2 against the phase
    some = max(1, BLOCK // F)
    scratch = np.empty((5, min(some, inner), F))
    for i in range(size // inner):
        try:
            top, bottom, slosh = _polynomials(loop.take(np.asarray(i * inner)), line, omega)
        except np.linalg.LinAlgError:
            return None
        parts = [np.array(part, dtype=float) for part in (top.real, top.imag, bottom.real, bottom.imag)]
        for k in range(0, inner, some):
            t = line.t[k : k + some]
            rows = slice(i * inner + k, i * inner + k + len(t))
            x, y, most = _evaluated(t, parts, slosh, scratch[:, : len(t)])
            where[rows], squared[rows] = _nearest(x, y, weight)
            gain[rows] = np.max(most, axis=-1)
    return squared / criteria.phase_margin**2, where, gain


def _polynomials(loop: Loop, line: _Line, omega: Array) -> tuple[ComplexArray, ComplexArray, Array]:
    """Return numerator and denominator of -L in rising powers of t, (k + 1, F), and |numerator of z_j/beta|^2.

    The feedback of t direction closes z = (1 + t M)^-1 z_b with M = Z_a diag(2 s w direction). By the recursion of
    Faddeev and Le Verrier det(1 + t M) = sum e_j t^j and adj(1 + t M) = sum B_j t^j with e_j = tr(M B_{j-1})/j and
    B_j = e_j - M B_{j-1}; k is the number of tanks that change, and the rank of M.
    """
    Y_b, Y_a, z_b, Z_a = (
        np.asarray(np.moveaxis(x, 0, -1), dtype=complex) for x in at_reference(loop, 1j * omega, line.base)
    )
    tanks = len(line.base)
    rate = 2j * omega * (loop.plant.tank_frequency * line.direction)[:, None]
    M, row = np.asarray(Z_a * rate, dtype=complex), np.asarray(Y_a * rate, dtype=complex)
    order = int(np.count_nonzero(line.direction))
    e, v = [np.ones_like(Y_b)], [z_b]
    B = np.asarray(np.eye(tanks)[..., None] + 0.0 * M, dtype=complex)
    for j in range(1, order + 1):
        MB = M if j == 1 else _product(M, B)
        e.append(np.einsum("iif->f", MB) / j)
        if j < order:
            B = np.asarray(np.eye(tanks)[..., None] * e[j] - MB, dtype=complex)
            v.append(np.sum(B * z_b, axis=1))
    top = [Y_b, *(Y_b * e[j] - np.sum(row * v[j - 1], axis=0) for j in range(1, order + 1))]
    slosh = np.zeros((tanks, 2 * len(v) - 1, len(omega)))
    for a, first in enumerate(v):
        for b, second in enumerate(v):
            slosh[:, a + b] += (first * np.conj(second)).real
    if len(v) == 1:  # free of t: only the greatest counts
        slosh = np.max(slosh, axis=0, keepdims=True)
    return np.array(top), np.array(e), slosh


def _product(a: ComplexArray, b: ComplexArray) -> ComplexArray:
    """Return the matrix products of two (n, n, F) stacks."""
    total = a[:, 0, None] * b[None, 0]
    for k in range(1, len(a)):
        total += a[:, k, None] * b[None, k]
    return np.asarray(total)


def _evaluated(t: Array, parts: list[Array], slosh: Array, scratch: Array) -> tuple[Array, Array, Array]:
    """Return x and y of -L = x + j y and the greatest |z_j/beta|^2 at values of t, in three of the scratch arrays."""
    powers = t[:, None] ** np.arange(max(len(parts[0]), slosh.shape[1]))
    T = powers[:, : len(parts[0])]
    x, y, u, v, r = scratch
    np.matmul(T, parts[0], out=x)
    np.matmul(T, parts[1], out=y)
    np.matmul(T, parts[2], out=u)
    np.matmul(T, parts[3], out=v)
    # (x + j y) (u - j v) / (u^2 + v^2), in arrays that are used again: fresh ones would take most of the time
    np.multiply(u, u, out=r)
    swap = x * v
    x *= u
    u *= y
    y *= v
    x += y
    u -= swap
    np.multiply(v, v, out=v)
    r += v
    np.divide(1.0, r, out=r)
    x *= r
    u *= r
    if slosh.shape[1] == 1:
        r *= slosh[0]
        return x, u, r
    most, one = swap, y
    np.matmul(powers[:, : slosh.shape[1]], slosh[0], out=most)
    for tank in slosh[1:]:
        np.maximum(most, np.matmul(powers[:, : slosh.shape[1]], tank, out=one), out=most)
    most *= r
    return x, u, most


def _nearest(x: Array, y: Array, weight: float) -> tuple[IntArray, Array]:
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
