"""The liquid at rest in a tank: its half section, volume, centre of gravity and free surface."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sloshpy.tank.pieces import Line, Piece, moments, reach
from sloshpy.units import Array, Real

WALL, AXIS, SURFACE = "wall", "axis", "surface"
_FILM = 1e-8  # of the depth: a fill given by volume may end so far above an edge or the top of a wall


class Walled(Protocol):
    """What has walls, from the lowest point up: a shape."""

    @property
    def outer(self) -> tuple[Piece, ...]:
        """The outer wall."""

    @property
    def inner(self) -> tuple[Piece, ...]:
        """The inner wall, or none."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """A piece of the liquid's boundary from `start` to `end` in the piece's own s, and what is there."""

    piece: Piece
    start: float
    end: float
    kind: str

    def point(self, f: Real) -> Array:
        """Return (r, z), shape (2, ...), at shares f of the way."""
        f = np.asarray(f)
        return self.piece.point(self.start * (1.0 - f) + self.end * f)

    def tangent(self, f: float) -> Array:
        """Return the direction of travel at a share f of the way, (r, z), of length 1."""
        way = self.piece.tangent(self.start * (1.0 - f) + self.end * f) * np.sign(self.end - self.start)
        return np.asarray(way / np.hypot(*way))


@dataclass(frozen=True, kw_only=True)
class LiquidSection:
    """The liquid's half section: its boundary once around, from the lowest point along the outer wall.

    volume, m^3; cg_height and depth above the lowest point, m; the surface reaches from inner_radius (0: the axis) to
    radius, m.
    """

    boundary: tuple[Part, ...]
    depth: float
    volume: float
    cg_height: float
    radius: float
    inner_radius: float

    @property
    def surface_inertia(self) -> float:
        """Second moment of area of the free surface about a diameter, m^4."""
        return 0.25 * np.pi * (self.radius**4 - self.inner_radius**4)


def liquid_section(shape: Walled, depth: float) -> LiquidSection:
    """Return the section of the liquid up to a depth in m."""
    outer, inner = _below(shape.outer, depth), _below(shape.inner, depth)
    radius = float(outer[-1].point(1.0)[0])
    top = shape.inner[-1].point(1.0)[1] if shape.inner else 0.0
    reaches_up = top > depth or len(inner) < len(shape.inner)  # a level top just at the surface stays dry
    inner_radius = float(inner[-1].point(1.0)[0]) if inner and reaches_up else 0.0
    low = float(inner[-1].point(1.0)[1]) if inner else 0.0
    on_axis = not reaches_up and low < depth * (1.0 - _FILM)
    # at the top of an inner wall the surface ends on it: a film between them has no mesh
    surface = Line(start=(radius, depth), end=(inner_radius, depth if reaches_up or on_axis else low))
    boundary = [*outer, Part(piece=surface, start=0.0, end=1.0, kind=SURFACE)]
    if on_axis:  # down to the bottom or to the top of the inner wall
        boundary.append(Part(piece=Line(start=(0.0, depth), end=(0.0, low)), start=0.0, end=1.0, kind=AXIS))
    boundary += [Part(piece=p.piece, start=p.end, end=p.start, kind=WALL) for p in reversed(inner)]
    volume, first = moments_below(shape, depth)
    return LiquidSection(
        boundary=tuple(boundary),
        depth=depth,
        volume=volume,
        cg_height=first / volume,
        radius=radius,
        inner_radius=inner_radius,
    )


def _below(wall: tuple[Piece, ...], depth: float) -> list[Part]:
    """Return what of a wall lies below a depth; a step just at the surface stays dry, as does what a film would wet."""
    parts = []
    for piece in wall:
        end = reach(piece, depth)
        level = piece.point(np.array([0.0, end]))[1]
        if end == 0.0 or level[0] >= depth * (1.0 - _FILM):
            break
        parts.append(Part(piece=piece, start=0.0, end=end, kind=WALL))
    return parts


def steps_at(shape: Walled, depth: float) -> list[tuple[float, float]]:
    """Return the radii in m below and above each step that a wall makes just at a depth: the surface takes the first.

    A step is a level part of the outer wall or of an inner one, such as the edge of a sump or the top of a stand pipe.
    """
    found = []
    for wall in (shape.outer, shape.inner):
        radii = [piece.point(np.array([0.0, 1.0]))[0] for piece in wall if _level_at(piece, depth)]
        if radii:
            found.append((float(radii[0][0]), float(radii[-1][1])))
    return found


def _level_at(piece: Piece, depth: float) -> bool:
    z = piece.point(np.array([0.0, 1.0]))[1]
    return bool(np.all(np.abs(z - depth) <= _FILM * depth))


def moments_below(shape: Walled, depth: float) -> tuple[float, float]:
    """Return the volume in m^3 and its first moment about the lowest point in m^4 of what lies below a depth."""
    total = np.zeros(2)
    for wall, sign in ((shape.outer, 1.0), (shape.inner, -1.0)):
        for part in _below(wall, depth):
            total += sign * np.array(moments(part.piece, part.end))
    return float(total[0]), float(total[1])


def depth_of_volume(shape: Walled, volume: float, height: float) -> float:
    """Return the depth in m that a volume in m^3 fills, to the last digits."""
    from scipy.optimize import brentq  # 0.3 s: only where a fill is given by volume

    return float(brentq(lambda h: moments_below(shape, h)[0] - volume, 0.0, height, xtol=1e-300, rtol=1e-14))
