"""A tank's damping against its slosh amplitude, with what the loop needs."""

import numpy as np
from matplotlib.axes import Axes

from sloshpy.plots.style import (
    ALARM,
    INK,
    SAFE,
    SMALL,
    axes_or_new,
    curve_style,
    finish,
    mark_line,
    percent,
    shade_valid,
)
from sloshpy.stability import DampingLawCurve


def plot_damping_law(curve: DampingLawCurve, ax: Axes | None = None) -> Axes:
    """Draw xi over the amplitude with neutral and required damping; where the law ends, its range is shaded."""
    ax = axes_or_new(ax)
    a, xi = curve.amplitude, 100.0 * curve.ratio
    ax.plot(a, xi, **curve_style(2))
    need, neutral = float(curve.required.required), float(curve.required.neutral)
    marks = [100.0 * v for v in (need, neutral) if v > 0.0]
    ax.set_ylim(0.0, 1.15 * max([float(np.nanmax(xi)), *marks, 0.1]))
    low, high = curve.tested
    right = float(a[-1]) if np.isinf(high) else 1.15 * high
    ax.set_xlim(0.0, right)
    if low > 0.0 or right > high:
        shade_valid(ax, low, min(high, right), "known")
        words = {"ha": "center", "va": "bottom", "fontsize": SMALL, "color": INK}
        ax.annotate("known", (0.5 * (low + min(high, right)), 0.03), xycoords=("data", "axes fraction"), **words)  # type: ignore[arg-type]
    for begin, end in ((0.0, low), (high, right)):
        if begin < end:
            middle = (0.5 * (begin + end), 0.03)
            words = {"rotation": 90, "ha": "center", "va": "bottom", "fontsize": SMALL, "color": INK}
            ax.annotate("unknown", middle, xycoords=("data", "axes fraction"), **words)  # type: ignore[arg-type]
    for value, at, name, color, line in (
        (need, curve.required_amplitude, "required", SAFE, "-"),
        (neutral, curve.neutral_amplitude, "neutral", ALARM, (0, (4.0, 2.0))),
    ):
        if not value > 0.0:
            continue
        mark_line(ax, 100.0 * value, f"{name} {percent(value)}", at=0.02, color=color, linestyle=line)
        if np.isfinite(at):
            ax.plot(at, 100.0 * value, "o", color=color, markersize=8.0)
            ax.annotate(
                f"{at:.3g} m", (at, 100.0 * value), (8, -4), textcoords="offset points", va="top", fontsize=10.0
            )
    finish(ax, _message(curve), "Slosh amplitude at the slosh frequency [m]", f"{curve.tank} slosh damping [%]")
    return ax


def _message(curve: DampingLawCurve) -> str:
    need, at, tank = float(curve.required.required), curve.required_amplitude, curve.tank
    if np.isnan(need):
        return f"{tank}: no slosh damping suffices, whatever the amplitude"
    if need == 0.0:
        return f"{tank} needs no slosh damping"
    if np.isnan(at):
        return f"The damping law of {tank} ends before the {percent(need)} that it needs"
    if np.isinf(at):
        return f"The damping of {tank} never reaches the {percent(need)} that it needs"
    return f"{tank} slosh has the {percent(need)} damping that it needs from {at:.3g} m on"
