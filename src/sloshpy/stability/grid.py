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
from sloshpy.units import Array, BoolArray

GROUP = 32  # vehicles solved at a time: bounds the memory
BLOCK = 20000  # values worked on at a time: their scratch arrays stay in the processor's cache


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
            distance, slosh = _distance(d[flat], here, weight, scratch[:, : rows.stop - k])
            least = np.argmin(distance, axis=-1)
            where[flat], squared[flat] = least, distance[np.arange(len(least)), least]
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


def _distance(d: Array, here: list[Array], weight: float, scratch: Array) -> tuple[Array, Array]:
    """Return (PM_d times eq 24) squared and the squared slosh gain, in two of the scratch arrays."""
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
    np.subtract(Y[..., 1, :], y, out=y)  # x + j y = -L
    np.arctan2(y, x, out=t)
    x *= x
    y *= y
    x += y
    np.log(x, out=x)
    x *= weight
    x *= x
    t *= t
    x += t  # eq 24
    return x, r
