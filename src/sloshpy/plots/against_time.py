"""A number of a dispersed flight against time: median of the flights drawn, and what holds for all at a confidence."""

import numpy as np
from matplotlib.axes import Axes

from sloshpy.dispersion import AgainstTime
from sloshpy.plots.flight_axes import TIME, course, legend
from sloshpy.plots.style import ALARM, GREY, axes_or_new, finish, mark_line


def plot_against_time(found: AgainstTime, ax: Axes | None = None) -> Axes:
    """Draw the percentiles of one number of a dispersed flight over time, broken at its events.

    Args:
        found: result of `against_time`.
        ax: where to draw; default: a new figure.
    """
    ax = axes_or_new(ax)
    phases, of = list(dict.fromkeys(found.phase)), np.array(found.phase)

    def pieces(row: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        shown = np.where(np.isfinite(row), row, np.nan)
        return [(found.time[of == phase], shown[of == phase]) for phase in phases]

    confidence = f"at {100 * found.campaign.dispersion.confidence:g} %"
    course(ax, pieces(found.percentile[0]), "half of the flights drawn", 0)
    shown = [k for k in range(1, len(found.coverage)) if np.any(np.isfinite(found.bound[k]))]
    for place, k in enumerate(shown[-2:]):
        course(ax, pieces(found.bound[k]), f"{100 * found.coverage[k]:g} % of all, {confidence}", 1 + place)
    for phase in phases[1:]:
        ax.axvline(found.time[of == phase][0], color=GREY, linewidth=0.9, linestyle=(0, (1.5, 1.5)))
    ax.set_xlim(found.time[0], found.time[-1])
    if found.column.limit is not None:
        mark_line(ax, found.column.limit, f"criterion {found.column.limit:.4g}", at=0.98, color=ALARM)
    legend(ax, 1 + len(shown[-2:]))
    unit = "" if found.column.unit == "1" else f" [{found.column.unit}]"
    name = found.column.name.replace("_", " ")
    finish(ax, found.message, TIME, name[:1].upper() + name[1:] + unit)
    return ax
