"""Required damping of every tank along the vehicle, one curve for each, with the tanks where they are."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from sloshpy.plots.style import INK, SMALL, axes_or_new, curve_style, finish, mark_line, percent
from sloshpy.stability import RequiredDampingMap

ALIKE = 1e-3  # relative: needs this near to each other are told as one


def plot_danger_zones(maps: Sequence[RequiredDampingMap], ax: Axes | None = None) -> Axes:
    """Draw the required damping of several tanks against the station, each tank marked where it stands.

    Args:
        maps: results of `required_damping_map`, one for each tank of a case.
        ax: where to draw; default: a new figure.
    """
    ax = axes_or_new(ax)
    vehicle = maps[0].case.vehicle
    low, high = min(m.station[0] for m in maps), max(m.station[-1] for m in maps)
    ax.set_xlim(low, high)
    top = max(float(np.nanmax(np.append(100.0 * m.required, 0.0))) for m in maps) or 1.0
    ax.set_ylim(-0.02 * top, 1.25 * top)
    bounds = []
    for k, one in enumerate(maps):
        style = curve_style(k)
        ax.plot(one.station, 100.0 * one.required, label=one.tank, **style)
        station = next(float(t.station) for t in vehicle.tanks if t.name == one.tank)
        own = int(np.argmin(np.abs(one.station - station)))
        need = one.required[own]
        shown = 100.0 * need if np.isfinite(need) else 1.2 * top
        ax.plot(station, shown, "o", color=style["color"], markersize=8.0, zorder=5)
        words = f"{one.tank}: {percent(need)}" if np.isfinite(need) else f"{one.tank}: none suffices"
        right = station < 0.25 * low + 0.75 * high
        ax.annotate(
            words,
            (station, shown),
            (8 if right else -8, 10 + 15 * (k % 2)),  # neighbours stand at two heights
            textcoords="offset points",
            ha="left" if right else "right",
            fontweight="bold",
            color=style["color"],
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.7},
        )
        if not one.zone.reason:
            bounds.append(float(vehicle.cg) - float(one.zone.aft))
            ax.plot([bounds[-1]] * 2, [1.14 * top, 1.25 * top], color=style["color"], linewidth=2.0)
    zone = next((m.zone for m in maps if not m.zone.reason), None)
    mark_line(ax, float(vehicle.cg), "c.g.", vertical=True, at=0.3, color=INK, linestyle="-")
    if zone is not None:
        mark_line(ax, float(vehicle.cg) - float(zone.forward), "centre of percussion", vertical=True, at=0.6)
        text = f"aft bound{'s' if len(bounds) > 1 else ''} (eq 23)"
        ax.annotate(
            text,
            (max(bounds), 1.2 * top),
            (5, 0),
            textcoords="offset points",
            fontsize=SMALL,
            ha="left",
            va="center",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
        )
    ax.legend(loc="upper right", fontsize=SMALL)
    finish(ax, _message(maps), "Station of the slosh mass, forward of the gimbal [m]", "Required slosh damping [%]")
    return ax


def _message(maps: Sequence[RequiredDampingMap]) -> str:
    vehicle = maps[0].case.vehicle
    needs = {}
    for one in maps:
        station = next(float(t.station) for t in vehicle.tanks if t.name == one.tank)
        needs[one.tank] = float(one.required[int(np.argmin(np.abs(one.station - station)))])
    lost = [tank for tank, need in needs.items() if np.isnan(need)]
    if lost:
        return f"No slosh damping of {', '.join(lost)} suffices where it stands"
    tank = max(needs, key=lambda name: needs[name])
    if needs[tank] == 0.0:
        return "No tank needs slosh damping where it stands"
    most = [name for name, need in needs.items() if need > (1.0 - ALIKE) * needs[tank]]
    if len(most) > 1:
        return f"Where the tanks stand, {' and '.join(most)} need {percent(needs[tank])} of slosh damping each"
    asked = "what coupled tanks ask included"
    return f"Where the tanks stand, {tank} needs most slosh damping: {percent(needs[tank])}, {asked}"
