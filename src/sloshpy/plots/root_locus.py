"""Root locus of the loop with its slosh poles and zeros, fig 4."""

import numpy as np
from matplotlib.axes import Axes

from sloshpy.plots.style import ALARM, INK, SHADE, SMALL, axes_or_new, curve_style, finish, label_column
from sloshpy.stability import RootLocus
from sloshpy.units import ComplexArray

POLE: dict[str, object] = {"marker": "x", "markersize": 9.0, "color": INK}
ZERO: dict[str, object] = {"marker": "o", "markersize": 8.0, "color": INK, "fillstyle": "none"}
CLOSED: dict[str, object] = {"marker": "s", "markersize": 6.5, "color": ALARM}


def plot_root_locus(locus: RootLocus, ax: Axes | None = None) -> Axes:
    """Draw the branches over the loop gain, poles, zeros and the poles at the case's own gain, the slosh enlarged."""
    ax = axes_or_new(ax)
    reach = 1.6 * max(float(t.frequency) for t in locus.case.vehicle.tanks)
    closed = locus.closed[np.abs(locus.closed) < reach]
    width = max(0.2 * reach, 1.4 * float(np.max(np.abs(closed.real), initial=0.0)))
    ax.set_xlim(-width, 1.6 * width)
    ax.set_ylim(-0.05 * reach, reach)
    _draw(ax, locus)
    ax.annotate("unstable", (0.985, 0.03), xycoords="axes fraction", ha="right", fontsize=SMALL, color=INK)
    for style, name in ((POLE, "open-loop pole"), (ZERO, "zero"), (CLOSED, "closed loop at the case's gain")):
        ax.plot([], [], linestyle="none", label=name, **style)  # type: ignore[arg-type]
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 0.08), fontsize=SMALL, frameon=False)
    _enlarge(ax, locus)
    finish(ax, _message(locus), "Real part [1/s]", "Imaginary part [rad/s]")
    return ax


def _draw(ax: Axes, locus: RootLocus) -> None:
    """Draw half-plane, branches and markers of the upper half."""
    ax.axvspan(0.0, 1e3, color=SHADE, alpha=0.5, linewidth=0.0)
    ax.axvline(0.0, color=INK, linewidth=0.9)
    upper = [k for k in range(locus.branch.shape[1]) if np.nanmax(locus.branch[:, k].imag) > 0.0]
    for k, b in enumerate(upper):
        ax.plot(locus.branch[:, b].real, locus.branch[:, b].imag, color=curve_style(k + 2)["color"], linewidth=1.8)
    for values, style in ((locus.open_poles, POLE), (locus.zeros, ZERO), (locus.closed, CLOSED)):
        seen = values[values.imag > -1e-9]
        ax.plot(seen.real, seen.imag, linestyle="none", markeredgewidth=1.5, **style)  # type: ignore[arg-type]


def _enlarge(ax: Axes, locus: RootLocus) -> None:
    """Enlarge the neighbourhood of the slosh poles in the empty right half, and name them there."""
    slosh = [locus.case.vehicle.tanks[j].name for j in range(len(locus.case.vehicle.tanks))]
    closed = {n.removesuffix(" slosh"): v for v, n in zip(locus.closed, locus.closed_names, strict=True) if v.imag > 0}
    named = [(name, closed[name]) for name in slosh if name in closed]
    if not named:
        return
    open_ = [_nearest(locus.open_poles, v) for _, v in named]
    zeros = [_nearest(locus.zeros, v) for _, v in named] if np.any(locus.zeros.imag > 0.0) else []
    points = np.array([*(v for _, v in named), *open_, *zeros])
    tall = max(float(np.ptp(points.imag)), 0.02 * float(np.max(points.imag)))
    wide = max(float(np.max(np.abs(points.real))), 0.3 * tall)
    inset = ax.inset_axes((0.52, 0.36, 0.46, 0.6))
    inset.set_xlim(-2.5 * wide, 5.5 * wide)
    inset.set_ylim(float(np.min(points.imag)) - 0.4 * tall, float(np.max(points.imag)) + 0.4 * tall)
    _draw(inset, locus)
    inset.set_title("enlarged", fontsize=SMALL, loc="left", pad=2.0)
    inset.tick_params(labelsize=SMALL)
    anchors = [(float(v.real), float(v.imag)) for v in points]
    texts = [f"{name} closed loop" for name, _ in named] + [f"{name} pole" for name, _ in named]
    texts += [f"{name} zero" for name, _ in named] if zeros else []
    if len(named) > 2:  # too crowded for every marker: the tanks alone
        anchors, texts = anchors[: len(named)], [name for name, _ in named]
    label_column(inset, anchors, texts, at=0.55, gap=0.09)


def _nearest(values: ComplexArray, to: complex) -> complex:
    upper = values[values.imag > 0.0]
    return complex(upper[np.argmin(np.abs(upper - to))])


def _message(locus: RootLocus) -> str:
    at = ", ".join(f"{100.0 * xi:.3g} %" for xi in locus.damping) + " slosh damping"
    start = f"With {at}" if np.any(locus.damping) else "Without slosh damping"
    growing = [
        (v.real, name)
        for v, name in zip(locus.closed, locus.closed_names, strict=True)
        if v.real > 0.0 and name.endswith(" slosh")
    ]
    if not growing:
        return f"{start} the loop leaves every slosh mode in the stable half"
    rate, name = max(growing)
    return f"{start} the loop drives the {name} mode unstable: it grows at {rate:+.3g} 1/s"
