"""A contour given by points: what is wrong with it, and the walls through it."""

from itertools import pairwise

import numpy as np

from sloshpy.tank.pieces import EDGE, Curve, Line, Piece, Polygon, curve_along, curve_through, polygon_through
from sloshpy.units import Array, BoolArray, refusal

MOST_POINTS = 5000
_GENTLE = np.radians(5.0)  # short lines that turn by less are one piece to the mesh
_SHORT = 0.05  # of the wall's length
_LEAST_RUN = 4  # segments: fewer make no curve, but straight lines with edges
_FEWEST = 3  # segments that may be of a round wall all the same
_ROUND = np.radians(50.0)  # as far as such a wall may turn at one point
_STRAIGHT = 1e-7  # rad
_MOST_PIECES = 40  # more of them are scatter
_INTERVALS = 16  # of a curve along many points
_NEAR = 5e-3  # of the tank's size
_CLOSE = 1e-3  # of the tank's size: how near it passes them
_ALIKE = 3.0  # greatest ratio of curvatures, and of lengths, of neighbours that belong to one curve


def check_contour(z: Array, r: Array, z_inner: Array | None, r_inner: Array | None) -> None:
    """Refuse points that are no wall of a body of revolution.

    Raises:
        PydanticCustomError: the field and the point at fault, the rule and the cure.
    """
    _check_wall("z", z, "r", r)
    if (z_inner is None) != (r_inner is None):
        missing = "z_inner" if z_inner is None else "r_inner"
        raise refusal((missing,), "is missing", "an inner wall needs both z_inner and r_inner")
    if z_inner is None or r_inner is None:
        if r[0] > 0.0:
            rule = f"is {r[0]:g} m at the lowest point: the contour is open at the bottom"
            raise refusal(("r", 0), rule, "begin on the axis with r = 0, also where the bottom is flat")
        return
    _check_wall("z_inner", z_inner, "r_inner", r_inner)
    if z_inner[0] != z[0]:
        rule = f"is {z_inner[0]:g} m where the outer wall begins at {z[0]:g} m: the contour is open"
        raise refusal(("z_inner", 0), rule, "let both walls begin at one height, where they meet")
    if z_inner[-1] < z[-1] and r_inner[-1] > 0.0:
        rule = f"ends {r_inner[-1]:g} m from the axis and below the tank's top: the contour is open"
        raise refusal(("r_inner", len(r_inner) - 1), rule, "lead the inner wall to the axis or to the tank's top")
    _check_order(z, r, z_inner, r_inner)


def _check_wall(z_name: str, z: Array, r_name: str, r: Array) -> None:
    if len(z) != len(r):
        raise refusal((r_name,), f"has {len(r)} values for {len(z)} heights", "give one radius for each height")
    if len(z) < 2:
        raise refusal((z_name,), f"has {len(z)} point{'' if len(z) == 1 else 's'}", "a wall has at least two")
    if len(z) > MOST_POINTS:
        raise refusal((z_name,), f"has {len(z)} points, more than {MOST_POINTS}", "thin them out")
    falling = np.flatnonzero(np.diff(z) < 0.0)
    if len(falling):
        k = int(falling[0]) + 1
        rule = f"falls from {z[k - 1]:g} m to {z[k]:g} m: a wall rises from point to point"
        raise refusal((z_name, k), rule, "list the points from the lowest up; a re-entrant bulkhead is an inner wall")
    if not z[-1] > z[0]:
        raise refusal((z_name, len(z) - 1), "does not rise", "give heights along the axis in z, radii in r")
    level = np.diff(z) == 0.0
    twice = np.flatnonzero(level & (np.diff(r) == 0.0))
    if len(twice):
        raise refusal((z_name, int(twice[0]) + 1), "repeats the point before it", "drop one of the two")
    way = np.sign(np.diff(r))
    back = np.flatnonzero(level[1:] & level[:-1] & (way[1:] != way[:-1]))
    if len(back):
        rule = "turns back at one height: the contour crosses itself"
        raise refusal((r_name, int(back[0]) + 2), rule, "drop the point")
    axis = np.flatnonzero(r[1:-1] == 0.0)
    if len(axis):
        rule = "is 0 before the wall's last point: the tank would be closed there"
        raise refusal((r_name, int(axis[0]) + 1), rule, "end the wall where it meets the axis")


