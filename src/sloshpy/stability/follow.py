"""Following closed-loop poles from one case to the next without mistaking one for another.

A step from one case to the next is trusted where every pole moves by less than half its distance to the nearest other
pole and keeps its shape (MAC > 0.9). Otherwise it is halved: modes that nearly meet turn into each other within a
narrow range (veering), and a step over that range, however alike the shapes on both sides, would pass for a crossing.
"""

from dataclasses import dataclass

import numpy as np

from sloshpy.case import Case
from sloshpy.dynamics.loop import open_loop
from sloshpy.dynamics.poles import Poles, closed_loop_poles
from sloshpy.stability.between import NotAlike, between
from sloshpy.stability.mode_shape import modal_assurance, state_shape
from sloshpy.units import Array, BoolArray, ComplexArray, IntArray

SAME_SHAPE = 0.9  # MAC
NEAR = 0.5  # of the distance to the nearest other pole: nearer to its own old place than to any other's
STILL = 1e-9  # of a pole's size: it has not moved, whatever stands beside it
HALVINGS = 14
MOST_STEPS = 300  # between two given cases; more than that and the modes coincide over a range


@dataclass(frozen=True, kw_only=True)
class Station:
    """The closed-loop poles of one case on the way: those that are finite, with their unit shapes in rows."""

    case: Case
    damping: Array
    poles: Poles
    value: ComplexArray
    kept: IntArray
    shape: ComplexArray


def station(case: Case, damping: Array) -> Station:
    """Return the closed-loop poles of one case at given slosh damping ratios, with their shapes."""
    loop = open_loop(case, damping)
    poles = closed_loop_poles(loop)
    kept = np.flatnonzero(np.isfinite(poles.value))
    shapes = np.array([state_shape(loop, complex(p)) for p in poles.value[kept]])
    return Station(case=case, damping=damping, poles=poles, value=poles.value[kept], kept=kept, shape=shapes)


def halfway(one: Station, other: Station, part: float = 0.5) -> Station:
    """Return the poles at a fraction of the way between two stations.

    Raises:
        NotAlike: there is no case between them.
    """
    return station(between(one.case, other.case, part), (1.0 - part) * one.damping + part * other.damping)


@dataclass(frozen=True, kw_only=True)
class Link:
    """Which pole of one station is which of the next: `pairs` that are certain, `reason` where some are not."""

    pairs: dict[int, int]
    reason: str = ""


def followed(one: Station, other: Station) -> Link:
    """Return which pole of one station becomes which of the other, halving the way as often as it takes."""
    return _followed(one, other, HALVINGS, [MOST_STEPS])


def _followed(one: Station, other: Station, halvings: int, left: list[int]) -> Link:
    pairs, sure, alike = _matched(one, other)
    if np.all(sure):
        return Link(pairs={int(i): int(k) for i, k in pairs})
    if halvings == 0 or left[0] <= 0:
        # as near as it gets: two poles side by side that do not turn into each other keep their shapes
        certain = {int(i): int(k) for (i, k), same in zip(pairs, alike, strict=True) if same}
        return Link(pairs=certain, reason="" if np.all(alike) else "modes coincide and change their shapes there")
    left[0] -= 1
    try:
        middle = halfway(one, other)
    except NotAlike as error:
        certain = {int(i): int(k) for (i, k), good in zip(pairs, sure, strict=True) if good}
        return Link(pairs=certain, reason=str(error))
    first = _followed(one, middle, halvings - 1, left)
    second = _followed(middle, other, halvings - 1, left)
    through = {i: second.pairs[k] for i, k in first.pairs.items() if k in second.pairs}
    return Link(pairs=through, reason=first.reason or second.reason)


def _matched(one: Station, other: Station) -> tuple[IntArray, BoolArray, BoolArray]:
    """Return the likeliest pairs (K, 2), which of them are sure, and which keep their shape.

    Where the numbers differ (two real poles become a pair, a pole of the delay comes up) the rest have no partner.
    """
    from scipy.optimize import linear_sum_assignment  # 0.3 s: only when modes are followed

    mac = modal_assurance(one.shape, other.shape)
    moved = np.abs(one.value[:, None] - other.value[None, :])
    size = np.maximum(np.abs(one.value[:, None]), np.abs(other.value[None, :]))
    i, k = linear_sum_assignment(moved / np.maximum(size, 1e-300) + 1.0 - mac)
    room = np.minimum(_nearest(one.value)[i], _nearest(other.value)[k])
    alike = mac[i, k] > SAME_SHAPE
    still = moved[i, k] <= STILL * size[i, k]
    return np.stack([i, k], axis=-1), still | (alike & (moved[i, k] < NEAR * room)), still | alike


def _nearest(value: ComplexArray) -> Array:
    """Return each pole's distance to the nearest other one, conjugates among them but not its own."""
    apart = np.abs(value[:, None] - value[None, :])
    np.fill_diagonal(apart, np.inf)
    return np.asarray(np.min(apart, axis=-1, initial=np.inf))
