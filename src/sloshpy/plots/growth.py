"""Growth of the slosh mode over its amplitude; zeros are limit cycles."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from sloshpy.limit_cycle import Cycle, GrowthCurve
from sloshpy.plots.style import ALARM, INK, SHADE, SMALL, axes_or_new, curve_style, finish


def plot_growth(curve: GrowthCurve, cycles: Sequence[Cycle] = (), ax: Axes | None = None) -> Axes:
    """Draw sigma(a) of a slosh mode with the limit cycles of the loop as given.

    Args:
        curve: result of `growth_curve`.
        cycles: results of `limit_cycles`; those of other modes are left out.
        ax: where to draw; default: a new figure.
    """
    ax = axes_or_new(ax)
    known = np.isfinite(curve.growth)
    a, sigma = curve.amplitude[known], curve.growth[known]
    own = [c for c in cycles if curve.vanishes_at(c.slosh_amplitude[curve.tank], c.omega)]
    turn = int(np.argmax(a)) if len(a) else 0  # beyond it another tank takes the mode over
    radius = next((t.radius for t in curve.case.vehicle.tanks if t.name == curve.tank), None)
    wall = np.inf if radius is None else float(radius)  # no wave is as high as its tank is wide
    shown = max((4.0 * c.slosh_amplitude[curve.tank] for c in own), default=wall)
    right = min(float(a[turn]), shown) if len(a) else 1.0
    inside = (a <= right) & (np.arange(len(a)) <= turn)
    most, least = float(np.max(sigma, initial=0.0)), float(np.min(sigma[inside], initial=0.0))
    reach = max(most - least, 1e-6)
    ax.set_xlim(0.0, right)
    ax.set_ylim(least - 0.1 * reach, most + 0.2 * reach)
    ax.axhspan(0.0, most + 0.2 * reach, color=SHADE, alpha=0.6, linewidth=0.0)
    ax.axhline(0.0, color=INK, linewidth=0.9)
    ax.annotate("grows", (0.98, 0.95), xycoords="axes fraction", ha="right", va="top", fontsize=10.0, color=INK)
    ax.annotate("decays", (0.02, 0.03), xycoords="axes fraction", fontsize=10.0, color=INK)
    ax.plot(a, sigma, **curve_style(2))
    if curve.folded and inside[turn]:
        words = f"turns back at {a[turn]:.3g} m:\nanother tank takes the mode over"
        place: dict[str, Any] = {"textcoords": "axes fraction", "ha": "right", "va": "center", "fontsize": SMALL}
        ax.annotate(words, (a[turn], sigma[turn]), (0.72, 0.25), arrowprops={"arrowstyle": "-", "color": INK}, **place)
    for cycle in own:
        at = cycle.slosh_amplitude[curve.tank]
        filled = ALARM if cycle.stable else "white"
        ax.plot(at, 0.0, "o", markersize=9.0, markerfacecolor=filled, markeredgecolor=ALARM, markeredgewidth=1.6)
        kind = "stable" if cycle.stable else "unstable"
        words = f"{kind} limit cycle\n{at:.3g} m, {1e3 * cycle.tvc_amplitude:.3g} mrad"
        ax.annotate(words, (at, 0.0), (8, 8), textcoords="offset points", va="bottom", fontsize=SMALL, color=ALARM)
    finish(ax, _message(curve, own), f"{curve.tank} slosh amplitude [m]", "Growth rate [1/s]")
    return ax


def _message(curve: GrowthCurve, own: Sequence[Cycle]) -> str:
    start = f"Small {curve.tank} slosh doubles in {curve.time_to_double:.3g} s"
    if not np.isfinite(curve.time_to_double):
        start = f"Small {curve.tank} slosh dies out"
    stable = sorted(c.slosh_amplitude[curve.tank] for c in own if c.stable)
    if stable:
        return f"{start}; with the loop as given it settles at " + ", ".join(f"{a:.3g} m" for a in stable)
    return f"{start}; this mode has no stable limit cycle of its own"
