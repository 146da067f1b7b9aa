"""The look that all figures share: curves told apart without colour, labelled; titles that say the message."""

import re
import textwrap
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sloshpy.units import Array

SIZE = (7.2, 4.6)  # inches: fonts of 10 pt stay 10 pt on a page 18 cm wide
TITLE_WIDTH = 66  # characters
SMALL = 9.0  # pt: the least font size in a figure

INK, GREY, SHADE, ALARM, SAFE = "#1a1a1a", "#6b6b6b", "#d9d9d9", "#b22222", "#00558a"
VALID = "#e2ebf2"  # the range in which data or a formula hold

# dark to light, so that the order survives in grey; style and width say the same again
CURVES: tuple[dict[str, Any], ...] = (
    {"color": "#b22222", "linestyle": (0, (1.2, 1.2)), "linewidth": 2.0},
    {"color": "#c26a00", "linestyle": (0, (5.0, 2.0)), "linewidth": 1.6},
    {"color": "#00558a", "linestyle": "-", "linewidth": 2.6},
    {"color": "#3f8f5b", "linestyle": "-", "linewidth": 1.1},
    {"color": "#6b4a9e", "linestyle": (0, (7.0, 2.0, 1.2, 2.0)), "linewidth": 1.4},
    {"color": "#5a5a5a", "linestyle": (0, (3.0, 3.0)), "linewidth": 1.0},
)


def curve_style(k: int) -> dict[str, Any]:
    """Return the line of the k-th curve of a family; the styles repeat after six."""
    return CURVES[k % len(CURVES)]


def axes_or_new(ax: Axes | None) -> Axes:
    """Return the given Axes, or those of a new figure that belongs to no backend."""
    return Figure(figsize=SIZE, layout="constrained").add_subplot() if ax is None else ax


def pair_or_new(ax: Sequence[Axes] | None) -> tuple[Axes, Axes]:
    """Return two Axes stacked over a common abscissa, given or new."""
    if ax is not None:
        top, bottom = ax
        return top, bottom
    top, bottom = Figure(figsize=(SIZE[0], 5.6), layout="constrained").subplots(2, sharex=True)
    return top, bottom


def finish(ax: Axes, title: str, x: str = "", y: str = "") -> None:
    """Set the message, the axis labels and a quiet grid."""
    if title:
        kept = re.sub(r"(\d) (?=\S{1,5}(\s|[,;:]|$))", "\\1\u00a0", title)  # no line ends between a number and its unit
        lines = textwrap.fill(kept, TITLE_WIDTH).replace("\u00a0", " ")
        ax.set_title(lines, loc="left", fontsize=11.0, fontweight="bold")
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    ax.grid(True, color="#e2e2e2", linewidth=0.6)
    ax.set_axisbelow(True)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)


def mark_line(ax: Axes, value: float, text: str, *, vertical: bool = False, at: float = 0.98, **line: Any) -> None:
    """Draw a thin reference line across the Axes with its label beside it, `at` a fraction along it."""
    style: dict[str, Any] = {"color": GREY, "linewidth": 1.0, "linestyle": (0, (4.0, 2.0))} | line
    box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85}
    words: dict[str, Any] = {"fontsize": SMALL, "color": style["color"], "bbox": box, "textcoords": "offset points"}
    if vertical:
        ax.axvline(value, **style)
        words |= {"xycoords": ("data", "axes fraction"), "rotation": 90, "ha": "right", "va": "top"}
        ax.annotate(text, (value, at), (-2, 0), **words)
    else:
        ax.axhline(value, **style)
        words |= {"xycoords": ("axes fraction", "data"), "ha": "right" if at > 0.5 else "left", "va": "bottom"}
        ax.annotate(text, (at, value), (0, 2), **words)


def shade_valid(ax: Axes, low: float, high: float, label: str) -> None:
    """Shade the abscissas on which data or a formula hold, with edges that survive in grey; what is white, does not.

    The label says what of them holds, in the legend of the Axes.
    """
    ax.axvspan(low, high, facecolor=VALID, edgecolor=GREY, linewidth=0.8, zorder=0, label=label)


def label_column(ax: Axes, anchors: Sequence[tuple[float, float]], texts: Sequence[str], at: float, gap: float) -> None:
    """Label points of curves by a column of texts with leaders; set the limits of the Axes before.

    Args:
        ax: where. anchors: points in data coordinates. texts: one for each.
        at: abscissa of the column as a fraction of the Axes; texts run away from the anchors.
        gap: least distance between the texts as a fraction of the Axes' height.
    """
    place = (ax.transScale + ax.transLimits).transform(anchors)
    order = sorted(range(len(texts)), key=lambda k: place[k][1])
    low = 0.03
    heights = {}
    for rank, k in enumerate(order):
        room = 0.97 - gap * (len(order) - 1 - rank)  # leaves room for the texts above
        low = min(max(low, place[k][1]), room)
        heights[k] = low
        low += gap
    for k in order:
        right = at > place[k][0]
        ax.annotate(
            texts[k],
            anchors[k],
            (at, heights[k]),
            textcoords="axes fraction",
            ha="left" if right else "right",
            va="center",
            fontsize=SMALL,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.8},
            arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.7, "shrinkA": 1.0, "shrinkB": 1.0},
        )


def percent(ratio: float | Array) -> str:
    """Return a ratio in percent with three digits: "4.74 %"."""
    return f"{100.0 * float(ratio):.3g} %"
