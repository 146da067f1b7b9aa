"""The damping at which all tanks of a loop are good together, and what each tank needs with the others held there."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sloshpy.case import Case, Criteria
from sloshpy.damping import DampingLaw
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import NEUTRAL
from sloshpy.dynamics.response import transfer
from sloshpy.stability.margins import loop_margins
from sloshpy.stability.nichols import nichols_disc_margin
from sloshpy.stability.required_damping import (
    LEVELS,
    MOST_RATIO,
    RequiredDamping,
    damping_levels,
    loop_required_damping,
    supremum,
)
from sloshpy.stability.touching import with_ratio
from sloshpy.units import Array, BoolArray

SHORT = 1e-3  # relative: far more than the search leaves of a disc margin that is reached
BESIDE = 1e-6  # relative: a damping just above a requirement


def joint_damping(case: Case) -> Array:
    """Return the damping at which all tanks together meet the disc margin, one ratio for each tank.

    Every tank's law is read at one common slosh amplitude: the least above which, for every larger one, the loop is
    stable and no slosh-related disc margin is below the criterion. The five steps hold the other tanks there, since in
    a limit cycle none of them is at rest. Where the laws do not suffice at any amplitude (a constant too small, data
    that end too early), each tank gets at least the least common ratio that does, so that a tank is judged by its own
    need and not by another's shortage. One tank alone keeps its small-amplitude damping.
    """
    laws = [tank.damping for tank in case.vehicle.tanks]
    small = open_loop(case).damping
    if len(laws) < 2:
        return small
    reaches = [_reach(law) for law in laws]
    most = max([reach for reach in reaches if np.isfinite(reach)], default=0.0)
    axis = NEUTRAL * max(float(tank.frequency) for tank in case.vehicle.tanks)
    grid = damping_levels(LEVELS)

    def at_amplitude(amplitude: Array) -> Array:
        columns = [law.ratio(np.clip(amplitude, law.smallest_amplitude, law.largest_amplitude)) for law in laws]
        return np.minimum(np.stack(columns, axis=-1), MOST_RATIO)

    def lacking(damping: Array) -> Array:
        found = loop_margins(open_loop(case, damping), case.criteria, crossings=False)
        least = np.abs(found.slosh_disc_margin(*range(len(laws)))[0])
        short = np.where(np.isinf(least), -1.0, case.criteria.disc_margin - least)
        return np.where(found.growth < axis, short, np.maximum(np.abs(short), case.criteria.disc_margin))

    def least_of(damping: Callable[[Array], Array], levels: Array) -> float:
        bad = lacking(damping(levels))[None, :] > 0.0
        return float(supremum(bad, levels, lambda level, _: lacking(damping(level)))[0])

    if most > 0.0:
        amplitude = least_of(at_amplitude, grid * most)
        if not np.isnan(amplitude):
            return at_amplitude(np.asarray(amplitude))
    given = at_amplitude(np.asarray(most))

    def at_least(ratio: Array) -> Array:
        return np.maximum(given, np.asarray(ratio)[..., None])

    ratio = least_of(at_least, grid * MOST_RATIO)
    return given if np.isnan(ratio) else at_least(np.asarray(ratio))


def _reach(law: DampingLaw) -> float:
    """Return the amplitude in m at which a law's data end or it becomes critical; not finite for a constant."""
    return float(law.amplitude(MOST_RATIO)) if np.isinf(law.largest_amplitude) else law.largest_amplitude


def joint_required_damping(
    loop: Loop, criteria: Criteria, tank: int, disc_margin: float, levels: int = LEVELS
) -> RequiredDamping:
    """Return the least damping of one tank of a loop or of a batch, the minima that it shares with others counted.

    Two coupled tanks may share a minimum of eq 24: with more damping of one it becomes the other's before the disc
    margin is reached. That damping meets no criterion, so the minima of the tanks that are then short count too. Where
    no margin is reached even so, the tank's own requirement is returned; see `falls_short`.

    Args:
        loop: the other tanks damped as all together need. criteria: gain and phase margin of eq 24.
        tank: its number. disc_margin: threshold of eq 24. levels: how many dampings are scanned.
    """
    own = loop_required_damping(loop, criteria, tank, disc_margin, levels)
    if not loop.batch:
        return _counting_shared(own, criteria, levels)
    required, omega = own.required.copy(), own.omega.copy()
    for k in np.ndindex(loop.batch):
        row = np.asarray(np.ravel_multi_index(k, loop.batch))
        one = replace(own, neutral=own.neutral[k], required=required[k], omega=omega[k], source=loop.take(row))
        found = _counting_shared(one, criteria, levels)
        required[k], omega[k] = found.required, found.omega
    return replace(own, required=required, omega=omega)


def _counting_shared(own: RequiredDamping, criteria: Criteria, levels: int) -> RequiredDamping:
    """Return what one tank of one loop needs from what its own minima ask."""
    tank, found = own.counted[0], own
    while float(found.required) > 0.0 and not _reached(found, criteria):
        more = _others_short(found, criteria)
        if not more:
            return own
        beside = (*found.counted[1:], *more)
        found = loop_required_damping(own.source, criteria, tank, own.disc_margin, levels, shared_with=beside)
    return own if np.isnan(found.required) else found


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


def _reached(found: RequiredDamping, criteria: Criteria) -> bool:
    distance = float(_distance(_at(found, float(found.required)), found.omega, criteria))
    return abs(distance - found.disc_margin) <= SHORT * found.disc_margin  # False for nan


def _distance(loop: Loop, omega: Array, criteria: Criteria) -> Array:
    L = transfer(loop, 1j * np.asarray(omega)).loop
    return nichols_disc_margin(L, criteria.gain_margin, criteria.phase_margin)


def _others_short(found: RequiredDamping, criteria: Criteria) -> tuple[int, ...]:
    """Return the tanks that do not count yet and are short just above the required damping."""
    rest = [j for j in range(len(found.source.plant.tanks)) if j not in found.counted]
    if not rest:
        return ()
    above = loop_margins(_at(found, float(found.required) * (1.0 + BESIDE)), criteria, crossings=False)
    least = found.disc_margin * (1.0 - SHORT)
    return tuple(j for j in rest if np.abs(above.slosh_disc_margin(j)[0]) < least)


def _at(found: RequiredDamping, ratio: float) -> Loop:
    return with_ratio(found.source, np.asarray(0), found.counted[0], np.asarray(ratio))
