"""Growth along a flight against its simulation: the slosh and the amplitude predicted for it."""

from matplotlib.axes import Axes

from sloshpy.flight import GrowthCheck
from sloshpy.plots.flight_axes import TIME
from sloshpy.plots.style import ALARM, GREY, SMALL, axes_or_new, finish, mark_line
from sloshpy.units import compared


def plot_growth_check(check: GrowthCheck, ax: Axes | None = None) -> Axes:
    """Draw the simulated slosh of a tank and the amplitude that its growth predicts.

    Args:
        check: result of `check_growth`.
        ax: where to draw; default: a new figure.
    """
    ax = axes_or_new(ax)
    growth, history = check.growth, check.history
    tank = growth.phase.tanks.index(growth.tank)
    ax.plot(history.time, history.slosh[:, tank], color=GREY, linewidth=0.5, label="simulated")
    ax.plot(growth.time, growth.amplitude, color=ALARM, linewidth=2.2, label="predicted amplitude")
    ax.plot(growth.time, -growth.amplitude, color=ALARM, linewidth=2.2)
    if growth.carries:
        label = "least that the event can leave"
        ax.plot(growth.time, growth.least, color=ALARM, linewidth=1.0, linestyle=(0, (4.0, 2.0)), label=label)
        ax.plot(growth.time, -growth.least, color=ALARM, linewidth=1.0, linestyle=(0, (4.0, 2.0)))
    for carry in growth.carries:
        mark_line(ax, carry.event.end, carry.event.after, vertical=True, at=0.3)
    ax.set_xlim(float(growth.time[0]), float(growth.time[-1]))
    most = 1.45 * float(growth.amplitude[growth.greatest])
    ax.set_ylim(-most, most)
    ax.legend(loc="upper center", ncols=3, fontsize=SMALL, framealpha=0.9, edgecolor="none")
    k = growth.greatest
    course = (
        f"grows from {growth.amplitude[0]:.3g} to {growth.amplitude[k]:.3g} m at {growth.time[k]:.0f} s"
        if k
        else f"dies down from {growth.amplitude[0]:.3g} to {growth.amplitude[-1]:.3g} m"
    )
    apart = compared(check.worst, "the prediction", 2)
    message = f"{growth.tank} slosh {course}; simulation differs by {apart} at most"
    finish(ax, message, TIME, "Slosh [m]")
    return ax
