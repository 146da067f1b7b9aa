"""The damping at which all tanks of a loop are good together, and what each tank needs with the others held there."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sloshpy.case import Case, Criteria
from sloshpy.damping import DampingLaw
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import NEUTRAL
from sloshpy.dynamics.response import transfer
from sloshpy.stability.damping_search import LEVELS, MOST_RATIO, DampingSearch, damping_levels
from sloshpy.stability.margins import loop_margins
from sloshpy.stability.nichols import nichols_disc_margin
from sloshpy.stability.required_damping import RequiredDamping, loop_required_damping
from sloshpy.stability.touching import with_ratio
from sloshpy.units import Array, BoolArray, IntArray

SHORT = 1e-3  # relative: far more than the search leaves of a disc margin that is reached
NOTICED = 1e-2  # relative: by how much another tank falls short of the disc margin before it asks more of a tank
EXACT = 1e-10  # relative: so near to the damping that is needed together, for no tank is to be short there
BESIDE = 1e-6  # relative: a damping just above a requirement


def joint_damping(case: Case, levels: int = LEVELS) -> Array:
    """Return the damping at which all tanks together meet the disc margin, one ratio for each tank, (..., n_tanks).

    Every tank's law is read at one common slosh amplitude: the least above which, for every larger one, the loop is
    stable and no slosh-related disc margin is below the criterion. The five steps hold the other tanks there, since in
    a limit cycle none of them is at rest. Where the laws do not suffice at any amplitude (a constant too small, data
    that end too early), each tank gets at least the least common ratio that does, so that a tank is judged by its own
    need and not by another's shortage. One tank alone keeps its small-amplitude damping.

    Args:
        case: vehicle and autopilot; their fields may carry leading axes.
        levels: how many dampings are scanned.
    """
    laws = [tank.damping for tank in case.vehicle.tanks]
    loop = open_loop(case)
    size = int(np.prod(loop.batch))
    if len(laws) < 2:
        return np.asarray(np.broadcast_to(loop.damping, (*loop.batch, len(laws))))
    most = max([reach for law in laws if np.isfinite(reach := _reach(law))], default=0.0)

    def at_amplitude(amplitude: Array) -> Array:
        columns = [law.ratio(np.clip(amplitude, law.smallest_amplitude, law.largest_amplitude)) for law in laws]
        return np.asarray(np.minimum(np.stack(columns, axis=-1), MOST_RATIO))

    needed = np.broadcast_to(at_amplitude(np.asarray(most)), (size, len(laws))).copy()
    rows = np.arange(size)
    if most > 0.0:
        share = _least_level(loop, case.criteria, rows, levels, lambda level: at_amplitude(level / MOST_RATIO * most))
        known = np.isfinite(share)
        needed[known], rows = at_amplitude(share[known] / MOST_RATIO * most), rows[~known]
    if len(rows):
        given = needed[rows[0]]  # what the laws give at most: no amplitude was enough

        def at_least(ratio: Array) -> Array:
            return np.asarray(np.maximum(given, ratio[..., None]))

        ratio = _least_level(loop, case.criteria, rows, levels, at_least)
        needed[rows] = np.where(np.isnan(ratio)[:, None], given, at_least(ratio))
    return needed.reshape(*loop.batch, len(laws))


def _least_level(
    loop: Loop, criteria: Criteria, rows: IntArray, levels: int, damping: Callable[[Array], Array]
) -> Array:
    """Return the level up to `MOST_RATIO` above which loops of a flattened batch are good; nan where none is.

    damping: of levels, the ratios of all tanks.
    """
    tanks = tuple(range(len(loop.plant.tanks)))
    search = DampingSearch(
        at=lambda level, k: replace(loop.take(rows[k]), damping=damping(level)),
        size=len(rows),
        moved=tanks,
        counted=tanks,
        criteria=criteria,
        threshold=criteria.disc_margin,
        axis=NEUTRAL * float(np.max(loop.plant.tank_frequency)),
        proof=EXACT,
    )
    return search.good_from(damping_levels(levels))


def _reach(law: DampingLaw) -> float:
    """Return the amplitude in m at which a law's data end or it is slosh no more; not finite for a constant."""
    return float(law.amplitude(MOST_RATIO)) if np.isinf(law.largest_amplitude) else law.largest_amplitude


