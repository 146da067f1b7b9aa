"""The tanks over flight time: damping needed and there, danger zone, limit cycles against their limits."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from sloshpy.flight import FlightAssessment
from sloshpy.plots.flight_axes import TIME, by_tank, course, legend, mark_events
from sloshpy.plots.style import ALARM, GREY, INK, SMALL, axes_or_new, curve_style, finish, pair_or_new, percent
from sloshpy.units import Array


def plot_flight_damping(result: FlightAssessment, ax: Axes | None = None) -> Axes:
    """Draw the damping that each tank needs (thick) against what it has at its reference amplitude (thin, dots).

    Args:
        result: of `assess_flight`.
        ax: where to draw; default: a new figure.
    """
    ax = axes_or_new(ax)
    tanks = result.trajectory.tanks
    most = 0.0
    for k, tank in enumerate(tanks):
        need = [(t, 100.0 * x) for t, x in by_tank(result, tank, "required_damping")]
        course(ax, need, f"{tank} needs", k, linewidth=2.6)
        own = [r for r in result.reviews if tank in r.phase.tanks]
        have = [(r.time, 100.0 * r.phase.available_damping[:, r.phase.tanks.index(tank)]) for r in own]
        course(ax, have, f"{tank} has", k, linewidth=0.9, marker=".", markersize=3.0)
        most = max(most, *(float(np.max(np.nan_to_num(x))) for _, x in need + have))
        for time, x in need:
            gone = time[np.isnan(x)]
            if not len(gone):
                continue  # markers of nothing would push the layout aside
            ax.plot(gone, np.full(len(gone), 1.0), "x", color=ALARM, transform=ax.get_xaxis_transform(), clip_on=False)
    ax.set_ylim(-0.02 * most, 1.1 * most)
    mark_events([ax], result)
    legend(ax, 2 * len(tanks))
    finish(ax, _damping_message(result), TIME, "Slosh damping [%]")
    return ax


def _damping_message(result: FlightAssessment) -> str:
    rows = [one for one in result.worst if one.criterion.endswith(": required damping")]
    lost = [one for one in rows if np.isnan(one.value)]
    if lost:
        return f"No damping of {lost[0].criterion.split(':')[0]} alone suffices at {lost[0].time:g} s"
    short = [(r, k, j) for r in result.reviews for k, j in np.argwhere(r.required_damping > r.phase.available_damping)]
    if short:
        r, k, j = short[0]
        return f"{r.phase.tanks[j]} has less damping than it needs, first at {r.time[k]:g} s"
    worst = max(rows, key=lambda one: one.value)
    tank = worst.criterion.split(":")[0]
    return f"Every tank has the damping it needs; {tank} needs most, {percent(worst.value)} at {worst.time:g} s"


def plot_flight_danger_zone(result: FlightAssessment, ax: Axes | None = None) -> Axes:
    """Draw c.g., centre of percussion, aft bounds and every slosh mass along the vehicle over flight time.

    Args:
        result: of `assess_flight`.
        ax: where to draw; default: a new figure.
    """
    ax = axes_or_new(ax)
    first = True
    for r in result.reviews:
        ax.plot(r.time, r.cg, color=INK, linewidth=1.4, label="c.g." if first else None)
        ax.plot(
            r.time, r.percussion_station, color=GREY, linewidth=1.4, linestyle="--",
            label="centre of percussion" if first else None,
        )  # fmt: skip
        lowest = np.min(r.aft_station, axis=1)
        ax.fill_between(
            r.time, lowest, r.percussion_station, color="#d9d9d9", alpha=0.6, linewidth=0.0,
            label="danger zone" if first else None,
        )  # fmt: skip
        first = False
    for k, tank in enumerate(result.trajectory.tanks):
        course(ax, by_tank(result, tank, "slosh_station"), f"{tank}", k)
        inside = [
            (t[w == 1.0], x[w == 1.0])
            for (t, x), (_, w) in zip(
                by_tank(result, tank, "slosh_station"), by_tank(result, tank, "within_zone"), strict=True
            )
        ]
        for time, station in inside:
            ax.plot(time, station, "o", color=ALARM, markersize=3.2, zorder=5)
    ax.plot([], [], "o", color=ALARM, markersize=3.2, label="inside its zone")
    mark_events([ax], result)
    legend(ax, 8, "upper right")
    rows = [one for one in result.worst if one.criterion.endswith("in the danger zone")]
    words = ", ".join(f"{one.criterion.split(':')[0]} {one.shown.split(',')[0]}" for one in rows)
    message = f"In the danger zone: {words} times" if rows else "No slosh mass lies in its danger zone"
    finish(ax, message, TIME, "Station, forward of the gimbal [m]")
    return ax


def plot_flight_cycles(result: FlightAssessment, ax: Sequence[Axes] | None = None) -> tuple[Axes, Axes]:
    """Draw slosh and engine amplitude of the limit cycles under degraded margins against their limits.

    Args:
        result: of `assess_flight`, with limit cycles.
        ax: two Axes, slosh above engine; default: a new figure.
    """
    top, bottom = pair_or_new(ax)
    tanks = result.trajectory.tanks
    for k, tank in enumerate(tanks):
        marker = {"marker": ".", "markersize": 4.0}
        course(top, _known(by_tank(result, tank, "cycle_slosh"), 1.0), tank, k, **marker)
        course(bottom, _known(by_tank(result, tank, "cycle_tvc"), 180.0 / np.pi), tank, k, **marker)
        own = curve_style(k) | {"linewidth": 1.0, "linestyle": (0, (6.0, 3.0)), "alpha": 0.7}
        for time, limit in by_tank(result, tank, "slosh_limit"):
            top.plot(time, limit, **own)
    for r in result.reviews:
        limit = np.degrees(r.tvc_limit)
        bottom.plot(r.time[[0, -1]], [limit, limit], color=ALARM, linewidth=1.0, linestyle=(0, (6.0, 3.0)))
    mark_events([top, bottom], result)
    for axes in (top, bottom):
        axes.set_ylim(bottom=0.0)
    top.set_ylim(top=1.35 * top.get_ylim()[1])  # the legend stands above every limit
    legend(top, 2 * len(tanks), "upper right")
    words = "dashed: limits; no dot: no number is supported"
    box = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
    bottom.annotate(words, (0.99, 0.72), xycoords="axes fraction", fontsize=SMALL, ha="right", va="top", bbox=box)
    rows = [one for one in result.worst if one.criterion.endswith("limit cycle, engine")]
    known = [one for one in rows if np.isfinite(one.value)]
    message = "No limit cycle has a supported number"
    if known:
        worst = max(known, key=lambda one: one.value)
        tank = worst.criterion.split(":")[0]
        kept = "within" if worst.met else "BEYOND"
        most = f"{np.degrees(worst.value):.3g} deg"
        message = f"{tank} swings the engine most: {most} at {worst.time:g} s, {kept} {worst.limit[3:]}"
    finish(top, message, "", "Slosh [m]")
    finish(bottom, "", TIME, "Engine [deg]")
    return top, bottom


def _known(pieces: Sequence[tuple[Array, Array]], scale: float) -> list[tuple[Array, Array]]:
    return [(time[np.isfinite(x)], scale * x[np.isfinite(x)]) for time, x in pieces]
