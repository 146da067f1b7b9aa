"""Predicted engine amplitude over the slosh-related band, fig 8."""

import numpy as np
from matplotlib.axes import Axes

from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle import LimitCycle
from sloshpy.plots.style import ALARM, INK, SHADE, SMALL, axes_or_new, curve_style, finish, label_column, mark_line

IN_VIEW = 2.5  # a limit up to this multiple of the amplitude is drawn, a higher one is said


def plot_limit_cycle(found: LimitCycle, ax: Axes | None = None) -> Axes:
    """Draw the engine amplitude over the band of a predicted limit cycle, in both conventions.

    Raises:
        OutsideValidity: the limit cycle has no amplitude to draw; its reasons say why.
    """
    if not np.all(np.isfinite(found.tvc_amplitude)):
        raise OutsideValidity(f"{found.tank}: {'; '.join(found.reasons)}")
    ax = axes_or_new(ax)
    f_hz = found.band_omega / (2.0 * np.pi)
    low, high = 1e3 * found.tvc_amplitude
    paper_low, paper_high = 1e3 * found.paper_tvc_amplitude
    limit = 1e3 * found.tvc_limit
    shown = limit < IN_VIEW * max(1e3 * found.worst_tvc_amplitude, paper_high)
    together = [cycle for cycle in found.coupled if cycle.stable]
    top = max([high, paper_high, limit if shown else 0.0, *(1e3 * cycle.tvc_amplitude for cycle in together)])
    wide = float(np.ptp(f_hz))
    ax.set_xlim(float(f_hz[0]) - 0.25 * wide, float(f_hz[-1]) + 0.7 * wide)
    ax.set_ylim(0.0, 1.12 * top if shown and limit >= top else 1.3 * top)
    for a, b in found.band / (2.0 * np.pi):
        ax.axvspan(a, b, color=SHADE, alpha=0.6, linewidth=0.0)
    anchors, texts = [], []
    starts = np.searchsorted(found.band_omega, found.band[1:, 0])
    curves = (
        (found.band_tvc, "frequency-consistent", low, high, 2),
        (found.paper_band_tvc, "paper's convention", paper_low, paper_high, 1),
    )
    for values, name, least, most, k in curves:
        for f, part in zip(np.split(f_hz, starts), np.split(1e3 * values, starts), strict=True):
            ax.plot(f, part, **curve_style(k))
        anchors.append((float(f_hz[-1]), 1e3 * float(values[-1])))
        texts.append(f"{name}\n{least:.3g} to {most:.3g} mrad")
    for cycle in together:
        anchors.append((cycle.omega / (2.0 * np.pi), 1e3 * cycle.tvc_amplitude))
        ax.plot(*anchors[-1], "D", color=INK, markersize=7.0)
        texts.append(f"all tanks coupled\n{1e3 * cycle.tvc_amplitude:.3g} mrad")
    if shown:
        text = f"limit {limit:.3g} mrad ({np.degrees(found.tvc_limit):.3g} deg)"
        mark_line(ax, limit, text, color=ALARM, linestyle="-", linewidth=1.4)
    label_column(ax, anchors, texts, at=0.72, gap=0.14)
    threshold = found.case.criteria.limit_cycle_disc_margin
    bands = " and ".join(f"{a:.4g} to {b:.4g} Hz" for a, b in found.band / (2.0 * np.pi))
    text = f"shaded: disc margin < {threshold:g}, {bands}"
    ax.annotate(text, (0.02, 0.03), xycoords="axes fraction", fontsize=SMALL, color=INK)
    finish(ax, _message(found), "Frequency [Hz]", "Engine amplitude [mrad]")
    return ax


def _message(found: LimitCycle) -> str:
    worst, limit = np.degrees(found.worst_tvc_amplitude), np.degrees(found.tvc_limit)
    sign = "within" if worst <= limit else "beyond"
    return (
        f"Degraded by its whole margin, {found.tank} slosh of {found.worst_slosh_amplitude:.3g} m moves the engine by "
        f"{worst:.3g} deg, {sign} the limit of {limit:.3g} deg"
    )