def _check_order(z: Array, r: Array, z_inner: Array, r_inner: Array) -> None:
    """Refuse an inner wall that is not nearer to the axis than the outer one."""
    top = min(z[-1], z_inner[-1])
    level = np.unique(np.concatenate([z, z_inner]))
    level = level[level <= top]
    height = np.unique(np.concatenate([level, 0.5 * (level[1:] + level[:-1])]))  # straight lines cross in between
    for above in (False, True):  # two sides of a step
        gap = _radius(z, r, height, above) - _radius(z_inner, r_inner, height, above)
        may_meet = (height == z[0]) | ((height == top) & (top == z[-1]))
        below_floor = (height == z[0]) & (not above)
        wrong = ((gap < 0.0) | ((gap == 0.0) & ~may_meet)) & ~below_floor
        if np.any(wrong):
            at = float(height[np.argmax(wrong)])
            point = min(int(np.searchsorted(z_inner, at)), len(z_inner) - 1)
            rule = f"is not inside the outer wall at the height {at:g} m: the contour crosses itself"
            raise refusal(("r_inner", point), rule, "the inner wall must stay nearer to the axis")


def _radius(z: Array, r: Array, height: Array, above: bool) -> Array:
    """Return a wall's radius just above or just below heights."""
    low = np.searchsorted(z, height, side="right") - 1 if above else np.searchsorted(z, height, side="left") - 1
    low = np.clip(low, 0, len(z) - 2)
    span = np.where(z[low + 1] > z[low], z[low + 1] - z[low], 1.0)
    return np.asarray(r[low] + np.clip((height - z[low]) / span, 0.0, 1.0) * (r[low + 1] - r[low]))


def pieces_through(r: Array, z: Array, straight: bool = False) -> tuple[Piece, ...]:
    """Return the wall through points from the lowest up.

    Neighbouring segments belong to one curve where the wall bends alike at the points about them: by less than 30
    degrees, the same way, with curvatures and lengths within a factor of three, and there are four of them or more. All
    else is straight.
    """
    pieces = _exactly(r, z, straight)
    return pieces if len(pieces) <= _MOST_PIECES else _roughly(r, z, straight)


def _exactly(r: Array, z: Array, straight: bool) -> tuple[Piece, ...]:
    points = list(zip(r.tolist(), z.tolist(), strict=True))
    turn, length = _turn(r, z), np.hypot(np.diff(r), np.diff(z))
    bent = np.zeros(len(length), dtype=bool) if straight else _bent(turn, length, r, z)
    pieces: list[Piece] = []
    k = 0
    while k < len(length):
        end = k + 1
        if bent[k]:
            while end < len(length) and bent[end] and not _apart(turn[end], length[end - 1 : end + 1]):
                end += 1
            curve = curve_through(points[k : end + 1]) if end - k >= _LEAST_RUN else None
            if curve is not None and _rises(curve):
                pieces.append(curve)
            else:
                pieces += _lines(points[k : end + 1])
        else:
            while end < len(length) and not bent[end]:
                end += 1
            pieces += _straight(points[k : end + 1], turn[k : end + 1], length[k:end], float(np.sum(length)))
        k = end
    return tuple(pieces)


def curves_through(r: Array, z: Array) -> tuple[Piece, ...] | None:
    """Return the wall with a curve wherever four segments or more may mean one; None where that is the wall as it is.

    They may where the points are alike far apart and turn by less than 30 degrees, whatever their curvatures: those of
    rounded points scatter.
    """
    turn, length = _turn(r, z), np.hypot(np.diff(r), np.diff(z))
    joined = [
        abs(turn[k]) > _STRAIGHT and not _apart(float(turn[k]), length[k - 1 : k + 1]) for k in range(1, len(r) - 1)
    ]
    return _joined(r, z, joined, _LEAST_RUN)


