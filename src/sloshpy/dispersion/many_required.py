"""Required damping of many loops that differ a little: found on a coarse grid, refined, and proved for each.

A coarse grid over damping and frequency places each loop's requirement, Newton's method refines it, and the exact
margins prove it: just below, the tank's disc margin is too small or the loop grows; just above it is met. Above that
the grid and the poles must show no second place. Whatever is not proved goes through the search of `required_damping`.
"""

import functools
from dataclasses import dataclass

import numpy as np

from sloshpy.case import Criteria
from sloshpy.dynamics.growth import greatest_growth
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.poles import NEUTRAL
from sloshpy.dynamics.response import REFERENCE_DAMPING, at_reference, of_one_damping
from sloshpy.stability import loop_margins, loop_required_damping, nichols_disc_margin
from sloshpy.stability.damping_search import MOST_RATIO, PROOF
from sloshpy.stability.touching import touching_level, with_ratio
from sloshpy.units import Array, BoolArray, IntArray

LEVELS = np.geomspace(4e-3, MOST_RATIO, 13)  # damping ratios of the grid
SPAN = np.geomspace(0.3, 3.0, 128)  # frequencies of the grid over the tank's own; a resonance of 1 % is seen
LEAST = 1e-2  # a requirement below this is left to the search: its resonance is narrower than the grid
STRAY = 1.0  # levels beyond its own two in which a requirement is taken: the grid misses the least distance a little
CLEAR = 1.02  # of the threshold: what the grid must show above a requirement
SOME = 50  # loops whose grid is worked on at a time: it stays in the processor's cache


def many_required(loop: Loop, criteria: Criteria, tank: int) -> tuple[Array, Array]:
    """Return the damping that a tank requires in each of a batch of loops (N,), and the frequency there in rad/s.

    As `required_damping`, whose words hold: 0 where none is needed, nan where none suffices.
    """
    size = int(np.prod(loop.batch))
    required, omega = np.full(size, np.nan), np.full(size, np.nan)
    rows = np.arange(size)
    found = _placed(loop, criteria, tank)
    for start in found.starts:  # the second where the first did not settle
        waiting = rows[np.isfinite(found.low[rows])]
        if not len(waiting):
            break
        level, reach = criteria.disc_margin, STRAY * np.log(LEVELS[1] / LEVELS[0])
        ends = np.array([found.low[waiting] * np.exp(-reach), found.high[waiting] * np.exp(reach)])
        loops = functools.partial(_damped, loop, tank, waiting)
        _, ratio = touching_level(loops, level, criteria, (start[0][waiting], start[1][waiting]), ends)
        sound = np.isfinite(ratio) & (ratio >= LEAST) & (ratio < LEVELS[-1])
        waiting, ratio = waiting[sound], ratio[sound]
        proved, at = _proved(loop, criteria, tank, ratio, waiting)
        required[waiting[proved]], omega[waiting[proved]] = ratio[proved], at[proved]
        rows = rows[np.isnan(required[rows])]
    for row in rows:
        one = loop_required_damping(loop.take(np.array([row])), criteria, tank, criteria.disc_margin)
        required[row], omega[row] = one.required[0], one.omega[0]
    return required, omega


def _damped(loop: Loop, tank: int, rows: IntArray, ratio: Array, k: IntArray) -> Loop:
    return with_ratio(loop, rows[k], tank, ratio)


@dataclass(frozen=True)
class _Placed:
    """Neighbouring levels about each requirement, nan where unclear, and starts of frequency and damping."""

    low: Array
    high: Array
    starts: tuple[tuple[Array, Array], ...]


