"""Time history of slosh and engine, fig 9."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from sloshpy.plots.style import ALARM, SMALL, curve_style, finish, mark_line, pair_or_new
from sloshpy.simulation import Envelope, TimeHistory
from sloshpy.units import Array

DOWN = 0.1  # of the greatest motion: what is left of less has died down
MOST_POINTS = 4000  # drawn for each signal; the figure is 500 points wide


def plot_time_history(history: TimeHistory, ax: Sequence[Axes] | None = None) -> tuple[Axes, Axes]:
    """Draw slosh of every tank above the engine angle over time, with the settled amplitudes.

    Args:
        history: result of `simulate`.
        ax: two Axes, slosh above engine; default: a new figure.
    """
    slosh, engine = pair_or_new(ax)
    every = slice(None, None, 1 + len(history.time) // MOST_POINTS)
    time = history.time[every]
    tanks = history.case.vehicle.tanks
    for j, tank in enumerate(tanks):
        style = curve_style(2 - j if j < 3 else j) | {"linewidth": 0.9}
        slosh.plot(time, history.slosh[every, j], label=tank.name, **style)
        if len(tanks) == 1:
            _amplitude(slosh, history.slosh_envelope(j), 1.0, "m")
    engine.plot(time, 1e3 * history.tvc[every], **(curve_style(2) | {"linewidth": 0.9}))
    _amplitude(engine, history.tvc_envelope, 1e3, "mrad")
    _room(slosh, history.slosh)
    _room(engine, 1e3 * history.tvc)
    if len(tanks) > 1:
        slosh.legend(loc="upper left", ncols=len(tanks), fontsize=SMALL, framealpha=0.9)
    engine.set_xlim(0.0, float(history.time[-1]))
    finish(slosh, _message(history), y="Slosh displacement [m]")
    finish(engine, "", "Time [s]", "Engine angle [mrad]")
    return slosh, engine


def _amplitude(ax: Axes, found: Envelope, scale: float, unit: str) -> None:
    if found.settled and found.amplitude > 0.0:
        value = scale * found.amplitude
        mark_line(ax, value, f"{value:.3g} {unit}", at=0.02, color=ALARM)
        mark_line(ax, -value, "", at=0.02, color=ALARM)


def _room(ax: Axes, signal: Array) -> None:
    reach = 1.3 * float(np.nanmax(np.abs(signal))) or 1.0
    ax.set_ylim(-reach, reach)


def _message(history: TimeHistory) -> str:
    if history.stopped:
        return f"The oscillation does not settle: {history.stopped}"
    parts = [(t.name, history.slosh_envelope(j)) for j, t in enumerate(history.case.vehicle.tanks)]
    engine = history.tvc_envelope
    if history.left < DOWN:
        return _dies_down(history)
    if not engine.settled or not all(e.settled for _, e in parts):
        why = next(e.reason for e in (engine, *(e for _, e in parts)) if not e.settled)
        return f"No settled limit cycle in {history.time[-1]:.0f} s: {why.removeprefix('unconverged: ')}"
    slosh = ", ".join(f"{name} slosh {e.amplitude:.3g} m" for name, e in parts)
    start = f"Settles into a limit cycle at {engine.omega / 2.0 / np.pi:.3g} Hz"
    return f"{start}: {slosh}, engine {1e3 * engine.amplitude:.3g} mrad"


def _dies_down(history: TimeHistory) -> str:
    peak = np.max(np.abs(history.slosh), axis=0)
    most = int(np.argmax(peak))
    engine = 1e3 * np.max(np.abs(history.tvc))
    end = "comes to rest" if history.left < 1e-6 else f"dies down to {100.0 * history.left:.2g} % of that"
    tank = history.case.vehicle.tanks[most].name
    return (
        f"Peaks at {peak[most]:.3g} m of {tank} slosh and {engine:.3g} mrad of engine, {end} within "
        f"{history.time[-1]:.0f} s"
    )