def joint_required_damping(
    loop: Loop, criteria: Criteria, tank: int, disc_margin: float, levels: int = LEVELS
) -> RequiredDamping:
    """Return the least damping of one tank of a loop or of a batch, with what coupled tanks ask of it.

    A tank damps more than the minima of eq 24 that are its own: with little of it another tank's may fall short, or its
    own becomes another's before the disc margin is reached. Where another tank is short by more than a hundredth at
    what the tank's own minima require, its minima count too: for all larger dampings, or else up to the damping of
    `loop`, at which all tanks together meet the margin. One that is short even there, or whose minimum ends before it
    reaches the margin, counts for nothing.

    Args:
        loop: all tanks damped as together they need. criteria: gain and phase margin of eq 24.
        tank: its number. disc_margin: threshold of eq 24. levels: how many dampings are scanned.
    """
    own = loop_required_damping(loop, criteria, tank, disc_margin, levels)
    short = _short(loop, criteria, tank, own.required * (1.0 + BESIDE), disc_margin)
    rows = np.flatnonzero(np.any(short, axis=-1).ravel())
    if not loop.batch:
        return _counting_others(own, short, criteria, levels)
    neutral, required, omega = own.neutral, own.required.copy(), own.omega.copy()
    for row in rows:
        k = np.unravel_index(row, loop.batch)
        one = replace(own, neutral=neutral[k], required=required[k], omega=omega[k], source=loop.take(np.asarray(row)))
        found = _counting_others(one, short[k], criteria, levels)
        required[k], omega[k] = found.required, found.omega
    return replace(own, required=required, omega=omega)


def _counting_others(own: RequiredDamping, short: BoolArray, criteria: Criteria, levels: int) -> RequiredDamping:
    """Return what one tank of one loop needs, beginning with what its own minima require, where `short` are short."""
    loop, (tank, *_), wanted = own.source, own.counted, own.disc_margin
    together = loop.damping[tank]
    found = own
    while more := [int(j) for j in np.flatnonzero(short) if j not in found.counted]:
        wider = _wider(found, criteria, levels, (*found.counted[1:], *more), np.inf)
        if wider is None:
            never = _short(loop, criteria, tank, together, wanted)
            more = [j for j in more if not never[j]]
            wider = _wider(found, criteria, levels, (*found.counted[1:], *more), float(together)) if more else None
        if wider is None:
            break
        found = wider
        short = _short(loop, criteria, tank, found.required * (1.0 + BESIDE), wanted)
    return found if found is own else replace(found, own=own)


def _wider(
    found: RequiredDamping, criteria: Criteria, levels: int, shared_with: tuple[int, ...], until: float
) -> RequiredDamping | None:
    """Return the requirement with the minima of others counted; None where it is no margin reached.

    Another tank's minimum may end right where all tanks meet the margin; rounding then decides whether it is short.
    """
    tank, wanted = found.counted[0], found.disc_margin
    wider = loop_required_damping(found.source, criteria, tank, wanted, levels, shared_with, until)
    if np.isnan(wider.required):
        return None
    threshold = with_ratio(wider.source, np.asarray(0), tank, np.asarray(wider.required))
    reached = abs(_distance(threshold, wider.omega, criteria) - wanted) <= SHORT * wanted  # False for nan
    return wider if reached else None


def _short(loop: Loop, criteria: Criteria, tank: int, ratio: Array, disc_margin: float) -> BoolArray:
    """Return which other tanks are noticeably short at a damping of one, (..., n_tanks)."""
    n = len(loop.plant.tanks)
    size = int(np.prod(loop.batch))
    ratio = np.asarray(ratio).ravel()
    short = np.zeros((size, n), dtype=bool)
    known = np.flatnonzero(np.isfinite(ratio))
    if n > 1 and len(known):
        found = loop_margins(with_ratio(loop, known, tank, ratio[known]), criteria, crossings=False)
        for j in range(n):
            short[known, j] = np.abs(found.slosh_disc_margin(j)[0]) < disc_margin * (1.0 - NOTICED)
    short[:, tank] = False
    return short.reshape(*loop.batch, n)


def falls_short(threshold: Loop, omega: Array, criteria: Criteria, disc_margin: float) -> BoolArray:
    """Whether loops at their required damping pass nearer than the disc margin, or have no minimum that counts.

    Then the minimum that set it ends there or becomes another mode's; on which side of its end a damping lies is
    rounding, and no oscillation of the tank follows from it.

    Args:
        threshold: one loop or a batch, at the required dampings.
        omega: frequencies of their least minima that count, rad/s; nan where there is none.
        criteria: gain and phase margin of eq 24. disc_margin: the threshold.
    """
    return np.asarray(~(_distance(threshold, omega, criteria) >= disc_margin * (1.0 - SHORT)))


def _distance(loop: Loop, omega: Array, criteria: Criteria) -> Array:
    """Return eq 24 at frequencies in rad/s; nan where there is none."""
    with np.errstate(invalid="ignore"):
        L = transfer(loop, 1j * np.asarray(omega)).loop
    return nichols_disc_margin(L, criteria.gain_margin, criteria.phase_margin)
