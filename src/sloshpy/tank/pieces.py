"""Pieces of a tank's section: straight lines, arcs of ellipses, curves through points; each from its lower end up."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from sloshpy.units import Array, Real

if TYPE_CHECKING:
    from scipy.interpolate import BSpline, CubicSpline

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(40)  # exact to rounding for half an ellipse
_ENDS = np.array([0.0, 1.0])
EDGE = np.radians(30.0)  # a wall that turns by more at one point has an edge there


class Piece(Protocol):
    """A smooth part of a wall: s in [0, 1] to a point (r, z) in m; a wall's z never falls."""

    @property
    def knots(self) -> Array:
        """Values of s between which the piece is analytic."""

    @property
    def straight(self) -> bool:
        """Whether the piece is a straight line."""

    def point(self, s: Real) -> Array:
        """Return r and z, shape (2, ...), at s of any shape."""

    def tangent(self, s: Real) -> Array:
        """Return dr/ds and dz/ds, shape (2, ...), at s of any shape."""


@dataclass(frozen=True, kw_only=True)
class Line:
    """A straight line from `start` to `end`, (r, z) in m."""

    start: tuple[float, float]
    end: tuple[float, float]

    @property
    def knots(self) -> Array:
        return _ENDS

    @property
    def straight(self) -> bool:
        return True

    def point(self, s: Real) -> Array:
        s = np.asarray(s)  # in this form both ends come out exactly
        return np.stack([a * (1.0 - s) + b * s for a, b in zip(self.start, self.end, strict=True)])

    def tangent(self, s: Real) -> Array:
        return np.stack([np.full(np.shape(s), b - a) for a, b in zip(self.start, self.end, strict=True)])