def rounded_through(r: Array, z: Array) -> tuple[Piece, ...] | None:
    """Return the wall that few points of a round one mean: None where that is the wall as it is.

    Three segments in a row or more that turn the same way by less than 50 degrees, their lengths within a factor of
    three, none of which goes straight on at a third point.
    """
    turn, length = _turn(r, z), np.hypot(np.diff(r), np.diff(z))
    level = np.abs(turn[1:-1]) < _STRAIGHT
    straight = np.append(level, False) | np.append(False, level)
    joined: list[bool] = []
    for k in range(1, len(r) - 1):
        same = k == 1 or not joined[-1] or turn[k] * turn[k - 1] > 0.0
        alike = np.max(length[k - 1 : k + 1]) <= _ALIKE * np.min(length[k - 1 : k + 1])
        joined.append(bool(same and alike and abs(turn[k]) < _ROUND and not straight[k - 1] and not straight[k]))
    return _joined(r, z, joined, _FEWEST)


def doubtful_edges(r: Array, z: Array) -> tuple[Array, Array]:
    """Return radii and heights of the edges that `rounded_through` makes smooth, (k,) each."""
    rounded = rounded_through(r, z)
    if rounded is None:
        return np.empty(0), np.empty(0)
    size = float(np.max(r) + z[-1] - z[0])
    edges, left = (
        np.array([piece.point(0.0) for piece in wall[1:]]).reshape(-1, 2) for wall in (_exactly(r, z, False), rounded)
    )
    gone = [k for k, edge in enumerate(edges) if not np.any(np.hypot(*(left - edge).T) < 1e-9 * size)]
    return edges[gone, 0], edges[gone, 1]


def _joined(r: Array, z: Array, joined: list[bool], least: int) -> tuple[Piece, ...] | None:
    """Return the wall with a curve through runs of at least so many joined segments; None if that adds no curve."""
    points = list(zip(r.tolist(), z.tolist(), strict=True))
    length = np.diff(z)
    known = sum(len(piece.knots) - 1 for piece in _exactly(r, z, straight=False) if isinstance(piece, Curve))
    pieces: list[Piece] = []
    k = 0
    while k < len(length):
        end = k + 1
        while end < len(length) and joined[end - 1]:
            end += 1
        curve: Curve | Polygon | None = curve_through(points[k : end + 1]) if end - k >= least else None
        while isinstance(curve, Curve) and not _rises(curve, _CLOSE):  # rounded points lead a curve back down a little
            curve = curve.coarse
        if isinstance(curve, Curve):
            pieces.append(curve)
            known -= end - k
        else:
            pieces += _lines(points[k : end + 1])
        k = end
    return tuple(pieces) if known < 0 else None


def scatters(r: Array, z: Array, straight: bool) -> bool:
    """Return whether the wall through points is taken along them, since they scatter."""
    return len(_exactly(r, z, straight)) > _MOST_PIECES


