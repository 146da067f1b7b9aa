"""The greatest level of damping at which a loop is not good yet, along any path of dampings: a supremum, no root.

The disc margin is a distance: a loop may be bad, good and bad again as damping grows. All levels are scanned from the
highest down, and the last bad one is refined between itself and the next.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sloshpy.case import Criteria
from sloshpy.damping.laws import MOST_DAMPING
from sloshpy.dynamics.growth import greatest_growth
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.poles import NEUTRAL, closed_loop_eigenvalues
from sloshpy.dynamics.response import transfer
from sloshpy.stability.family import sampled_family
from sloshpy.stability.margins import Margins, least_in, loop_margins
from sloshpy.stability.nichols import nichols_disc_margin
from sloshpy.stability.touching import touching_critical_point, touching_level
from sloshpy.units import Array, BoolArray, IntArray

MOST_RATIO = MOST_DAMPING  # beyond it nothing is slosh: the search ends here
LEVELS = 38  # damping values scanned: 0, then in steps of a quarter, below a thousandth of three quarters
FEW = 2  # levels of one plant for which common frequencies are not worth their search,
MANY = 7  # where so many loops are worked on together instead
SMALL = 2  # coordinates of a plant whose response is a formula
BLOCK = 19  # of them at a time, from above
NARROW = 0.1  # of a resonance's relative width, which is about the damping: where a minimum is sought once more
# relative: how far on both sides of a damping the verdict is asked that proves it; where a margin hardly moves with it,
# far enough for the slack of `required_damping`
PROOF = 5e-7


def damping_levels(count: int) -> Array:
    """Return so many damping ratios from 0 to `MOST_RATIO` that are scanned, a fifth of them below a thousandth."""
    few = (count + 2) // 5
    low, high = np.geomspace(1e-5, 1e-3, few + 1)[:-1], np.geomspace(1e-3, MOST_RATIO, count - 1 - few)
    return np.concatenate([[0.0], low, high])


@dataclass(frozen=True)
class _Shown:
    """What loops show at some levels: growth in 1/s, the least distance that counts, where in rad/s."""

    growth: Array
    margin: Array
    omega: Array


@dataclass(frozen=True, kw_only=True)
class DampingSearch:
    """What is asked of loops at many levels of their damping; minima above `threshold` may be missed.

    at: loops at levels, of (level, index) with the index counting loops from 0 to `size` - 1. moved: numbers of the
    tanks that a level damps, others stay. counted: those whose minima count. shared_with, until: more of them, up to a
    level. axis: growth that counts as none, 1/s. slack: relative, by which a margin may miss the threshold.
    proof: relative, how far on both sides of a level the verdict is asked.
    """

    at: Callable[[Array, IntArray], Loop]
    size: int
    moved: tuple[int, ...]
    counted: tuple[int, ...]
    shared_with: tuple[int, ...] = ()
    until: float = np.inf
    criteria: Criteria
    threshold: float
    axis: float
    slack: float = 0.0
    proof: float = PROOF

    def suprema(self, grid: Array) -> tuple[Array, Array, Array]:
        """Return for each loop the level above which it is stable, that above which it is good, and where, (size,).

        0 where every level is, nan where the highest of the grid is not. Where: the frequency of the least minimum that
        counts at the second, rad/s; nan where there is none.
        """
        scan = self._from_above(grid)
        neutral = _supremum(scan.growth >= self.axis, grid, self._growing, self._neutral_candidate)
        omega = np.full(self.size, np.nan)

        def candidate(low: Array, high: Array, index: IntArray) -> Array:
            at, level = self._margin_candidate(low, high, index, scan, grid)
            omega[index] = self._least_beside(at, level, index)
            return level

        good = _supremum(self._short(scan.growth, scan.margin) > 0.0, grid, self._lacking, candidate)
        known = np.flatnonzero(np.isfinite(good) & np.isnan(omega))
        if len(known):
            omega[known] = self._shown(good[known], known).omega
        return neutral, good, omega

    def good_from(self, grid: Array) -> Array:
        """Return for each loop the level above which it is good alone, (size,)."""
        scan = self._from_above(grid, stop_short=True)
        return _supremum(
            self._short(scan.growth, scan.margin) > 0.0,
            grid,
            self._lacking,
            lambda low, high, index: self._margin_candidate(low, high, index, scan, grid)[1],
        )

    def _shown(self, level: Array, index: IntArray) -> _Shown:
        """Return what loops show at levels (K,).

        A plant of one tank on a rigid vehicle costs next to nothing; a larger one is solved once for all its levels,
        unless many plants have few each.
        """
        one = self.at(level, index)
        found = _Shown(*(np.empty(len(level)) for _ in range(3)))
        size = np.bincount(index)[index]
        few = size <= FEW
        if np.sum(few) < MANY:
            few[:] = False
        if one.plant.mass.shape[-1] <= SMALL:
            few[:] = True
        parts = [(np.flatnonzero(few), False)] if np.any(few) else []
        parts += [(np.flatnonzero(index == row), True) for row in np.unique(index[~few])]
        for k, family in parts:
            own = one.take(k)
            curves = sampled_family(own, self.moved, self.criteria, self.threshold) if family else None
            below = self.threshold if family else np.inf
            part = self._counted(loop_margins(own.along(), self.criteria, False, curves, below), level[k])
            found.growth[k], found.margin[k], found.omega[k] = part.growth, part.margin, part.omega
        return found

    def _counted(self, found: Margins, level: Array) -> _Shown:
        margin, omega = found.slosh_disc_margin(*self.counted)
        if self.shared_with:
            more, at = found.slosh_disc_margin(*self.shared_with)
            nearer = (np.abs(more) < np.abs(margin)) & (level <= self.until)[..., None]
            margin, omega = np.where(nearer, more, margin), np.where(nearer, at, omega)
        return _Shown(growth=found.growth[..., 0], margin=np.abs(margin[..., 0]), omega=omega[..., 0])

    def _growing(self, level: Array, index: IntArray) -> Array:
        """Return the growth beyond `axis`, 1/s."""
        return greatest_growth(self.at(level, index)) - self.axis

    def _short(self, growth: Array, margin: Array) -> Array:
        """Return how far a margin is below the threshold; all of the threshold where the loop grows."""
        # inf where no minimum counts
        lacks = self.threshold * (1.0 - self.slack) - margin
        return np.where(growth < self.axis, np.maximum(lacks, -1e3), self.threshold)

    def _lacking(self, level: Array, index: IntArray) -> Array:
        """Return how far the margin is below the threshold."""
        found = self._shown(level, index)
        return self._short(found.growth, found.margin)

    def _from_above(self, grid: Array, stop_short: bool = False) -> _Shown:
        """Return what every loop shows on rising levels, (size, levels), asked from the highest down.

        Below the level where a loop is found unstable nothing is asked any more: it grows without end there.
        stop_short: nor below one where its margin is short, where that alone is wanted.
        """
        shape = (self.size, len(grid))
        scan = _Shown(growth=np.full(shape, np.inf), margin=np.zeros(shape), omega=np.full(shape, np.nan))
        rows, top = np.arange(shape[0]), shape[1]
        while top > 0 and len(rows):
            some = np.arange(max(0, top - BLOCK), top)
            index, level = np.repeat(rows, len(some)), np.tile(grid[some], len(rows))
            found, at = self._shown(level, index), (index, np.tile(some, len(rows)))
            scan.growth[at], scan.margin[at], scan.omega[at] = found.growth, found.margin, found.omega
            last = found.growth >= self.axis
            if stop_short:
                last |= self._short(found.growth, found.margin) > 0.0
            rows = rows[~np.any(last.reshape(len(rows), len(some)), axis=1)]
            top = int(some[0])
        return scan

    def _margin_candidate(
        self, low: Array, high: Array, index: IntArray, scan: _Shown, grid: Array
    ) -> tuple[Array, Array]:
        """Return frequency and level at which the least minimum reaches the threshold between two levels of a scan.

        nan where that is not proved.
        """
        below = np.searchsorted(grid, low)
        growth, margin, omega = (x[index, below] for x in (scan.growth, scan.margin, scan.omega))
        above = scan.margin[index, below + 1]
        signed = np.where(growth < self.axis, margin, -margin)
        with np.errstate(divide="ignore", invalid="ignore"):  # no minimum that counts at one end: start in the middle
            share = np.nan_to_num((self.threshold - signed) / (above - signed), nan=0.5)
        start = omega, _between(low, high, np.clip(share, 0.05, 0.95))
        at, level = touching_level(
            lambda y, k: self.at(y, index[k]), self.threshold, self.criteria, start, np.array([low, high])
        )
        return at, self._proved(self._lacking, level, self.proof * level, index)

    def _least_beside(self, omega: Array, level: Array, index: IntArray) -> Array:
        """Return where the minimum beside a frequency lies at a level, rad/s; nan where there is none.

        Its value hardly depends on where, the gain and the phase that lead from there to the critical point do.
        """
        known = np.flatnonzero(np.isfinite(level))
        found = np.full(len(level), np.nan)
        if len(known):
            one = self.at(level[known], index[known])

            def squared(w: Array, row: IntArray) -> Array:
                L = transfer(one.take(row), 1j * w).loop
                return nichols_disc_margin(L, self.criteria.gain_margin, self.criteria.phase_margin) ** 2

            w, aside = omega[known], 1.0 + NARROW * np.maximum(level[known], 1e-6)
            found[known] = least_in(squared, (w / aside, w, w * aside), np.arange(len(known)))[0]
        return found

    def _neutral_candidate(self, low: Array, high: Array, index: IntArray) -> Array:
        """Return where a pole crosses the imaginary axis between two levels; nan where that is not proved."""
        poles = closed_loop_eigenvalues(self.at(np.concatenate([low, high]), np.tile(index, 2)))
        poles = poles.reshape(2, len(index), -1)
        first = np.nanargmax(np.where(poles.imag >= 0.0, poles.real, -np.inf), axis=-1)
        pole = np.take_along_axis(poles, first[..., None], axis=-1)[..., 0]
        share = np.clip(pole[0].real / (pole[0].real - pole[1].real), 0.05, 0.95)
        start = np.maximum((1.0 - share) * pole[0].imag + share * pole[1].imag, 1e-300), _between(low, high, share)
        level = touching_critical_point(lambda y, k: self.at(y, index[k]), start, np.array([low, high]))
        return self._proved(self._growing, level, self.proof * level + 10.0 * NEUTRAL, index)

    def _proved(self, function: Any, level: Array, apart: Array, index: IntArray) -> Array:
        """Return the levels just below which the function is positive and just above which it is not, else nan."""
        known = np.flatnonzero(np.isfinite(level))
        proved = np.full(len(level), np.nan)
        if len(known):
            ends = np.concatenate([np.maximum(level - apart, 0.0)[known], (level + apart)[known]])
            below, above = function(ends, np.tile(index[known], 2)).reshape(2, -1)
            proved[known] = np.where((below > 0.0) & (above <= 0.0), level[known], np.nan)
        return proved


def _between(low: Array, high: Array, share: Array) -> Array:
    """Return a level between two, geometrically but from nothing."""
    return np.where(low > 0.0, np.maximum(low, 1e-300) ** (1.0 - share) * high**share, share * high)


def _supremum(bad: BoolArray, grid: Array, function: Any, candidate: Any = None) -> Array:
    """Return the greatest level that is bad, refined between the last bad level and the next; 0 if none, nan if all.

    Args:
        bad: (size, levels), the verdict on the grid. function: positive where bad, of (level, index).
        candidate: of (low, high, index): a fast way to where the function changes sign, nan where it finds nothing.
    """
    from scipy.optimize import elementwise  # 0.4 s: only when a requirement is wanted

    last = bad.shape[1] - 1 - np.argmax(bad[:, ::-1], axis=1)
    none, all_ = ~np.any(bad, axis=1), bad[:, -1]
    result = np.where(none, 0.0, np.nan)
    rows = np.flatnonzero(~none & ~all_)
    if candidate is not None and len(rows):
        result[rows] = candidate(grid[last[rows]], grid[last[rows] + 1], rows)
        rows = rows[np.isnan(result[rows])]
    if len(rows):
        low, high = grid[last[rows]], grid[last[rows] + 1]
        found = elementwise.find_root(
            function, (low, high), args=(rows,), tolerances={"xrtol": 1e-11, "xatol": 1e-13}, maxiter=200
        )
        result[rows] = np.where(np.asarray(found.success), found.x, high)
    return result
