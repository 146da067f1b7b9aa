"""What the figures over flight time share: the abscissa, the events, a curve that breaks at each of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from sloshpy.flight import FlightAssessment
from sloshpy.plots.style import GREY, SMALL, curve_style
from sloshpy.units import Array

TIME = "Time of flight [s]"


def mark_events(axes: Sequence[Axes], result: FlightAssessment) -> None:
    """Draw the limits of the flight and its events, named on the first Axes by the phase that begins."""
    phases = result.trajectory.phases
    for ax in axes:
        ax.set_xlim(phases[0].time[0], phases[-1].time[-1])
        for time in result.trajectory.events:
            ax.axvline(time, color=GREY, linewidth=0.9, linestyle=(0, (1.5, 1.5)))
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8}
    words: dict[str, Any] = {"fontsize": SMALL - 1.0, "color": GREY, "rotation": 90, "va": "top", "bbox": box}
    for phase in phases[1:]:
        place: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
        axes[0].annotate(phase.name, (phase.time[0], 0.99), (3, 0), **place, **words)


def style_of(result: FlightAssessment, name: str) -> int:
    """Return the number of the line of a mode or a tank, the same in every figure of a flight: tanks first."""
    tanks = result.trajectory.tanks
    names = [*(f"{tank} slosh" for tank in tanks), "rigid body"]
    names += dict.fromkeys(m.name for r in result.reviews for m in r.phase.case.vehicle.flexible_modes)
    names += dict.fromkeys(n for r in result.reviews for n in r.margins.groups if n not in names)
    return names.index(f"{name} slosh" if name in tanks else name)


def course(ax: Axes, pieces: Sequence[tuple[Array, Array]], label: str, k: int, **more: Any) -> None:
    """Draw one curve in pieces, one for each phase; the label stands once."""
    style = curve_style(k) | more
    for n, (time, values) in enumerate(pieces):
        ax.plot(time, values, label=label if n == 0 else None, **style)


def by_tank(result: FlightAssessment, tank: str, name: str) -> list[tuple[Array, Array]]:
    """Return the course of a tank's quantity in pieces: time and values of every phase that has the tank."""
    return [
        (r.time, np.asarray(getattr(r, name))[:, r.phase.tanks.index(tank)])
        for r in result.reviews
        if tank in r.phase.tanks
    ]


def legend(ax: Axes, count: int, place: Any = "best") -> None:
    """Put the legend where it hides least."""
    ax.legend(loc=place, fontsize=SMALL, framealpha=0.9, edgecolor="none", ncols=1 + (count > 4))
