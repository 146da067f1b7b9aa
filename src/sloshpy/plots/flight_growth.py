"""Growth over flight time: time to double, and the growth factor of every window in which a mode grows."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from sloshpy.flight import FlightAssessment
from sloshpy.flight.windows import GrowthChain, GrowthWindow
from sloshpy.plots.flight_axes import TIME, mark_events
from sloshpy.plots.style import ALARM, INK, SAFE, SMALL, finish, pair_or_new


def plot_flight_growth(result: FlightAssessment, ax: Sequence[Axes] | None = None) -> tuple[Axes, Axes]:
    """Draw the time to double, and each window from its worst start to its end at the factor by which it grows.

    Args:
        result: of `assess_flight`.
        ax: two Axes, time to double above growth factor; default: a new figure.
    """
    top, bottom = pair_or_new(ax)
    for r in result.reviews:
        top.plot(r.time, np.where(np.isfinite(r.time_to_double), r.time_to_double, np.nan), color=ALARM, linewidth=2.0)
    top.set_yscale("log")
    top.yaxis.set_major_formatter("{x:g}")
    windows = result.windows
    for window in windows:
        bottom.plot([window.start, window.end], 2 * [window.factor], color=ALARM, linewidth=3.0)
        bottom.plot(window.start, window.factor, "o", color=SAFE, markersize=7.0, zorder=5)
    chains = result.chains
    told: list[GrowthWindow | GrowthChain] = [*windows[:3], *chains[:1]]
    for chain in chains:
        bottom.plot([chain.start, chain.end], 2 * [chain.factor], color=ALARM, linewidth=1.6, linestyle="--")
    for one in told:
        bottom.annotate(
            f"{one.mode}: x {one.factor:.3g}", (one.start, one.factor), (6, 6), textcoords="offset points",
            fontsize=SMALL, va="bottom",
        )  # fmt: skip
    bottom.set_ylim(0.0, 1.25 * max([2.0, *(min(one.factor, 1e6) for one in told)]))
    bottom.axhline(1.0, color=INK, linewidth=0.9)
    mark_events([top, bottom], result)
    if windows:
        first = windows[0]
        message = f"{first.mode} grows by {first.factor:.3g} from its worst start at {first.start:.0f} s"
        on = max(chains, key=lambda chain: chain.factor, default=None)
        if on is not None and on.factor > first.factor:
            message = (
                f"{on.mode} grows by {on.factor:.3g} from {on.start:.0f} to {on.end:.0f} s, events passed (dashed)"
            )
    else:
        message = "No mode grows at small amplitude"
        top.annotate("nothing grows", (0.5, 0.5), xycoords="axes fraction", ha="center")
    finish(top, message, "", "Time to double [s]")
    finish(bottom, "", TIME, "Growth factor, dot: worst start [1]")
    return top, bottom