def _roughly(r: Array, z: Array, straight: bool) -> tuple[Piece, ...]:
    """Return the wall through many points that scatter, as digitised or rounded ones do, in a few pieces.

    Between edges it is a curve along the points, where it passes them closely, else the lines between them.
    """
    size = float(np.max(r) + z[-1] - z[0])
    kept = [0]
    for k in range(1, len(r) - 1):  # points nearer than this tell of their scatter, not of the wall
        if np.hypot(r[k] - r[kept[-1]], z[k] - z[kept[-1]]) >= _NEAR * size:
            kept.append(k)
    r, z = r[[*kept, len(r) - 1]], z[[*kept, len(z) - 1]]
    turn = _turn(r, z)
    edges = np.flatnonzero(np.abs(turn) > EDGE)
    ends = [0, *(edges.tolist() if len(edges) <= _MOST_PIECES // 2 else []), len(r) - 1]
    pieces: list[Piece] = []
    for a, b in pairwise(ends):
        points = np.column_stack([r, z])[a : b + 1]
        if len(points) == 2:
            pieces.append(Line(start=tuple(points[0]), end=tuple(points[1])))
            continue
        whole = polygon_through(points.tolist())
        curve = curve_along(points.tolist(), _INTERVALS) if len(points) > 4 * _INTERVALS and not straight else None
        close = curve is not None and _rises(curve) and _distance(curve, points) < _CLOSE * size
        pieces.append(curve if curve is not None and close else whole)
    return tuple(pieces)


def _distance(curve: Curve, points: Array) -> float:
    """Return the greatest distance of points from a curve, by the points of a fine polygon on it."""
    from scipy.spatial import cKDTree  # 0.2 s: only where a contour has many points

    s = np.linspace(0.0, 1.0, 100 * len(curve.knots))
    return float(np.max(cKDTree(curve.point(s).T).query(points)[0]))


def _turn(r: Array, z: Array) -> Array:
    """Return the angle by which the wall turns at each point, rad, 0 at its ends."""
    u = np.diff(r) + 1j * np.diff(z)
    return np.concatenate([[0.0], np.angle(u[1:] / u[:-1]), [0.0]])


def _apart(turn: float, lengths: Array) -> bool:
    """Return whether two neighbouring segments cannot be of one curve."""
    return bool(abs(turn) > EDGE or np.max(lengths) > _ALIKE * np.min(lengths))


def _bent(turn: Array, length: Array, r: Array, z: Array) -> BoolArray:
    """Return which segments belong to a curve, by the curvatures of the circles through three points."""
    n = len(length)
    chord = np.hypot(r[2:] - r[:-2], z[2:] - z[:-2])
    curvature = np.full(n + 1, np.nan)  # unknown at ends and where two neighbours are apart
    for k in range(1, n):
        if not _apart(turn[k], length[k - 1 : k + 1]):
            curvature[k] = 2.0 * np.sin(turn[k]) / chord[k - 1] if abs(turn[k]) > 1e-7 else 0.0
    first, last = curvature[:-1], curvature[1:]
    both = np.isfinite(first) & np.isfinite(last)
    least, most = np.minimum(abs(first), abs(last)), np.maximum(abs(first), abs(last))
    alike = both & (first * last > 0.0) & (most <= _ALIKE * least)
    one = np.isfinite(first) ^ np.isfinite(last)
    return np.asarray(alike | (one & (np.nan_to_num(first) + np.nan_to_num(last) != 0.0)))


def _rises(curve: Curve, fall: float = 0.0) -> bool:
    """Return whether a curve through rising points rises between them too and stays off the axis.

    fall: how far it may fall in all the same, of its size.
    """
    s = (curve.knots[:-1, None] + np.diff(curve.knots)[:, None] * np.linspace(0.0, 1.0, 17)).ravel()
    size = float(np.max(np.abs(curve.point(s))))
    r, z = curve.point(s)
    return bool(np.all(np.maximum.accumulate(z) - z <= fall * size) and np.all(r >= -1e-12 * size))


def _lines(points: list[tuple[float, float]]) -> list[Piece]:
    return [Line(start=a, end=b) for a, b in pairwise(points)]


def _straight(points: list[tuple[float, float]], turn: Array, length: Array, whole: float) -> list[Piece]:
    """Return straight pieces: points on a line are dropped, short lines that hardly turn are gathered."""
    pieces: list[Piece] = []
    k, n = 0, len(length)
    while k < n:
        end = k + 1
        while end < n and abs(turn[end]) < 1e-9:
            end += 1
        if end > k + 1:
            pieces.append(Line(start=points[k], end=points[end]))
        else:
            while end < n and abs(turn[end]) < _GENTLE and max(length[end - 1], length[end]) < _SHORT * whole:
                end += 1
            pieces += [polygon_through(points[k : end + 1])] if end > k + 2 else _lines(points[k : end + 1])
        k = end
    return pieces
