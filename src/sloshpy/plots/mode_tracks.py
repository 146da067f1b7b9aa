"""Frequency and damping of the closed-loop modes along a parameter, each drawn as the tank that takes part most."""

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes

from sloshpy.plots.style import ALARM, GREY, INK, SHADE, SMALL, curve_style, finish, pair_or_new
from sloshpy.stability import ModeTracks

OTHER: dict[str, Any] = {"color": GREY, "linestyle": (0, (1.0, 3.0)), "linewidth": 1.0}


def plot_mode_tracks(tracks: ModeTracks, ax: Sequence[Axes] | None = None) -> tuple[Axes, Axes]:
    """Draw the slosh branches and what lies in their frequencies; the line changes where the tank does.

    Args:
        tracks: result of `track_modes`.
        ax: two Axes, frequency above damping; default: a new figure.
    """
    top, bottom = pair_or_new(ax)
    low, high = tracks.window
    style = {f"{tank} slosh": curve_style(k) for k, tank in enumerate(reversed(tracks.tanks))}
    x, percent = tracks.parameter, 100.0 * tracks.damping_ratio
    for veering in tracks.veering:
        for axes in (top, bottom):
            axes.axvspan(veering.start, veering.end, color=SHADE, alpha=0.6, linewidth=0.0)
    for start, end, _ in tracks.unresolved:
        for axes in (top, bottom):
            axes.axvspan(start, end, facecolor="none", edgecolor=ALARM, hatch="//", linewidth=0.0)
    for n in range(tracks.pole.shape[1]):
        for label, first, last in tracks.runs(n):
            line, stretch = style.get(label, OTHER), slice(first, last + 1)
            top.plot(x[stretch], tracks.f_hz[stretch, n], **line)
            if n in tracks.slosh:
                bottom.plot(x[stretch], percent[stretch, n], **line)
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.8}
    for n in tracks.slosh:
        first = tracks.runs(n)[0][1]
        for axes, values in ((top, tracks.f_hz), (bottom, percent)):
            words: dict[str, Any] = {
                "textcoords": "offset points",
                "fontsize": SMALL,
                "fontweight": "bold",
                "bbox": box,
            }
            # one beside the other where branches start together
            axes.annotate(f"{n + 1}", (x[first], values[first, n]), (6 + 11 * n, 0), va="center", **words)
    top.set_xlim(x[0], x[-1])
    top.set_ylim(low, high)
    bottom.set_xlim(x[0], x[-1])
    bottom.axhline(0.0, color=INK, linewidth=0.9)
    for label, line in style.items():
        top.plot([], [], label=label, **line)
    top.plot([], [], label="another mode", **OTHER)
    top.legend(loc="best", fontsize=SMALL, framealpha=0.9, edgecolor="none")
    name = f"{tracks.name[:1].upper()}{tracks.name[1:]}" + (f" [{tracks.unit}]" if tracks.unit else "")
    finish(top, _message(tracks), y="Frequency [Hz]")
    finish(bottom, "", name, "Damping [%], negative: unstable")
    return top, bottom


def _message(tracks: ModeTracks) -> str:
    unit = f" {tracks.unit}" if tracks.unit else ""
    if tracks.veering:
        v = min(tracks.veering, key=lambda veering: veering.gap)
        one, other = (n + 1 for n in v.modes)
        return (
            f"Modes {one} and {other} exchange {' and '.join(v.tanks)} between {v.start:.4g} and {v.end:.4g}{unit}; "
            f"their frequencies stay {v.gap_hz:.4f} Hz apart"
        )
    if tracks.unresolved:
        return f"Modes could not be followed in {len(tracks.unresolved)} of the intervals"
    return f"Every slosh mode stays with its tank along {tracks.name}"
