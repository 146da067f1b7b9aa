"""Signed disc margin of a tank over its slosh damping, with the damping it needs."""

import numpy as np
from matplotlib.axes import Axes

from sloshpy.plots.style import (
    ALARM,
    INK,
    SAFE,
    SHADE,
    SMALL,
    axes_or_new,
    curve_style,
    finish,
    mark_line,
    percent,
)
from sloshpy.stability import DiscMarginCurve


def plot_damping_sweep(curve: DiscMarginCurve, ax: Axes | None = None) -> Axes:
    """Draw the signed disc margin against damping; the unstable side is shaded, neutral and required are marked."""
    ax = axes_or_new(ax)
    known = np.isfinite(curve.disc_margin)
    need, neutral = float(curve.required.required), float(curve.required.neutral)
    xi, margin = 100.0 * curve.damping, curve.disc_margin
    ax.plot(xi[known], margin[known], **curve_style(2))
    low = min(float(np.min(margin[known], initial=0.0)) * 1.1, -0.5)
    high = max(float(np.max(margin[known], initial=0.0)) * 1.15, 1.5)
    ax.set_xlim(float(xi[0]), float(xi[-1]))
    ax.set_ylim(low, high)
    ax.axhspan(low, 0.0, color=SHADE, alpha=0.6, linewidth=0.0)
    ax.annotate("unstable", (0.98, 0.03), xycoords="axes fraction", ha="right", fontsize=10.0, color=INK)
    mark_line(ax, curve.required.disc_margin, f"wanted {curve.required.disc_margin:g}", at=0.02, color=INK)
    if neutral > 0.0:
        mark_line(ax, 100.0 * neutral, f"neutral {percent(neutral)}", vertical=True, at=0.35, color=ALARM)
    if need > 0.0:
        mark_line(ax, 100.0 * need, f"required {percent(need)}", vertical=True, at=0.35, color=SAFE, linestyle="-")
        ax.plot(100.0 * need, curve.required.disc_margin, "o", color=SAFE, markersize=8.0)
    if not np.any(known):
        text = "no minimum of the disc margin belongs to this tank"
        ax.annotate(text, (0.5, 0.7), xycoords="axes fraction", ha="center", fontsize=SMALL)
    finish(ax, _message(curve), f"{curve.required.tank} slosh damping [%]", "Slosh disc margin, negative: unstable")
    return ax


def _message(curve: DiscMarginCurve) -> str:
    tank, need, neutral = curve.required.tank, float(curve.required.required), float(curve.required.neutral)
    if np.isnan(need):
        return f"{tank}: no slosh damping reaches a disc margin of {curve.required.disc_margin:g}"
    if need == 0.0:
        return f"{tank}: the disc margin is {curve.required.disc_margin:g} or more at every slosh damping"
    text = f"{tank} reaches a disc margin of {curve.required.disc_margin:g} at {percent(need)} slosh damping"
    return f"{text} and is stable from {percent(neutral)} on" if neutral > 0.0 else text
