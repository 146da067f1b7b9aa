"""Slosh masses and damping of a draining tank along a phase, from its shape."""

import re
from dataclasses import dataclass

import numpy as np

from sloshpy.damping import AnyDamping
from sloshpy.tank import Fill, Tank, slosh_masses_history, tank_damping
from sloshpy.units import Array


@dataclass(frozen=True, kw_only=True)
class Filled:
    """The first slosh mass of a tank along a phase, (T,) each; SI.

    laws: damping by the tank's own formulas, () where it gives none. sources: what the laws rest on, at the first time.
    doubts: what to know before the masses are used, each kind with the first time that it is about and at how many.
    missing: the first time without a slosh mass and why, None where there is one at every time.
    """

    slosh_mass: Array
    station: Array
    frequency: Array
    radius: Array
    fraction: Array
    laws: tuple[AnyDamping, ...]
    sources: tuple[str, ...]
    doubts: tuple[tuple[int, int, str], ...]
    missing: tuple[int, str] | None


def filled(tank: Tank, fill: tuple[str | float | Fill, ...], acceleration: Array) -> Filled:
    """Return the first slosh mass of a tank at several fills, each at its own axial acceleration.

    Args:
        tank: shape, liquid and bottom station. fill: (T,), as in `slosh_masses_history`. acceleration: (T,), m/s^2.

    Raises:
        ValueError: the tank has no bottom station.
    """
    if tank.bottom_station is None:
        raise ValueError("has no bottom_station")
    course = slosh_masses_history(tank, fill, acceleration)
    missing = next(((k, why) for k, why in enumerate(course.reason) if why), None)
    if missing is None:
        height = course.of_modes("spring_height")[:, 0]
        gone = np.flatnonzero(~np.isfinite(height))
        missing = (int(gone[0]), "its first mode has no slosh mass") if len(gone) else None
    radius = np.array([np.nan if row is None else row.section.radius for row in course.rows])
    dampings = [None if row is None else tank_damping(row) for row in course.rows]
    known = [one is not None and one.known for one in dampings]
    whole = all(known)
    first = dampings[0] if whole else None
    why = () if whole or not any(known) else ("its damping is known at some fills only and not used",)
    return Filled(
        slosh_mass=course.of_modes("slosh_mass")[:, 0],
        station=tank.bottom_station + course.of_modes("spring_height")[:, 0],
        frequency=course.of_modes("frequency")[:, 0],
        radius=radius,
        fraction=course.fraction,
        laws=tuple(one.law for one in dampings if one is not None) if whole else (),
        sources=why if first is None else first.sources,
        doubts=_doubts([() if row is None else row.reasons for row in course.rows]),
        missing=missing,
    )


def _doubts(reasons: list[tuple[str, ...]]) -> tuple[tuple[int, int, str], ...]:
    """Return each kind of reason, its numbers apart, by the first row that has it and the count of rows."""
    kinds: dict[str, list[tuple[int, str]]] = {}
    for k, row in enumerate(reasons):
        for reason in row:
            kinds.setdefault(re.sub(r"\d[\d.e+-]*", "", reason), []).append((k, reason))
    return tuple((found[0][0], len(found), found[0][1]) for found in kinds.values())
