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
from sloshpy.dynamics.response import at_reference, excess_damping, transfer
from sloshpy.stability.nichols import nichols_disc_margin
from sloshpy.units import Array, BoolArray, IntArray

GROUP = 32  # vehicles solved at a time: bounds the memory
BLOCK = 80000  # values worked on at a time: their scratch arrays stay in the processor's cache


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
    batch, n_tanks = loop.batch, len(loop.plant.tanks)
    survey = _one_tank if n_tanks == 1 and len(batch) >= 1 and loop.damping.ndim >= 2 else _any_tanks
    omega = np.asarray(omega, dtype=float)
    parts = [loop.part(slice(k, k + GROUP)) for k in range(0, batch[0], GROUP)] if batch else [loop]
    found = [survey(part, omega, criteria) for part in parts]
    squared, where, gain = (np.concatenate(x) if batch else x[0] for x in zip(*found, strict=True))
    return GridSweep(
        least=np.sqrt(squared), omega=omega[where], slosh=np.sqrt(gain), stable=greatest_growth(loop) < 0.0
    )


def _any_tanks(loop: Loop, omega: Array, criteria: Criteria) -> tuple[Array, Array, Array]:
    """Return squared least distance, its position and squared slosh gain, one loop of the batch after another."""
    batch = loop.batch
    size = int(np.prod(batch))
    squared, where, gain = np.empty(size), np.empty(size, dtype=int), np.empty(size)
    some = max(1, BLOCK // len(omega))
    for k in range(0, size, some):
        index = np.arange(k, min(k + some, size))
        part = transfer(loop.take(index).along(), 1j * omega)
        distance = nichols_disc_margin(part.loop, criteria.gain_margin, criteria.phase_margin)
        where[index] = np.argmin(distance, axis=-1)
        squared[index] = np.min(distance, axis=-1) ** 2
        gain[index] = np.max(np.abs(part.slosh), axis=(-1, -2)) ** 2
    return squared.reshape(batch), where.reshape(batch), gain.reshape(batch)


def _one_tank(loop: Loop, omega: Array, criteria: Criteria) -> tuple[Array, Array, Array]:
    """Return the same for one tank, where L is a ratio of first-degree polynomials in the damping d.

    -L = Y_b - d W / (1 + d V) and z/beta = z_b / (1 + d V) with V = s Z_a and W = s Y_a z_b. Written in real arithmetic
    on arrays that are used again, d W / (1 + d V) as d (W + d V* W) / |1 + d V|^2: numpy's complex division and fresh
    arrays would take most of the time.
    """
    batch = loop.batch
    line = loop.along()
    s = 1j * omega
    Y_b, Y_a, z_b, Z_a = at_reference(line, s)  # the damping plays no part in these
    size, F = int(np.prod(batch)), len(omega)
    d = np.broadcast_to(excess_damping(loop)[..., 0], batch).reshape(-1)
    d = np.stack([np.ones_like(d), d], axis=-1)
    V, W, power = s * Z_a[..., 0, 0], s * Y_a[..., 0] * z_b[..., 0], np.abs(z_b[..., 0]) ** 2
    lines: list[tuple[Any, Any]] = [
        (np.ones_like(V), V),
        (W, np.conj(V) * W),
    ]  # constant and slope in d of 1 + d V and W + d V* W
    pairs: list[tuple[Any, Any]] = [(part(a), part(b)) for part in (np.real, np.imag) for a, b in lines]
    pairs += [(Y_b.real, Y_b.imag), (power, power)]
    parts = [[np.broadcast_to(x, (*batch, F)) for x in pair] for pair in pairs]
    squared, where, gain = np.empty(size), np.empty(size, dtype=int), np.empty(size)
    some = max(1, BLOCK // F)
    scratch = np.empty((4, some, F))
    weight = 0.5 * criteria.phase_margin / np.log(criteria.gain_margin)  # of log|L|^2 against the phase
    outer, inner = int(np.prod(batch[:-1])), batch[-1]
    for i in range(outer):
        at = np.unravel_index(i, batch[:-1])
        shared = parts[0][1][at].strides[0] == 0  # one vehicle along the last axis, which is then a damping axis
        rows_of = [np.stack([x[at][0] if shared else x[at] for x in pair], axis=-2) for pair in parts]
        for k in range(0, inner, some):
            rows = slice(k, min(k + some, inner))
            here = rows_of if shared else [x[rows] for x in rows_of]
            flat = slice(i * inner + k, i * inner + rows.stop)
            x, y, slosh = _minus_loop(d[flat], here, scratch[:, : rows.stop - k])
            where[flat], squared[flat] = _nearest(x, y, weight)
            gain[flat] = np.max(slosh, axis=-1)
    squared /= criteria.phase_margin**2
    return squared.reshape(batch), where.reshape(batch), gain.reshape(batch)


def _line(d: Array, pair: Array, out: Array) -> Array:
    """Return constant + d slope in `out`; `pair` holds both in rows, one pair for all (1, d) or one for each."""
    if pair.ndim == 2:
        return np.matmul(d, pair, out=out)
    np.multiply(d[:, 1:], pair[:, 1], out=out)
    out += pair[:, 0]
    return out


def _minus_loop(d: Array, here: list[Array], scratch: Array) -> tuple[Array, Array, Array]:
    """Return x and y of -L = x + j y and the squared slosh gain, in three of the scratch arrays."""
    V_re, W_re, V_im, W_im, Y, power = here
    r, x, y, t = scratch
    _line(d, V_re, x)
    _line(d, V_im, y)
    np.multiply(x, x, out=r)
    np.multiply(y, y, out=t)
    r += t
    np.divide(1.0, r, out=r)  # 1/|1 + d V|^2
    np.multiply(r, d[:, 1:], out=t)
    r *= power[..., 0, :]
    _line(d, W_re, x)
    x *= t
    np.subtract(Y[..., 0, :], x, out=x)
    _line(d, W_im, y)
    y *= t
    np.subtract(Y[..., 1, :], y, out=y)
    return x, y, r


_ROUNDING = 1e-6  # of single precision in the bound, several times what it is


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