def _placed(loop: Loop, criteria: Criteria, tank: int) -> _Placed:
    """Return where the grid shows each loop's requirement, if it shows one place alone."""
    size, last_level = int(np.prod(loop.batch)), len(LEVELS) - 1
    low, high, middle, guess, at_high, at_low = (np.full(size, np.nan) for _ in range(6))
    for k in range(0, size, SOME):
        rows = np.arange(k, min(k + SOME, size))
        least, where = _grid(loop.take(rows), criteria, tank)
        bad = least < criteria.disc_margin
        last = last_level - np.argmax(bad[:, ::-1], axis=1)
        found = np.flatnonzero(np.any(bad, axis=1) & ~bad[:, -1])
        next_up = LEVELS[np.minimum(last + 1, last_level)]
        unclear = (LEVELS[None, :] > next_up[:, None]) & ~(least >= CLEAR * criteria.disc_margin)
        found = found[~np.any(unclear, axis=1)[found]]
        one, at = rows[found], last[found]
        low[one], high[one] = LEVELS[at], LEVELS[at + 1]
        at_low[one], at_high[one] = where[found, at], where[found, at + 1]
        below, above = least[found, at], least[found, at + 1]
        middle[one] = np.sqrt(low[one] * high[one])
        guess[one] = low[one] * (high[one] / low[one]) ** ((criteria.disc_margin - below) / (above - below))
    known = np.flatnonzero(np.isfinite(low))
    row, level = np.nonzero(LEVELS[None, :] >= high[known][:, None])
    grows = _growing(loop, tank, LEVELS[level], known[row])
    low[known[row[grows]]] = np.nan  # stable at the requirement, yet not above it: for the search
    return _Placed(low, high, ((at_high, middle), (at_low, guess), (at_high, guess)))


def _grid(loop: Loop, criteria: Criteria, tank: int) -> tuple[Array, Array]:
    """Return the least distance of eq 24 over the grid's frequencies at its levels, (N, levels), and where, rad/s."""
    w = np.broadcast_to(loop.plant.tank_frequency[..., tank], loop.batch)
    omega = w[:, None] * SPAN
    along, s = loop.along(), 1j * omega
    if loop.plant.mass.shape[-1] == 2:
        Y_b, Y_a, z_b, z_a = at_reference(along, s)
        Y_a, z_b, z_a = Y_a[..., 0], z_b[..., 0], z_a[..., 0, 0]
    else:
        Y_b, Y_a, z_b, z_a = of_one_damping(along, tank, s)
    driven, own = s * Y_a * z_b, s * z_a
    least, where = np.empty((len(w), len(LEVELS))), np.empty((len(w), len(LEVELS)))
    for k, level in enumerate(LEVELS):
        d = 2.0 * (level - REFERENCE_DAMPING) * w[:, None]
        with np.errstate(all="ignore"):  # an undamped pole met exactly: not finite, and so not placed
            L = driven * d / (1.0 + own * d) - Y_b
            distance = nichols_disc_margin(np.asarray(L), criteria.gain_margin, criteria.phase_margin)
        at = np.argmin(distance, axis=1)
        least[:, k], where[:, k] = distance[np.arange(len(w)), at], omega[np.arange(len(w)), at]
    return least, where


def _proved(loop: Loop, criteria: Criteria, tank: int, ratio: Array, rows: IntArray) -> tuple[BoolArray, Array]:
    """Return where the verdict changes from bad to good within `PROOF` of a damping, and the frequency just above."""
    if not len(rows):
        return np.zeros(0, dtype=bool), np.zeros(0)
    below = _good(loop, criteria, tank, ratio * (1.0 - PROOF), rows)[0]
    above, omega = _good(loop, criteria, tank, ratio * (1.0 + PROOF), rows)
    return ~below & above, omega


def _good(loop: Loop, criteria: Criteria, tank: int, ratio: Array, rows: IntArray) -> tuple[BoolArray, Array]:
    found = loop_margins(with_ratio(loop, rows, tank, ratio), criteria, crossings=False)
    margin, omega = found.slosh_disc_margin(tank)
    stable = ~_growing(loop, tank, ratio, rows, found.growth)
    return stable & (np.abs(margin) >= criteria.disc_margin), omega


def _growing(loop: Loop, tank: int, ratio: Array, rows: IntArray, growth: Array | None = None) -> BoolArray:
    """Return whether loops grow at dampings; a neutral pole, which rounding moves, does not."""
    if not len(rows):
        return np.zeros(0, dtype=bool)
    one = with_ratio(loop, rows, tank, ratio)
    axis = NEUTRAL * np.max(one.plant.tank_frequency, axis=-1)
    return np.asarray((greatest_growth(one) if growth is None else growth) >= axis)
