"""Bode diagram of the open loop at several slosh dampings, fig 5."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from sloshpy.plots.style import INK, curve_style, finish, label_column, mark_line, pair_or_new, percent
from sloshpy.stability import DampingSweep


def plot_bode(sweep: DampingSweep, ax: Sequence[Axes] | None = None) -> tuple[Axes, Axes]:
    """Draw gain and phase of L over the frequency, one curve for each damping of the sweep.

    Args:
        sweep: result of `damping_sweep`.
        ax: two Axes, gain above phase; default: a new figure.
    """
    gain, phase = pair_or_new(ax)
    f_hz = sweep.response.f_hz
    low, high = np.array(sweep.window) / (2.0 * np.pi)
    shown = (f_hz >= low) & (f_hz <= high)
    lobe = shown & sweep.lobe
    anchors, texts = [], []
    for k, xi in enumerate(sweep.damping):
        gain.semilogx(f_hz[shown], sweep.response.gain_db[k, shown], **curve_style(k))
        phase.semilogx(f_hz[shown], sweep.phase_deg[k, shown], **curve_style(k))
        peak = int(np.argmax(np.where(lobe, sweep.tvc_gain[k], -np.inf)))
        anchors.append((float(f_hz[peak]), float(sweep.response.gain_db[k, peak])))
        texts.append(percent(xi))
    mark_line(gain, 0.0, "0 dB", at=0.02, color=INK, linestyle="-", linewidth=0.8)
    critical = 360.0 * np.arange(-6, 6) - 180.0
    least, most = phase.get_ylim()
    for angle in critical[(critical > least) & (critical < most)]:
        mark_line(phase, float(angle), f"{angle:.0f} deg", at=0.02, color=INK, linestyle="-", linewidth=0.8)
    tank = sweep.required.tank
    frequency = float(sweep.peak[1, 0]) / (2.0 * np.pi)  # of the mode in the vehicle, not of the tank at rest
    gain.set_xlim(low, high)
    step = 45.0 if most - least < 300.0 else 90.0
    phase.set_yticks(np.arange(step * np.ceil(least / step), most, step))
    label_column(gain, anchors, texts, at=0.72, gap=0.085)
    message = f"The {tank} slosh mode at {frequency:.3g} Hz peaks higher and turns the phase more the less it is damped"
    finish(gain, message, y="Open-loop gain [dB]")
    finish(phase, "", "Frequency [Hz]", "Open-loop phase [deg]")
    phase.set_xlim(low, high)
    _decimal(phase)
    return gain, phase


def _decimal(ax: Axes) -> None:
    """Write a logarithmic frequency axis in plain numbers."""
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
