"""A mesh of triangles in the liquid's half section, with curved walls and finer where the solution is not smooth."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.errors import OutsideValidity
from sloshpy.tank.liquid import AXIS, SURFACE, LiquidSection, Part
from sloshpy.units import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from skfem import MeshTri

_EDGES = 2.6  # edges along the square root of the section's area, at first
_TURN = np.radians(35.0)  # most that a wall turns along one edge, at first
_DEEP = 0.35
_BULGE = 1e-3  # of an edge's length
FINEST = 1e-6  # relative, the tolerance that corners are graded for where none is given


@dataclass(frozen=True, kw_only=True)
class SectionMesh:
    """Straight triangles with each boundary vertex's place on the section's boundary.

    place: (n_vertices,), part number plus share of the way along it; nan inside. Lengths are in units of `scale`, m.
    """

    section: LiquidSection
    scale: float
    mesh: "MeshTri"
    place: Array

    def point(self, place: Array) -> Array:
        """Return the points (2, ...) at places on the boundary."""
        place = np.asarray(place)
        parts = self.section.boundary
        number = np.clip(np.floor(place).astype(int), 0, len(parts) - 1)
        found = np.empty((2, *place.shape))
        for k in np.unique(number):
            found[:, number == k] = parts[k].point((place - k)[number == k])
        return found / self.scale

    def between(self, a: IntArray, b: IntArray) -> tuple[Array, Array]:
        """Return the places of two neighbouring boundary vertices, both on one part."""
        n = len(self.section.boundary)
        first, last = self.place[a].copy(), self.place[b].copy()
        first[(first == 0.0) & (last >= n - 1)] = n  # where the boundary closes
        last[(last == 0.0) & (first >= n - 1)] = n
        return first, last

    @property
    def surface(self) -> IntArray:
        """Facets on the free surface."""
        return self.facets_of(SURFACE)

    def facets_of(self, kind: str) -> IntArray:
        """Return the facets on the parts of the boundary of one kind: wall, axis or surface."""
        facets = self.mesh.boundary_facets()
        first, last = self.between(*self.mesh.facets[:, facets])
        of_kind = np.array([part.kind == kind for part in self.section.boundary])
        return np.asarray(facets[of_kind[np.floor(0.5 * (first + last)).astype(int)]])

    def refined(self, marked: IntArray) -> "SectionMesh":
        """Return the mesh with the marked triangles halved or quartered; new boundary vertices lie on the wall."""
        old = self.mesh
        new = old.refined(marked)
        place = np.concatenate([self.place, np.full(new.p.shape[1] - old.p.shape[1], np.nan)])
        facets = new.facets[:, new.boundary_facets()]
        fresh = np.unique(facets[facets >= old.p.shape[1]])
        points = new.p.copy()
        mid = replace(self, mesh=new, place=place)
        order = np.argsort(facets.ravel(), kind="stable")
        ends = facets[::-1].ravel()[order]
        at = np.searchsorted(facets.ravel()[order], fresh)
        first, last = self.between(ends[at], ends[at + 1])  # both are old: one refinement halves an edge once
        place[fresh] = 0.5 * (first + last)
        points[:, fresh] = mid.point(place[fresh])
        return replace(self, mesh=replace(new, doflocs=points), place=place)


def first_mesh(section: LiquidSection, tolerance: float = FINEST) -> SectionMesh:
    """Return a coarse mesh of the section, finer at corners where the solution is not smooth.

    tolerance: relative, what the corners may leave of frequency, mass and the rest.

    Raises:
        OutsideValidity: the section is too thin or too sharp for a mesh.
    """
    scale = section.radius
    place = _first_places(section, scale)
    for _ in range(30):
        made = _triangles(section, scale, place)
        if isinstance(made, SectionMesh):
            return _graded(made, tolerance)
        place = np.unique(np.concatenate([place, made]))
        if len(place) > 4000:
            break
    raise OutsideValidity("the liquid's section cannot be meshed: it is too thin or too sharp somewhere")


def _first_places(section: LiquidSection, scale: float) -> Array:
    """Return the places of the boundary vertices: edges no longer than a target, walls that turn little along one."""
    f = np.linspace(0.0, 1.0, 513)
    outlines = [part.point(f) / scale for part in section.boundary]
    z, r = np.concatenate([o[1] for o in outlines]), np.concatenate([o[0] for o in outlines])
    area = abs(0.5 * float(np.sum(r * np.roll(z, -1) - np.roll(r, -1) * z)))
    target = np.sqrt(area) / _EDGES
    places = []
    for k, (part, outline) in enumerate(zip(section.boundary, outlines, strict=True)):
        step = np.diff(outline, axis=1)
        length = np.append(0.0, np.cumsum(np.hypot(*step)))
        turned = np.zeros(len(f))
        if not part.piece.straight:
            way = np.unwrap(np.arctan2(step[1], step[0]))
            turned[1:-1] = np.cumsum(np.abs(np.diff(way)))
            turned[-1] = turned[-2]
        effort = length / target + turned / _TURN
        count = max(1, int(np.ceil(effort[-1])))
        places.append(k + np.interp(np.linspace(0.0, effort[-1], count + 1), effort, f)[:-1])
    return np.concatenate(places)


def _triangles(section: LiquidSection, scale: float, place: Array) -> SectionMesh | Array:
    """Return the mesh on these boundary vertices, or the places of more vertices that it needs."""
    from scipy.spatial import Delaunay, QhullError  # 0.2 s, and scikit-fem 0.8 s: only where a shape needs them
    from skfem import MeshTri

    empty = SectionMesh(section=section, scale=scale, mesh=None, place=place)
    edge = empty.point(place)
    after = np.roll(np.arange(len(place)), -1)
    inside = _inside(edge, after)
    p = np.concatenate([edge, inside], axis=1)
    bulged = edge + _bulge(empty, edge)
    apart = np.concatenate([bulged, inside], axis=1)
    try:
        t = Delaunay(apart.T).simplices.T
    except QhullError:
        raise OutsideValidity("the liquid's section cannot be meshed: it has no area") from None
    t = t[:, _within(apart[:, t].mean(axis=1), bulged)]  # where a wall's end hardly bends, only they agree
    x, y = p[:, t]
    double_area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    t = t[:, np.abs(double_area) > 1e-12]
    pairs = np.sort(np.concatenate([t[[0, 1]], t[[1, 2]], t[[0, 2]]], axis=1), axis=0)
    edges, count = np.unique(pairs, axis=1, return_counts=True)
    border = {(int(a), int(b)) for a, b in edges[:, count == 1].T}
    wanted = [(min(a, b), max(a, b)) for a, b in enumerate(after.tolist())]
    missing = [k for k, pair in enumerate(wanted) if pair not in border]
    if missing or len(border) != len(wanted):
        halves = missing or list(range(len(wanted)))
        low, high = empty.between(np.array(halves), after[halves])
        return np.asarray(0.5 * (low + high))
    deep = _bent_deeply(empty, after, p, t)
    if len(deep):
        low, high = empty.between(deep, after[deep])
        return np.asarray(0.5 * (low + high))
    used = np.unique(t)
    renamed = np.full(p.shape[1], -1)
    renamed[used] = np.arange(len(used))
    places = np.append(place, np.full(inside.shape[1], np.nan))[used]
    return replace(empty, mesh=MeshTri(p[:, used], renamed[t]), place=places)


def _bent_deeply(mesh: SectionMesh, after: IntArray, p: Array, t: IntArray) -> IntArray:
    """Return the boundary edges, by first vertex, that bend by more than a share of their triangle's height."""
    low, high = mesh.between(np.arange(len(after)), after)
    here = np.arange(len(after))
    middle = mesh.point(0.5 * (low + high))
    bend = np.hypot(*(middle - 0.5 * (p[:, here] + p[:, after])))
    length = np.hypot(*(p[:, after] - p[:, here]))
    x, y = p[:, t]
    area = np.abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))
    height = np.full(len(after), np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        for a, b in ((i, j), (j, i)):
            on = (t[a] < len(after)) & (t[b] < len(after))
            first = t[a][on]
            border = after[first] == t[b][on]
            height[first[border]] = (area[on] / length[first])[border]
    return np.flatnonzero(bend > _DEEP * height)


def _bulge(mesh: SectionMesh, edge: Array) -> Array:
    """Return tiny shifts that bend straight walls outward, so that no vertex on one is lost to rounding."""
    share = mesh.place - np.floor(mesh.place)
    shift = np.zeros_like(edge)
    for k, part in enumerate(mesh.section.boundary):
        here = (np.floor(mesh.place) == k) & part.piece.straight
        ends = part.point(np.array([0.0, 1.0])) / mesh.scale
        r, z = ends[:, 1] - ends[:, 0]
        bend = 4.0 * share[here] * (1.0 - share[here]) * _BULGE
        shift[:, here] = np.array([z, -r])[:, None] * bend  # the liquid is on the left of the way
    return shift


def _inside(edge: Array, after: IntArray) -> Array:
    """Return points within the section, (2, m): a lattice as fine as the boundary's longer edges."""
    low, high = np.min(edge, axis=1), np.max(edge, axis=1)
    length = np.hypot(*(edge[:, after] - edge))
    h = float(np.max(length))
    rows = np.arange(low[1], high[1], 0.866 * h)
    columns = np.arange(low[0], high[0] + h, h)
    if rows.size * columns.size > 20_000:
        return np.empty((2, 0))
    x, y = np.meshgrid(columns, rows)
    x = x + 0.5 * h * (np.arange(len(rows)) % 2)[:, None]
    p = np.stack([x.ravel(), y.ravel()])
    p = p[:, _within(p, edge)]
    u = (edge[:, after] - edge)[:, :, None]
    away = p[:, None, :] - edge[:, :, None]
    along = np.clip(np.sum(u * away, axis=0) / np.sum(u * u, axis=0), 0.0, 1.0)
    distance = np.hypot(*(away - along * u))
    return np.asarray(p[:, np.all(distance > 0.55 * np.minimum(length, h)[:, None], axis=0)])


def _within(p: Array, edge: Array) -> BoolArray:
    """Return which points (2, m) lie within the closed polygon (2, n)."""
    a, b = edge, np.roll(edge, -1, axis=1)
    level = (a[1][:, None] <= p[1]) != (b[1][:, None] <= p[1])
    rise = np.where(b[1] == a[1], 1.0, b[1] - a[1])[:, None]
    r = a[0][:, None] + (p[1] - a[1][:, None]) / rise * (b[0] - a[0])[:, None]
    return np.asarray(np.sum(level & (r > p[0]), axis=0) % 2 == 1)


def _graded(mesh: SectionMesh, tolerance: float) -> SectionMesh:
    """Return the mesh refined towards corners, as far as the solution's power of the distance there asks for."""
    parts = mesh.section.boundary
    rounds = np.array([_rounds(before, part, tolerance) for before, part in pairwise([parts[-1], *parts])])
    for done in range(int(np.max(rounds))):
        vertices = np.flatnonzero(np.isin(mesh.place, np.flatnonzero(rounds > done)))
        mesh = mesh.refined(np.flatnonzero(np.any(np.isin(mesh.mesh.t, vertices), axis=0)))
    return mesh


def _rounds(before: Part, part: Part, tolerance: float) -> int:
    """Return how often to halve the triangles at the corner between two parts of the boundary.

    The solution has a part in d^(pi/angle) of the distance d. What it leaves is d^power at the corner itself, where
    the wave on the wall is read, and d^(2 power) of an energy elsewhere.
    """
    kinds = {before.kind, part.kind}
    a, b = -before.tangent(1.0), part.tangent(0.0)
    angle = float(np.arctan2(b[0] * a[1] - b[1] * a[0], b @ a)) % (2.0 * np.pi)
    if not 0.03 < angle < 2.0 * np.pi - 0.03:  # a cusp, where nothing moves
        return 0
    power = np.pi / angle
    smooth = abs(power - round(power)) < 1e-3 and before.piece.straight and part.piece.straight
    if AXIS in kinds or smooth or power > 6.0:
        return 0
    halvings = np.log2(10.0 / tolerance) / (power if SURFACE in kinds else 2.0 * power)
    if abs(angle - np.pi) < 0.2:  # hardly a corner: what it leaves is little
        halvings *= abs(angle - np.pi) / 0.2
    return int(np.clip(np.ceil(halvings) - 2, 0, 24))
