"""What the points of a contour leave open: the wall between them, and what rounding has taken from their digits."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from sloshpy.errors import OutsideValidity
from sloshpy.tank.contour import curves_through, pieces_through, rounded_through, scatters
from sloshpy.tank.eigen import change_of_fixed, change_of_modes, in_metres, solved
from sloshpy.tank.liquid import LiquidSection, liquid_section
from sloshpy.tank.mesh import SectionMesh, first_mesh
from sloshpy.tank.modal import Modal
from sloshpy.tank.pieces import Curve
from sloshpy.tank.shapes import Contour, Wall
from sloshpy.units import Array

_THIRD = 0.25  # of what a third of the points change is what a half does, where a cubic has converged: (2/3)^4 and some
_SHORT = 7  # points of a curve that may as well be straight lines between them
_DRAWS = 4  # of roundings, each to its full extent, which is 1.7 times the standard deviation of a rounding
# spheres of 8 to 120 points, exact and rounded to 1e-3, 1e-4 and 1e-5 of the radius, 5 to 95 % deep, ask for so much
_CAUTION = 3.0
_OF_FIXED = 2.5  # times: what is left of differences
_STEPS = tuple(unit * part for unit in (1.0, 0.0254, 0.3048) for part in (1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6))
_HALF = 0.499  # of a step, so that no two heights change places
_FOLDED = 0.3  # of a triangle's area: what must be left of it when the wall under it moves
_MESH = 1e-4  # of corners; what both walls share leaves the difference
_ALL = 1.0  # the doubt where a wall that the points allow has no slosh modes


@dataclass(frozen=True, kw_only=True)
class Walls:
    """A wall that the points would allow as well, and the share of its change that counts."""

    outer: Wall
    inner: Wall
    share: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Doubt:
    """Relative: of the modes (n,), of the rigid-lid inertia and of the fixed mass's inertia."""

    modes: Array
    lid: float
    fixed: float

    def beside(self, other: "Doubt") -> "Doubt":
        """Return the greater of two doubts, number by number."""
        return Doubt(
            modes=np.maximum(self.modes, other.modes),
            lid=max(self.lid, other.lid),
            fixed=max(self.fixed, other.fixed),
        )


def doubt_of(shape: Contour, section: LiquidSection, modes: int, wanted: int) -> Doubt:
    """Return how far the results change from wall to wall, of those that the points of a contour allow.

    The modes are solved again, on one coarse mesh that moves with the wall: with a curve through a half and a third of
    the points; with one that need not be level on the axis; with one where the points bend like a curve and scatter too
    much to be taken for it, or where few points with edges may mean one; with straight lines in place of one through
    seven points or less; and with the points moved by half of their last digit up or down, four times. Three times the
    sum of the greatest change between points and the greatest by rounding, 7.5 times for the fixed inertia, which is a
    difference. Points that stand for straight lines are taken at their word.
    """
    nothing = Doubt(modes=np.zeros(modes), lid=0.0, fixed=0.0)
    between, rounded = list(_between(shape)), list(_rounded(shape))
    if not between and not rounded:
        return nothing
    found = solved(first_mesh(section, _MESH), modes)
    base = in_metres(found, section)
    total = np.zeros(modes + 2)
    for walls in (between, rounded):
        if walls:
            total += np.max([wall.share * _changes(wall, found.mesh, base, modes, wanted) for wall in walls], axis=0)
    total *= np.append(np.full(modes + 1, _CAUTION), _CAUTION * _OF_FIXED)
    return Doubt(modes=total[:modes], lid=float(total[modes]), fixed=float(total[modes + 1]))


def _changes(wall: Walls, mesh: SectionMesh, base: Modal, modes: int, wanted: int) -> Array:
    """Return by how much another wall changes the modes, the rigid-lid and the fixed inertia, (modes + 2,)."""
    before = mesh.section
    try:
        section = liquid_section(wall, before.depth)
        now = in_metres(solved(_moved(mesh, section), modes), section)
    except OutsideValidity:
        return np.full(modes + 2, _ALL)
    lid = abs(now.lid_volume / base.lid_volume - 1.0)
    fixed = change_of_fixed(base, before, now, section, wanted)
    return np.append(change_of_modes(base, now, before), [lid, fixed])


def _moved(mesh: SectionMesh, section: LiquidSection) -> SectionMesh:
    """Return the mesh with its boundary on another section's, where that is alike; else a mesh of that section's own.

    One mesh for both leaves its error out of their difference.
    """
    if len(section.boundary) != len(mesh.section.boundary):
        return first_mesh(section, _MESH)
    other = replace(mesh, section=section)
    points = mesh.mesh.p.copy()
    on = np.isfinite(mesh.place)
    points[:, on] = other.point(mesh.place[on])
    areas = []
    for p in (mesh.mesh.p, points):
        x, y = p[:, mesh.mesh.t]
        areas.append((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))
    if np.any(areas[1] / areas[0] < _FOLDED):
        return first_mesh(section, _MESH)
    return replace(other, mesh=replace(mesh.mesh, doflocs=points))


