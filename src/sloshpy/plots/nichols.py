"""Nichols diagram with the disc of eq 24 about every critical point in view, fig 6."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse

from sloshpy.plots.style import GREY, INK, SHADE, SMALL, axes_or_new, curve_style, finish, label_column, percent
from sloshpy.stability import DampingSweep
from sloshpy.units import Array, BoolArray, decibel

DEEPEST, HIGHEST = -30.0, 20.0  # dB: a lobe beyond is cut off
BOX = {"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.8}


def plot_nichols(sweep: DampingSweep, ax: Axes | None = None, *, grid: bool = False) -> Axes:
    """Draw gain against phase of L, one curve for each damping, and the ellipse DM = 1 of eq 24.

    Args:
        sweep: result of `damping_sweep`.
        ax: where to draw; default: a new figure.
        grid: draw contours of the closed-loop gain and phase too.
    """
    ax = axes_or_new(ax)
    phase, gain, lobe = sweep.phase_deg, sweep.response.gain_db, sweep.lobe
    GM, PM = float(decibel(sweep.case.criteria.gain_margin)), float(np.degrees(sweep.case.criteria.phase_margin))
    seen = np.clip(gain[:, lobe], DEEPEST, HIGHEST)
    low, high = min(np.min(seen), -1.6 * GM), max(np.max(seen), 1.6 * GM)
    x = np.append(phase[:, lobe], [-180.0 - 1.6 * PM, -180.0 + 1.6 * PM])
    centre = 360.0 * np.round((float(np.median(x)) + 180.0) / 360.0) - 180.0
    left, right = max(np.min(x), centre - 300.0) - 10.0, min(np.max(x), centre + 300.0) + 60.0
    ax.set_xlim(left, right)
    ax.set_ylim(low - 2.0, high + 0.1 * (high - low))
    if grid:
        _grid(ax)
    for critical in 360.0 * np.arange(np.ceil((left + 180.0) / 360.0), np.floor((right + 180.0) / 360.0) + 1.0) - 180.0:
        disc = Ellipse((critical, 0.0), 2.0 * PM, 2.0 * GM, facecolor=SHADE, edgecolor=INK, linewidth=1.0, alpha=0.7)
        ax.add_patch(disc)
        ax.plot(critical, 0.0, marker="+", color=INK, markersize=11.0, markeredgewidth=1.8)
    anchors, texts = [], []
    for k, (xi, word) in enumerate(zip(sweep.damping, sweep.verdicts, strict=True)):
        ax.plot(phase[k], gain[k], **curve_style(k))
        view = lobe & (phase[k] > left) & (phase[k] < right) & (gain[k] > low) & (gain[k] < high)
        at = _label_place(phase[k], np.asarray(view if np.any(view) else lobe, dtype=bool))
        anchors.append((float(phase[k, at]), float(gain[k, at])))
        texts.append(f"{percent(xi)} {word}")
    label_column(ax, anchors, texts, at=0.8, gap=0.06)
    words = f"grey: disc margin < 1, half-axes {GM:.3g} dB and {PM:.3g} deg"
    ax.annotate(words, (0.02, 0.97), xycoords="axes fraction", va="top", fontsize=SMALL, color=INK, bbox=BOX)
    finish(ax, _message(sweep), "Open-loop phase [deg]", "Open-loop gain [dB]")
    ax.set_xticks(np.arange(30.0 * np.ceil(left / 30.0), right, 30.0 if right - left < 400.0 else 60.0))
    return ax


def _label_place(phase: Array, lobe: BoolArray) -> int:
    """Return where on its way back from the tip of the lobe a curve is labelled: there the curves lie apart."""
    inside = np.flatnonzero(lobe)
    back = inside[int(np.argmin(phase[inside])) :]
    half = 0.5 * (phase[back[0]] + np.max(phase[back]))
    return int(back[int(np.argmax(phase[back] >= half))])


def _message(sweep: DampingSweep) -> str:
    tank, need, neutral = sweep.required.tank, float(sweep.required.required), float(sweep.required.neutral)
    if np.isnan(need):
        return f"No damping of {tank} slosh keeps the loop out of the disc"
    if need == 0.0:
        return f"{tank} slosh needs no damping to stay out of the disc"
    if neutral == 0.0:
        return f"{tank} slosh needs {percent(need)} damping to stay out of the disc; it is stable at any"
    return f"{tank} slosh needs {percent(need)} damping to stay out of the disc; unstable below {percent(neutral)}"


def _grid(ax: Axes) -> None:
    from control import nichols_grid  # 2 to 5 s: only when the grid is wanted

    limits = ax.get_xlim(), ax.get_ylim()
    nichols_grid(ax=ax)
    ax.set_xlim(limits[0])
    ax.set_ylim(limits[1])
    for line in ax.get_lines():
        line.set(color=GREY, linewidth=0.5)
