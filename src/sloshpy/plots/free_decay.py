"""A free decay with its fit, and the damping that it shows over the amplitude."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sloshpy.damping import FreeDecay
from sloshpy.plots.style import ALARM, GREY, SAFE, SIZE, SMALL, finish, percent, shade_valid

_MOST_POINTS = 6000  # drawn; the figure is 1000 dots wide


def plot_free_decay(found: FreeDecay, ax: Sequence[Axes] | None = None) -> tuple[Axes, Axes]:
    """Draw the record with the fitted envelope above xi(A) with its band; the tested amplitudes are shaded.

    Args:
        found: result of `free_decay`.
        ax: two Axes, record above damping; default: a new figure.
    """
    if ax is None:
        above, below = Figure(figsize=(SIZE[0], 6.4), layout="constrained").subplots(2)
    else:
        above, below = ax
    _record(above, found)
    _damping(below, found)
    return above, below


def _record(ax: Axes, found: FreeDecay) -> None:
    record = found.record
    every = slice(None, None, 1 + len(record.time) // _MOST_POINTS)
    time = record.time[every]
    ax.plot(time, record.value[every], color=GREY, linewidth=0.8, label="record")
    for sign, label in ((1.0, "fitted envelope"), (-1.0, None)):
        edge = found.center + sign * found.envelope
        ax.plot(time, edge[every], color=ALARM, linewidth=2.0, linestyle=(0, (5.0, 2.0)), label=label)
    ax.set_xlim(float(time[0]), float(time[-1]))
    ax.legend(loc="upper right", ncols=2, fontsize=SMALL, framealpha=0.9)
    low = min(np.min(record.value), np.min(found.center - found.envelope))
    high = max(np.max(record.value), np.max(found.center + found.envelope))
    ax.set_ylim(low - 0.05 * (high - low), high + 0.25 * (high - low))  # the legend stands above the record
    finish(ax, _message(found), "Time [s]", f"{record.column} [{record.unit}]")


def _damping(ax: Axes, found: FreeDecay) -> None:
    low, high = found.tested
    A = found.amplitude
    ax.fill_between(
        A, 100.0 * found.ratio_low, 100.0 * found.ratio_high, color=SAFE, alpha=0.25, linewidth=0.0, label=_band(found)
    )
    ax.plot(A, 100.0 * found.ratio, color=SAFE, linewidth=2.2, label=found.choice.best.laws[0].words)
    top = 1.15 * 100.0 * float(np.max(found.ratio_high))
    right = 1.12 * high
    ax.set_xlim(0.0, right)
    ax.set_ylim(0.0, top)
    shade_valid(ax, low, high, "tested")
    # in the lower right corner of the tested range: damping grows with the amplitude, and the axis begins at zero
    ax.legend(loc="lower right", bbox_to_anchor=(high / right, 0.0), fontsize=SMALL)
    known = found.per_displacement is not None
    what = "Slosh-mass displacement [m]" if known else f"Amplitude of the {found.measured} [{found.record.unit}]"
    finish(ax, "", what, "Damping [%]")


def _band(found: FreeDecay) -> str:
    return f"{100.0 * found.level:g} % band"


def _message(found: FreeDecay) -> str:
    low, high = float(np.min(found.ratio)), float(np.max(found.ratio))
    one = high - low < 1e-3 * high
    ratio = percent(high) if one else f"{percent(low).removesuffix(' %')} to {percent(high)}"
    unit = "m of slosh" if found.per_displacement is not None else found.record.unit
    tested = f"{found.tested[0]:.3g} to {found.tested[1]:.3g} {unit}"
    return f"{found.record.column}: {ratio} damping from {tested}, at {found.f_hz:.4g} Hz"
