"""Required damping along the vehicle with the danger zone, eqs 22-23."""

import numpy as np
from matplotlib.axes import Axes

from sloshpy.plots.style import ALARM, GREY, INK, SHADE, SMALL, axes_or_new, curve_style, finish, mark_line, percent
from sloshpy.stability import RequiredDampingMap


def plot_danger_zone(found: RequiredDampingMap, ax: Axes | None = None) -> Axes:
    """Draw required and neutral damping against the tank's station, with c.g., centre of percussion and bounds."""
    ax = axes_or_new(ax)
    v, zone, station = found.case.vehicle, found.zone, found.station
    cg = float(v.cg)
    tank = next(t for t in v.tanks if t.name == found.tank)
    own = int(np.argmin(np.abs(station - float(tank.station))))
    required, neutral = 100.0 * found.required, 100.0 * found.neutral
    top = 1.45 * float(np.nanmax(np.append(required, 0.0))) or 1.0
    ax.set_xlim(float(station[0]), float(station[-1]))
    ax.set_ylim(0.0, top)
    if not zone.reason:
        aft, forward = float(zone.aft), float(zone.forward)
        ax.axvspan(cg - aft, cg - forward, color=SHADE, alpha=0.6, linewidth=0.0)
        ax.axvspan(cg, cg - forward, facecolor="none", edgecolor=GREY, hatch="//", linewidth=0.0, alpha=0.35, ymin=0.93)
        mark_line(ax, cg - aft, "aft bound (eq 23)", vertical=True, at=0.9)
        mark_line(ax, cg - forward, "centre of percussion (eq 22)", vertical=True, at=0.9)
        box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
        ax.annotate("Greensite", (cg - 0.5 * forward, 0.965 * top), ha="center", va="center", fontsize=SMALL, bbox=box)
    mark_line(ax, cg, "c.g.", vertical=True, at=0.9, color=INK, linestyle="-")
    middle = 0.5 * (station[0] + station[-1])
    for values, name, k in ((required, "required", 2), (neutral, "neutral", 1)):
        ax.plot(station, values, **curve_style(k))
        if np.any(values > 0.0):
            away = (station < middle) != (station[own] < middle)  # from the tank's own label
            known = np.isfinite(values) & (away if np.any(np.isfinite(values[away])) else True)
            peak = int(np.argmax(np.where(known, values, -np.inf)))
            at = (float(station[peak]), float(values[peak]))
            side = "left" if peak == 0 else "right" if peak == len(values) - 1 else "center"
            ax.annotate(name, at, (0, 4), textcoords="offset points", ha=side, va="bottom", fontsize=SMALL)
    if np.isfinite(required[own]):
        right = station[own] < 0.3 * station[0] + 0.7 * station[-1]
        ax.plot(station[own], required[own], "o", color=ALARM, markersize=9.0, zorder=5)
        ax.annotate(
            f"{found.tank} at {float(tank.station):.4g} m\nneeds {percent(found.required[own])}",
            (float(station[own]), float(required[own])),
            (10 if right else -10, 10),
            textcoords="offset points",
            ha="left" if right else "right",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.7},
            fontsize=10.0,
            fontweight="bold",
            color=ALARM,
        )
    if not np.any(np.isfinite(required)):
        text = "no damping of this tank suffices at any station:\nanother mode is unstable or short of margin"
        ax.annotate(text, (0.5, 0.5), xycoords="axes fraction", ha="center", fontsize=10.0)
    finish(ax, _message(found, own), "Station of the slosh mass, forward of the gimbal [m]", "Slosh damping [%]")
    return ax


def _message(found: RequiredDampingMap, own: int) -> str:
    place = {
        True: "it is inside the danger zone",
        False: "it is outside the danger zone",
        None: "no closed-form zone",
    }
    where = place[found.zone.inside]
    if np.isnan(found.required[own]):
        return f"{found.tank}: no slosh damping suffices; {where}"
    if found.required[own] == 0.0:
        return f"{found.tank} needs no slosh damping; {where}"
    coupled = ", what coupled tanks ask included" if len(found.case.vehicle.tanks) > 1 else ""
    text = f"{found.tank} needs {percent(found.required[own])} slosh damping{coupled}"
    if found.neutral[own] > 0.0:
        text += f"; below {percent(found.neutral[own])} it is unstable"
    return f"{text}; {where}"