@dataclass(frozen=True, kw_only=True)
class Arc:
    """An arc of an ellipse about `centre`: r = r_c + A sin t, z = z_c - B cos t, t from t_0 to t_1."""

    centre: tuple[float, float]
    axes: tuple[float, float]  # A, B; A < 0: the side turned to the axis
    t: tuple[float, float]

    @property
    def knots(self) -> Array:
        return _ENDS

    @property
    def straight(self) -> bool:
        return False

    def point(self, s: Real) -> Array:
        (r_c, z_c), (A, B), (t_0, t_1) = self.centre, self.axes, self.t
        t = t_0 + np.asarray(s) * (t_1 - t_0)
        # 2 sin^2(t/2) = 1 - cos t keeps the lowest point at the lowest height exactly
        return np.stack([r_c + A * np.sin(t), (z_c - B) + 2.0 * B * np.sin(0.5 * t) ** 2])

    def tangent(self, s: Real) -> Array:
        (A, B), (t_0, t_1) = self.axes, self.t
        t = t_0 + np.asarray(s) * (t_1 - t_0)
        return (t_1 - t_0) * np.stack([A * np.cos(t), B * np.sin(t)])


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A curve of continuous curvature through points or along them, over the length of the chords between them."""

    spline: "CubicSpline | BSpline"
    knots: Array
    coarse: "Curve | Polygon"  # of a half of the points, or a third, or straight: what it changes, they leave open
    free: "Curve | None"  # the same without being level on the axis; None where it is not

    @property
    def straight(self) -> bool:
        return False

    def point(self, s: Real) -> Array:
        return np.moveaxis(np.asarray(self.spline(np.asarray(s)), dtype=float), -1, 0)

    def tangent(self, s: Real) -> Array:
        return np.moveaxis(np.asarray(self.spline(np.asarray(s), 1), dtype=float), -1, 0)


@dataclass(frozen=True, kw_only=True)
class Polygon:
    """Many short straight lines that hardly turn, as a measured or exported wall has them; over their length."""

    length: Array  # share of the whole, at the points
    points: Array  # (n, 2)

    @property
    def knots(self) -> Array:
        return self.length

    @property
    def straight(self) -> bool:
        return False

    def point(self, s: Real) -> Array:
        return np.stack([np.interp(s, self.length, self.points[:, k]) for k in range(2)])

    def tangent(self, s: Real) -> Array:
        k = np.clip(np.searchsorted(self.length, np.asarray(s), side="right") - 1, 0, len(self.length) - 2)
        slope = np.diff(self.points, axis=0) / np.diff(self.length)[:, None]
        return np.moveaxis(slope[k], -1, 0)


def polygon_through(points: Sequence[tuple[float, float]]) -> Polygon:
    """Return the straight lines through points (r, z) as one piece."""
    p, length = _over_length(points)
    return Polygon(length=length, points=p)


def curve_through(points: Sequence[tuple[float, float]]) -> Curve:
    """Return the curve through at least three points (r, z), level where it crosses the axis without an edge."""
    p, length = _over_length(points)
    coarse: Curve | Polygon = Polygon(length=length, points=p)
    every = np.arange(len(p))
    # a third counted from both ends, so that the chords there, often the longest, are longer in that curve
    third = np.append(every[: len(p) // 2 + 1 : 3], every[: len(p) // 2 : -3])
    for fewer in (np.unique(third), np.unique(np.append(every[::2], every[-1]))):
        if len(fewer) > 3:
            coarse = _level(p[fewer], length[fewer], coarse)
    return _level(p, length, coarse)


def _level(p: Array, length: Array, coarse: "Curve | Polygon") -> Curve:
    """Return the curve through points that goes on in its mirror image beyond the axis, where both meet gently."""
    from scipy.interpolate import CubicSpline  # 0.3 s: only where a contour bends

    free = CubicSpline(length, p, bc_type="not-a-knot")
    plain = Curve(spline=free, knots=length, coarse=coarse, free=None)
    slope = np.abs(free(_ENDS, 1))
    below, above = (p[[0, -1], 0] == 0.0) & (slope[:, 1] < np.tan(0.5 * EDGE) * slope[:, 0])
    if not (below or above):
        return plain
    mirrored = p * [-1.0, 1.0]
    parts, places = [p], [length]
    if below:
        parts.insert(0, mirrored[:0:-1])
        places.insert(0, -length[:0:-1])
    if above:
        parts.append(mirrored[-2::-1])
        places.append(2.0 - length[-2::-1])
    spline = CubicSpline(np.concatenate(places), np.concatenate(parts), bc_type="not-a-knot")
    return Curve(spline=spline, knots=length, coarse=coarse, free=plain)


def curve_along(points: Sequence[tuple[float, float]], intervals: int) -> Curve:
    """Return the curve nearest to many points that scatter, by least squares; it passes through the two ends."""
    from scipy.interpolate import make_lsq_spline  # as above

    p, length = _over_length(points)
    weight = np.ones(len(p))
    weight[[0, -1]] = 1e6

    at = length[np.linspace(0, len(p) - 1, intervals + 1).astype(int)]
    knots = np.concatenate([[0.0], at[1:-1], [1.0]])
    spline = make_lsq_spline(length, p, np.concatenate([[0.0] * 3, knots, [1.0] * 3]), w=weight)
    return Curve(spline=spline, knots=knots, coarse=Polygon(length=length, points=p), free=None)


def _over_length(points: Sequence[tuple[float, float]]) -> tuple[Array, Array]:
    p = np.asarray(points, dtype=float)
    length = np.append(0.0, np.cumsum(np.hypot(*np.diff(p, axis=0).T)))
    return p, length / length[-1]


def reach(piece: Piece, height: float) -> float:
    """Return the largest s up to which a piece stays at or below a height, 0 to 1."""
    z = piece.point(_ENDS)[1]
    if z[1] <= height:
        return 1.0
    if z[0] > height:
        return 0.0
    low, high = 0.0, 1.0
    while True:  # z never falls, so halving finds the crossing, to the last bit
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return low
        if float(piece.point(middle)[1]) <= height:
            low = middle
        else:
            high = middle


def moments(piece: Piece, end: float = 1.0) -> tuple[float, float]:
    """Return pi times the integrals of r^2 dz and z r^2 dz from s = 0 to `end`, m^3 and m^4."""
    knots = np.append(piece.knots[piece.knots < end], end)
    half, middle = 0.5 * np.diff(knots)[:, None], 0.5 * (knots[1:] + knots[:-1])[:, None]
    s = middle + half * _NODES
    r, z = piece.point(s)
    slice_ = np.pi * half * _WEIGHTS * piece.tangent(s)[1] * r**2
    return float(np.sum(slice_)), float(np.sum(z * slice_))
