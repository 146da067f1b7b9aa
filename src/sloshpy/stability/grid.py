"""Many loops on a common grid of frequencies, streamed: eq 24 at every point, its least value, and the slosh gain.

For surveys of many vehicles and dampings. A grid sees no resonance narrower than its spacing and so always errs on
the optimistic side; `margins` refines, and decides.
"""

from dataclasses import dataclass

import numpy as np

from sloshpy.case import Criteria
from sloshpy.dynamics.growth import is_stable
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.response import transfer
from sloshpy.stability.damping_line import DampingLine, Expansion, damping_line, expansions
from sloshpy.stability.nearest import nearest
from sloshpy.stability.nichols import nichols_disc_margin
from sloshpy.units import Array, BoolArray, IntArray

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
    batch = loop.batch
    omega = np.asarray(omega, dtype=float)
    line = damping_line(loop)
    found = None if line is None else _on_line(loop, line, omega, criteria)
    squared, where, gain = _one_by_one(loop, omega, criteria) if found is None else found
    return GridSweep(
        least=np.sqrt(squared).reshape(batch),
        omega=omega[where].reshape(batch),
        slosh=np.sqrt(gain).reshape(batch),
        stable=is_stable(loop),
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


def _on_line(loop: Loop, line: DampingLine, omega: Array, criteria: Criteria) -> tuple[Array, IntArray, Array] | None:
    """Return what `_one_by_one` does for dampings on a line, or None where a base stands on an undamped pole.

    Each vehicle is solved once at each frequency; along the line -L and z_j/beta are ratios of polynomials in t, whose
    evaluation is a matrix product. With t >= 0 no term cancels another: a damper only takes.
    """
    batch = loop.batch
    size, inner, F = int(np.prod(batch)), batch[-1], len(omega)
    squared, where, gain = np.empty(size), np.empty(size, dtype=int), np.empty(size)
    weight = 0.5 * criteria.phase_margin / np.log(criteria.gain_margin)  # of log|L|^2 against the phase
    some = max(1, BLOCK // F)
    scratch = np.empty((4, min(some, inner), F))
    try:
        for i, one in enumerate(expansions(loop, line, omega)):
            for k in range(0, inner, some):
                t = line.t[k : k + some]
                rows = slice(i * inner + k, i * inner + k + len(t))
                x, y, most = _evaluated(t, one, scratch[:, : len(t)])
                where[rows], squared[rows] = nearest(x, y, weight)
                gain[rows] = np.max(most, axis=-1)
    except np.linalg.LinAlgError:
        return None
    return squared / criteria.phase_margin**2, where, gain


def _evaluated(t: Array, one: Expansion, scratch: Array) -> tuple[Array, Array, Array]:
    """Return x and y of -L = x + j y and the greatest |z_j/beta|^2 at values of t, each (T, F).

    In arrays that are used again: fresh ones would take most of the time.
    """
    powers = t[:, None] ** np.arange(max(len(one.below), one.slosh.shape[1]))
    x, y, most, r = scratch
    loop, slosh = powers[:, : len(one.below)], powers[:, : one.slosh.shape[1]]
    np.divide(1.0, np.matmul(loop, one.below, out=r), out=r)
    np.matmul(slosh, one.slosh[0], out=most)
    for tank in one.slosh[1:]:
        np.maximum(most, np.matmul(slosh, tank, out=x), out=most)
    most *= r
    x, y = np.matmul(loop, one.x, out=x), np.matmul(loop, one.y, out=y)
    x *= r
    y *= r
    return x, y, most
