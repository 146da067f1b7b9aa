"""Section of a tank with its liquid and the masses that stand for it, and their course over the fill, fig 1."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from sloshpy.errors import OutsideValidity
from sloshpy.plots.style import ALARM, GREY, INK, SAFE, SHADE, SMALL, curve_style, finish
from sloshpy.tank import FillHistory, SloshModes

_DISC = 0.32  # of the tank's radius: a disc of all the liquid's mass
_WAVE = 0.18  # of the surface's radius: the wave as drawn
_MARGIN = 1.06
_PIVOT = [(0.0, 0.0), (-0.7, -1.0), (0.7, -1.0)]  # a triangle whose tip is the place: what is above stays clear
_SECTION = 0.64  # of the figure's width; the rest is for labels


def plot_tank(found: SloshModes, ax: Axes | None = None) -> Axes:
    """Draw the section with the liquid, the first mode's wave, slosh masses on springs, hinge and fixed mass.

    Places are to scale; the areas of the discs are as the masses; the wave is drawn higher than it may be.
    """
    own = ax is None
    ax = _section_axes() if ax is None else ax
    tank, section = found.tank, found.section
    width = max(float(np.max(wall[0])) for wall in found.walls)
    height = tank.height
    high = min(_WAVE * section.radius, 0.5 * (height - section.depth), 0.5 * section.depth)
    for side in (1.0, -1.0):
        ax.fill(side * found.outline[0], found.outline[1], color=SHADE, linewidth=0.0, zorder=1)
        for wall in found.walls:
            ax.plot(side * wall[0], wall[1], color=INK, linewidth=1.8, zorder=4)
        wave = section.depth + side * high * found.surface_shape[0]
        ax.plot(side * found.surface_radius, wave, color=SAFE, linewidth=2.2, zorder=5)
        ax.plot([side * section.inner_radius, side * section.radius], [section.depth] * 2, color=GREY, linewidth=0.8)
    for ring in tank.baffle:
        for side in (1.0, -1.0):
            edge = side * _radius_at(found, ring.height)
            ax.plot([edge, edge - side * ring.width], [ring.height] * 2, color=INK, linewidth=3.0, zorder=6)
    labels = [(section.depth, f"surface: {section.depth:.4g} m,\nradius {section.radius:.4g} m", INK)]
    for n, (mass, H_s) in enumerate(zip(found.slosh_mass, found.spring_height, strict=True)):
        if mass < 1e-4 * found.liquid_mass:
            continue
        reach = _radius_at(found, float(H_s))
        for side in (1.0, -1.0):
            _spring(ax, side * reach, float(H_s))
        _disc(ax, found, float(H_s), float(mass), width, ALARM)
        labels.append(
            (float(H_s), f"slosh mass {n + 1}: {mass:.6g} kg,\n{found.f_hz[n]:.4g} Hz, spring at {H_s:.4g} m", ALARM)
        )
    _disc(ax, found, found.fixed_mass_height, found.fixed_mass, width, INK)
    fixed = f"fixed mass: {found.fixed_mass:.6g} kg,\n{found.fixed_mass_height:.4g} m"
    labels.append((found.fixed_mass_height, fixed, INK))
    top, hinge = _MARGIN * height, float(found.hinge_height[0])
    where = f"hinge of the equal\npendulum: {hinge:.4g} m"
    if hinge <= 1.3 * height:
        ax.plot(
            [0.0, 0.0], [float(found.spring_height[0]), hinge], color=GREY, linewidth=1.0, linestyle=(0, (4.0, 2.0))
        )
        ax.plot(0.0, hinge, marker=_PIVOT, color=INK, markeredgecolor="white", markersize=19.0, zorder=8, label="hinge")
        labels.append((hinge, where, INK))
        top = max(top, 1.04 * hinge)
    else:
        labels.append((top, f"{where}, above", GREY))
    low = min(-0.06 * height, float(np.nanmin(found.spring_height)) - _DISC * width)
    top = max(top, found.fixed_mass_height + _DISC * width)
    ax.set_aspect("equal")
    ax.set_ylim(low, top)
    ax.set_xlim(-_MARGIN * width, _MARGIN * width)
    _column(ax, labels, _MARGIN * width, low, top, in_layout=not own)
    share = f"{100.0 * section.volume / tank.volume:.3g} % full"
    sloshing = f"{100.0 * found.slosh_mass[0] / found.liquid_mass:.3g} % of {found.liquid_mass:.6g} kg"
    message = f"{tank.name}, {share}: {sloshing} slosh at {found.f_hz[0]:.3g} Hz"
    ax.set_anchor("W")
    finish(ax, message, "Distance from the axis [m]", "Height above the lowest point [m]")
    ax.set_xlabel(ax.get_xlabel(), loc="left")  # under a slender tank it would begin beyond the page
    ax.grid(False)
    return ax


def _section_axes() -> Axes:
    """Return the Axes of a new figure, with room on the right for the longest label."""
    figure = Figure(figsize=(7.2, 5.6), layout=ConstrainedLayoutEngine(rect=(0.0, 0.0, _SECTION, 1.0)))
    return figure.add_subplot()


def _radius_at(found: SloshModes, height: float) -> float:
    """Return the radius of the outer wall at a height, of its ends beyond them."""
    r, z = found.walls[0]
    return float(np.interp(height, z, r))


def _disc(ax: Axes, found: SloshModes, height: float, mass: float, width: float, color: str) -> None:
    share = abs(mass) / found.liquid_mass
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    a = _DISC * width * np.sqrt(share)
    rim: dict[str, Any] = {"color": color, "linewidth": 1.6, "zorder": 7}
    if color == ALARM:
        ax.fill(
            a * np.cos(angle), height + a * np.sin(angle), facecolor=color, edgecolor="white", linewidth=1.0, zorder=7
        )
    else:  # a ring: what it lies over stays in sight
        ax.plot(a * np.cos(angle), height + a * np.sin(angle), **rim)
        ax.plot(0.0, height, "+", color=color, markersize=9.0, zorder=7)


def _spring(ax: Axes, wall: float, height: float) -> None:
    x = np.linspace(0.0, wall, 25)
    zigzag = np.where(np.arange(25) % 2 == 0, 1.0, -1.0) * 0.02 * abs(wall)
    zigzag[[0, 1, 2, -3, -2, -1]] = 0.0
    ax.plot(x, height + zigzag, color=ALARM, linewidth=1.0, zorder=6)


def _column(
    ax: Axes, labels: Sequence[tuple[float, str, str]], edge: float, low: float, top: float, in_layout: bool
) -> None:
    """Write the labels beside the section, in the order of their heights, each with a leader."""
    rows = sorted(labels)
    gap = max(0.1 * (top - low), 0.2 * edge)  # two lines of text, in a tall tank and in a flat one
    first = sum(height for height, _, _ in rows) / len(rows) - 0.5 * gap * (len(rows) - 1)
    line: dict[str, Any] = {"arrowstyle": "-", "color": GREY, "linewidth": 0.7, "relpos": (0.0, 0.5)}
    words: dict[str, Any] = {"textcoords": "data", "ha": "left", "va": "center", "fontsize": SMALL}
    for k, (height, text, color) in enumerate(rows):
        at = (1.18 * edge, first + gap * k)
        said = ax.annotate(text, (edge, height), at, color=color, arrowprops=line, annotation_clip=False, **words)
        said.set_in_layout(in_layout)  # an aspect that is kept spoils the layout's measure of what stands outside


def plot_fill_history(found: FillHistory, ax: Sequence[Axes] | None = None) -> tuple[Axes, ...]:
    """Draw frequency, slosh mass and heights against the fill, one curve for each mode.

    Raises:
        OutsideValidity: no row has slosh masses.
    """
    if not any(found.rows):
        raise OutsideValidity(f"{found.tank.name}: no row of the fill history has slosh masses")
    if ax is None:
        ax = Figure(figsize=(7.2, 6.8), layout="constrained").subplots(3, sharex=True).tolist()
    frequency, mass, place = ax
    full = 100.0 * found.fraction
    order = np.argsort(full)
    alone = np.count_nonzero(np.isfinite(full)) == 1

    def point(shape: str) -> dict[str, Any]:
        return {"marker": shape, "markersize": 7.0} if alone else {}  # of one point there is no line

    for n in range(found.tank.modes):
        style = curve_style(2 if n == 0 else n - 1 if n <= 2 else n) | point("osD^v<>pPhHd"[n])
        name = f"mode {n + 1}"
        frequency.plot(full[order], found.of_modes("frequency")[order, n] / (2.0 * np.pi), label=name, **style)
        mass.plot(full[order], found.of_modes("slosh_mass")[order, n], label=name, **style)
        place.plot(full[order], found.of_modes("spring_height")[order, n], label=f"spring-mass, {name}", **style)
    mass.plot(
        full[order], found.of_tank("fixed_mass")[order], color=INK, linewidth=1.0, label="fixed mass", **point("x")
    )
    place.plot(
        full[order],
        found.depth[order],
        color=GREY,
        linewidth=1.0,
        linestyle=(0, (4.0, 2.0)),
        label="surface",
        **point("_"),
    )
    place.plot(
        full[order],
        found.of_tank("fixed_mass_height")[order],
        color=INK,
        linewidth=1.0,
        label="fixed mass",
        **point("x"),
    )
    for one in (mass, place):
        one.legend(fontsize=SMALL, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    slosh = found.of_modes("slosh_mass")[:, 0]
    most = int(np.nanargmax(slosh))
    what = "only row with slosh masses:" if alone else "most liquid sloshes at"
    message = f"{found.tank.name}: {what} {full[most]:.3g} % full, {slosh[most]:.4g} kg"
    finish(frequency, message, "", "Frequency [Hz]")
    finish(mass, "", "", "Mass [kg]")
    finish(place, "", "Fill of the volume [%]", "Height [m]")
    return tuple(ax)
