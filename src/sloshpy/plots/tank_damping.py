"""A tank's damping against its slosh amplitude: wall, floor and ring baffles, and how far their formulas hold."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from sloshpy.plots.style import GREY, SMALL, axes_or_new, curve_style, finish, percent, shade_valid
from sloshpy.tank import TankDamping


def plot_tank_damping(found: TankDamping, ax: Axes | None = None) -> Axes:
    """Draw xi over the slosh-mass displacement with its parts; the range in which the formulas hold is shaded.

    The message says where ring baffles of the tank are left out.
    The axis above counts the wave height at the wall.

    Raises:
        OutsideValidity: nothing damps the tank.
    """
    ax = axes_or_new(ax)
    A, xi = found.curve()
    end = min(found.law.largest_amplitude, float(A[-1]))
    ax.set_xlim(0.0, float(A[-1]))
    ax.set_ylim(0.0, 140.0 * float(np.nanmax(xi)))  # room for the legend
    shade_valid(ax, 0.0, end, "the formulas hold")
    rings, constant = found.baffles, found.constant
    if rings is not None and constant is not None:
        ax.plot(A, 100.0 * xi, label="all together", **curve_style(2))
    if rings is not None:
        name = f"{len(rings.rings)} ring{'s' * (len(rings.rings) != 1)} after Miles, {rings.whose}"
        ax.plot(A, 100.0 * rings.ratio(A), label=name, **curve_style(1 if constant is not None else 2))
        words: dict[str, Any] = {"rotation": 90, "ha": "left", "va": "top", "fontsize": SMALL, "color": GREY}
        words |= {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
        ax.axvline(end, color=GREY, linewidth=1.0)
        ax.annotate(f"the formula holds to {end:.3g} m", (end, 0.98), (3, 0), **words)
    if constant is not None:
        ax.plot([0.0, end], [100.0 * constant] * 2, label=found.constant_name, **curve_style(0 if rings else 2))
    ax.legend(loc="upper left", fontsize=SMALL, frameon=False, handlelength=3.2)
    both_ways: Any = (found.wave_height, found.displacement)
    above = ax.secondary_xaxis("top", functions=both_ways)
    above.set_xlabel("Wave height at the wall [m]")
    finish(ax, _message(found), "Slosh-mass displacement [m]", f"{found.modes.tank.name} slosh damping [%]")
    return ax


def _message(found: TankDamping) -> str:
    name, end = found.modes.tank.name, found.law.largest_amplitude
    if np.isinf(end):
        without = ", ring baffles left out: no formula holds" if found.rings_left_out else ""
        return f"{name} is damped by {percent(found.law.ratio(0.0))} at any amplitude{without}"
    return f"{name} is damped by up to {percent(found.law.ratio(end))}, at {end:.3g} m of slosh"
