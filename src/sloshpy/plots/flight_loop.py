"""The loop over flight time: disc margin by mode, and the frequencies of control, slosh and bending."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter

from sloshpy.flight import FlightAssessment
from sloshpy.plots.flight_axes import TIME, course, legend, mark_events, style_of
from sloshpy.plots.style import ALARM, axes_or_new, finish, mark_line

MOST_SHOWN = 4.0  # disc margins beyond are no concern


def plot_flight_margins(result: FlightAssessment, ax: Axes | None = None) -> Axes:
    """Draw the disc margin of every mode over flight time, times at which the loop is unstable hatched.

    Args:
        result: of `assess_flight`.
        ax: where to draw; default: a new figure.
    """
    ax = axes_or_new(ax)
    limit = result.trajectory.phases[0].case.criteria.disc_margin
    modes = tuple(dict.fromkeys(name for r in result.reviews for name in r.margins.groups))
    for mode in modes:
        own = [r for r in result.reviews if mode in r.margins.groups]
        pieces = [
            (r.time, np.where(r.margins.stable, r.disc_margin[:, r.margins.groups.index(mode)], np.nan)) for r in own
        ]
        pieces = [(time, np.where(np.isfinite(values), values, np.nan)) for time, values in pieces]
        course(ax, pieces, mode, style_of(result, mode))
    ax.set_ylim(0.0, MOST_SHOWN)
    unstable = False
    for r in result.reviews:
        where = ~np.asarray(r.margins.stable)
        unstable |= bool(np.any(where))
        ax.fill_between(
            r.time,
            0.0,
            MOST_SHOWN,
            where=where,
            facecolor="none",
            edgecolor=ALARM,
            hatch="//",
            linewidth=0.0,
            step="mid",
        )
    mark_line(ax, limit, f"criterion {limit:g}", at=0.98, color=ALARM)
    mark_events([ax], result)
    legend(ax, len(modes), "lower left")
    finish(ax, _margin_message(result), TIME, "Disc margin [1]" + (", hatched: loop unstable" if unstable else ""))
    return ax


def _margin_message(result: FlightAssessment) -> str:
    rows = [one for one in result.worst if one.criterion.startswith("disc margin") and one.value > 0.0]
    unstable = [r for r in result.reviews if not np.all(r.margins.stable)]
    if unstable:
        when = result.windows[0]
        return f"At small amplitude {when.mode} is unstable from {when.start:.0f} to {when.end:.0f} s"
    least = min(rows, key=lambda one: one.value)
    mode = least.criterion.removeprefix("disc margin, ")
    return f"Least disc margin {least.value:.2f}, of {mode}, at {least.time:g} s"


def plot_flight_frequencies(result: FlightAssessment, ax: Axes | None = None) -> Axes:
    """Draw the closed-loop frequencies of control, slosh and bending over flight time.

    Args:
        result: of `assess_flight`.
        ax: where to draw; default: a new figure.
    """
    ax = axes_or_new(ax)
    labels = [f"{tank} slosh" for tank in result.trajectory.tanks]
    labels = ["rigid body", *labels]
    labels += dict.fromkeys(m.name for r in result.reviews for m in r.phase.case.vehicle.flexible_modes)
    for label in labels:
        pieces = []
        for r in result.reviews:
            own = np.array([[name == label for name in row] for row in r.tracks.label])
            if np.any(own):
                found = np.where(own & (r.tracks.f_hz > 0.0), r.tracks.f_hz, np.inf)
                least = np.min(found, axis=1)
                pieces.append((r.time, np.where(np.isfinite(least), least, np.nan)))
        course(ax, pieces, "control (rigid body)" if label == "rigid body" else label, style_of(result, label))
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_formatter(NullFormatter())
    mark_events([ax], result)
    legend(ax, len(labels), "upper right")
    veering = [(v, r) for r in result.reviews for v in r.tracks.veering]
    for v, _ in veering:
        ax.axvspan(v.start, v.end, color="#d9d9d9", alpha=0.8, linewidth=0.0)
    message = "Control, slosh and bending keep their order of frequency"
    if veering:
        v = min(veering, key=lambda pair: pair[0].gap)[0]
        message = f"{v.tanks[0]} and {v.tanks[1]} slosh exchange modes at {v.start:g} to {v.end:g} s (shaded)"
    finish(ax, message, TIME, "Closed-loop frequency [Hz]")
    return ax
