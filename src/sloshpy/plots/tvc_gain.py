"""Slosh displacement per engine angle of the plant, fig 7."""

import numpy as np
from matplotlib.axes import Axes

from sloshpy.plots.style import axes_or_new, curve_style, finish, label_column, mark_line, percent
from sloshpy.stability import DampingSweep


def plot_tvc_gain(sweep: DampingSweep, ax: Axes | None = None) -> Axes:
    """Draw |z/beta| of the swept tank over the frequency about its slosh mode, one curve for each damping."""
    ax = axes_or_new(ax)
    f_hz, tank = sweep.response.f_hz, sweep.required.tank
    shown = sweep.neighbourhood
    values, at = sweep.peak
    anchors, texts = [], []
    for k, xi in enumerate(sweep.damping):
        ax.plot(f_hz[shown], sweep.tvc_gain[k, shown], **curve_style(k))
        anchors.append((float(at[k] / (2.0 * np.pi)), float(values[k])))
        texts.append(f"{percent(xi)}: {values[k]:.3g} m/rad")
    ax.set_xlim(float(f_hz[shown][0]), float(f_hz[shown][-1]))
    ax.set_ylim(0.0, 1.08 * float(np.max(values)))
    mark_line(
        ax,
        float(sweep.case.vehicle.tanks[sweep.tank].frequency) / (2.0 * np.pi),
        "slosh frequency",
        vertical=True,
        at=0.95,
    )
    label_column(ax, anchors, texts, at=0.66, gap=0.07)
    message = (
        f"The less {tank} slosh is damped, the less engine goes with it: "
        f"{values[0]:.3g} m/rad at {percent(sweep.damping[0])} damping, {values[-1]:.3g} m/rad at "
        f"{percent(sweep.damping[-1])}"
    )
    finish(ax, message, "Frequency [Hz]", f"{tank} slosh per engine angle [m/rad]")
    return ax
