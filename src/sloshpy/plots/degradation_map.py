"""Engine amplitude of the limit cycle over gain and delay, with the disc margin and the paper's point."""

from typing import Literal

import numpy as np
from matplotlib.axes import Axes

from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle import DegradationMap
from sloshpy.plots.style import ALARM, GREY, INK, SAFE, SMALL, axes_or_new, finish

SHADES = ("#f4f4f4", "#e4e4e4", "#d2d2d2", "#bdbdbd", "#a6a6a6", "#8f8f8f", "#787878")
LEVELS = np.array([0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0])  # mrad
MOST_LEVELS = 6
WORDS = {2: "no data", 3: "several modes grow", 4: "diverges"}
HATCH = {2: "//", 3: "xx", 4: "\\\\"}


def plot_degradation_map(found: DegradationMap, ax: Axes | None = None) -> Axes:
    """Draw contours of the engine amplitude, the limit in bold, the disc margin's ellipse and the paper's point.

    Raises:
        OutsideValidity: fewer than two gains or delays: there are no contours.
    """
    if min(found.tvc.shape) < 2:
        raise OutsideValidity(f"a map of {found.tvc.shape[0]} x {found.tvc.shape[1]} cells has no contours")
    ax = axes_or_new(ax)
    x, y = 1e3 * found.delay, found.gain_db
    z = np.ma.masked_invalid(1e3 * found.tvc)
    ax.set_xlim(float(x[0]), float(x[-1]))
    ax.set_ylim(float(y[0]), float(y[-1]))
    if z.count():
        _contours(ax, found, z)
    for code, hatch in HATCH.items():
        cells = found.reason == code
        if np.any(cells):
            ax.contourf(x, y, cells, levels=[0.5, 1.5], colors="none", hatches=[hatch])
            g, d = np.argwhere(cells).mean(axis=0)
            at = (float(np.interp(d, np.arange(len(x)), x)), float(np.interp(g, np.arange(len(y)), y)))
            box = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
            side, edge = _towards_the_middle(ax, *at)
            ax.annotate(WORDS[code], at, ha=side, va=edge, fontsize=SMALL, color=INK, bbox=box)
    _ellipse(ax, found)
    gain, delay = found.point
    if np.isfinite(gain):
        ax.plot(1e3 * delay, gain, "o", color=ALARM, markersize=9.0, zorder=6)
        number = _angle(found.point_tvc) if np.isfinite(found.point_tvc) else "no number"
        words = f"paper's point: {gain:.2f} dB, {1e3 * delay:.0f} ms\n{number}"
        side = _towards_the_middle(ax, 1e3 * delay, gain)[0]
        ax.annotate(
            words,
            (1e3 * delay, gain),
            (10 if side == "left" else -10, -8),
            textcoords="offset points",
            ha=side,
            va="top",
            fontsize=10.0,
            fontweight="bold",
            color=ALARM,
            zorder=7,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5, "alpha": 0.85},
        )
    finish(ax, _message(found), "Extra delay [ms]", "Extra loop gain [dB]")
    ax.grid(False)
    return ax


def _towards_the_middle(ax: Axes, x: float, y: float) -> tuple[Literal["left", "right"], Literal["bottom", "top"]]:
    """Return how words at a point are aligned so that they stay on the map."""
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    return "left" if 2.0 * x < left + right else "right", "bottom" if 2.0 * y < low + high else "top"


def _ellipse(ax: Axes, found: DegradationMap) -> None:
    if not found.ellipse.size:
        return
    gain, delay = found.ellipse[0], 1e3 * found.ellipse[1]
    apart = np.flatnonzero(np.abs(np.diff(gain)) > 0.1 * np.ptp(gain)) + 1  # where it leaves the map
    for g, d in zip(np.split(gain, apart), np.split(delay, apart), strict=True):
        ax.plot(d, g, color=SAFE, linewidth=2.0, linestyle=(0, (5.0, 2.0)))
    at = int(np.argmin(np.abs(gain - 0.5 * np.min(gain)) - 1e-3 * delay))
    ax.annotate(
        f"disc margin {found.case.criteria.disc_margin:g}",
        (float(delay[at]), float(gain[at])),
        (6, -6),
        textcoords="offset points",
        va="top",
        fontsize=SMALL,
        color=SAFE,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85},
    )


def _contours(ax: Axes, found: DegradationMap, z: "np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]") -> None:
    x, y = 1e3 * found.delay, found.gain_db
    least, most, limit = float(z.min()), float(z.max()), 1e3 * found.limit
    levels = LEVELS[(least < LEVELS) & (most > LEVELS)]
    levels = levels[len(levels) % 2 :: 2] if len(levels) > MOST_LEVELS else levels  # the greater ones count
    if len(levels):
        shades = [SHADES[min(k, len(SHADES) - 1)] for k in range(len(levels) + 1)]
        ax.contourf(x, y, z, levels=[-np.inf, *levels, np.inf], colors=shades)
        lines = ax.contour(x, y, z, levels=levels, colors=INK, linewidths=0.8)
        wanted = np.linspace(x[0], x[-1], len(levels) + 2)[1:-1]  # one beside the other, not one upon the other
        paths = [np.asarray(path.vertices) for path in lines.get_paths()]
        places = [path[np.argmin(np.abs(path[:, 0] - at))] for path, at in zip(paths, wanted, strict=True) if len(path)]
        ax.clabel(lines, fmt=lambda v: f"{v:g} mrad", fontsize=SMALL, manual=places)
    if least < limit < most:
        bold = ax.contour(x, y, z, levels=[limit], colors=ALARM, linewidths=3.0)
        line = np.concatenate([path.vertices for path in bold.get_paths()])
        low, left = line[int(np.argmin(line[:, 1]))]  # where it reaches lowest: away from the corner it may stand in
        ax.annotate(
            f"limit {limit:.3g} mrad\n({np.degrees(limit / 1e3):.3g} deg)",
            (float(low), float(left)),
            (-6, -4),
            textcoords="offset points",
            ha="right",
            va="top",
            fontsize=SMALL,
            fontweight="bold",
            color=ALARM,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85},
        )
    else:
        side = "below" if limit >= most else "above"
        text = f"every cell with a number is {side} the limit of {_angle(limit / 1e3)}"
        ax.annotate(text, (0.02, 0.03), xycoords="axes fraction", fontsize=SMALL, color=GREY)


def _angle(value: float) -> str:
    return f"{1e3 * value:.3g} mrad ({np.degrees(value):.3g} deg)"


def _message(found: DegradationMap) -> str:
    inside, worst, limit = (np.degrees(x) for x in (found.worst_inside, found.worst, found.limit))
    start = f"Degraded anywhere inside the disc margin, {found.tank}'s loop"
    if np.isnan(inside):
        return f"{start} is in places no single oscillation: there a simulation decides"
    if np.isinf(inside):
        return f"{start} has degradations for which it diverges"
    sign = "within" if worst <= limit else "beyond"
    if worst > inside:
        return (
            f"{start} cycles the engine by {inside:.3g} deg; the five steps, which decide, take {worst:.3g} deg, "
            f"{sign} the limit of {limit:.3g} deg"
        )
    return f"{start} cycles the engine by at most {inside:.3g} deg, {sign} the limit of {limit:.3g} deg"