def _between(shape: Contour) -> Iterator[Walls]:
    """Yield the walls through fewer points, and curved where the points may mean a curve; none of straight walls."""
    if shape.straight:
        return
    outer, inner = shape.outer, shape.inner
    both = (shape.outer_points, shape.inner_points)
    if any(isinstance(piece, Curve) for piece in (*outer, *inner)):
        half = [tuple(p.coarse if isinstance(p, Curve) else p for p in wall) for wall in (outer, inner)]
        third = [tuple(p.coarse if isinstance(p, Curve) else p for p in wall) for wall in half]
        yield Walls(outer=half[0], inner=half[1])
        # the error may change its sign between two densities, whose difference is then small
        yield Walls(outer=third[0], inner=third[1], share=_THIRD)
    if any(isinstance(piece, Curve) and piece.free for piece in (*outer, *inner)):
        free = [tuple((isinstance(p, Curve) and p.free) or p for p in wall) for wall in (outer, inner)]
        yield Walls(outer=free[0], inner=free[1])
    for through in (curves_through, rounded_through):
        curved = _curved(shape, through)
        if any(curved):
            yield Walls(outer=curved[0] or outer, inner=curved[1] or inner)
    short = [any(isinstance(p, Curve) and len(p.knots) <= _SHORT for p in wall) for wall in (outer, inner)]
    if any(short):
        lines = [pieces_through(*points, straight=True) if points else () for points in both]
        yield Walls(outer=lines[0] if short[0] else outer, inner=lines[1] if short[1] else inner)


def _curved(shape: Contour, through: Callable[[Array, Array], Wall | None] = curves_through) -> list[Wall | None]:
    return [through(*points) if points else None for points in (shape.outer_points, shape.inner_points)]


def _taken(points: tuple[Array, Array] | None, before: tuple[Array, Array] | None, straight: bool) -> Wall:
    """Return the wall through moved points, as smooth as the one through them before they were moved may be.

    A rounding decides whether points look like a curve, and which it is of four draws says nothing.
    """
    if points is None or before is None:
        return ()
    curved = None if straight or scatters(*before, straight) else curves_through(*points)
    return curved or pieces_through(*points, straight)


def _rounded(shape: Contour) -> Iterator[Walls]:
    """Yield walls whose points are half a digit off; none where the wall is of straight lines or the digits many."""
    half = _HALF * resolution(shape)
    bent = any(not piece.straight for piece in (*shape.outer, *shape.inner))
    maybe = not shape.straight and any(_curved(shape))
    if half == 0.0 or not (bent or maybe or shape.resolution):
        return
    names = [name for name in ("z", "r", "z_inner", "r_inner") if getattr(shape, name) is not None]
    for seed in range(_DRAWS):
        draw = np.random.default_rng(seed)
        new: dict[str, Array] = {}
        for axis in "zr":  # what is alike stays so: a floor is level, a barrel upright, walls meet
            own = [name for name in names if name[0] == axis]
            known, where = np.unique(np.concatenate([getattr(shape, name) for name in own]), return_inverse=True)
            kept = (known == shape.z[0]) if axis == "z" else (known == 0.0)
            moved = known + np.where(kept, 0.0, draw.choice([-half, half], len(known)))
            moved = np.maximum.accumulate(moved)[where]  # a step wider than the points are apart must not reverse them
            ends = np.cumsum([len(getattr(shape, name)) for name in own])[:-1]
            new |= dict(zip(own, np.split(moved, ends), strict=True))
        moved_shape = shape.model_copy(update=new)
        yield Walls(
            outer=_taken(moved_shape.outer_points, shape.outer_points, shape.straight),
            inner=_taken(moved_shape.inner_points, shape.inner_points, shape.straight),
        )


def resolution(shape: Contour) -> float:
    """Return the step in m of which all points are multiples, in m, inches or feet; 0 where there is none.

    As given by the contour's `resolution`, else the coarsest that fits: in a file whose finest number has three digits
    behind the point, the last of them.
    """
    if shape.resolution is not None:
        return shape.resolution
    lists = [values for values in (shape.z, shape.r, shape.z_inner, shape.r_inner) if values is not None]
    value = np.concatenate(lists)
    for step in sorted(_STEPS, reverse=True):
        share = value / step
        if np.all(np.abs(share - np.round(share)) < 1e-9 * np.maximum(np.abs(share), 1.0)):
            return step
    return 0.0
