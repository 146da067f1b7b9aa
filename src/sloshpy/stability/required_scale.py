"""Least common scale of the tanks' damping: how much more of the same all tanks need together."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import NEUTRAL
from sloshpy.stability.damping_search import MOST_RATIO, supremum
from sloshpy.stability.margins import loop_margins
from sloshpy.units import Array, Real

if TYPE_CHECKING:
    import xarray as xr

LEVELS = 81  # scales tried, from a ten-thousandth of the greatest on, in steps of an eighth


@dataclass(frozen=True, kw_only=True)
class RequiredScale:
    """The least scale of every tank's damping above which the loop meets its disc margin; 1 is the damping given.

    scale, neutral: for the disc margin of every tank, and for stability alone; 0 where none is needed, nan where none
    suffices before a tank is damped by 0.3. damping: (n_tanks,), ratios at the scale. source: the loop as given.
    """

    scale: float
    neutral: float
    damping: Array
    disc_margin: float
    source: Loop

    def __str__(self) -> str:
        tanks = self.source.plant.tanks
        if np.isnan(self.scale):
            return f"no common scale of the damping of {', '.join(tanks)} gives a disc margin of {self.disc_margin:g}"
        if self.scale == 0.0:
            return f"a disc margin of {self.disc_margin:g} needs no slosh damping"
        at = ", ".join(f"{tank} {100.0 * xi:.4g} %" for tank, xi in zip(tanks, self.damping, strict=True))
        wanted = f"damping x {self.scale:.4g} gives a disc margin of {self.disc_margin:g}"
        return f"{wanted}: {at}; neutral x {self.neutral:.4g}"

    def to_dataset(self) -> "xr.Dataset":
        """Return scale and damping as an xarray Dataset over the tanks."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "scale": ((), self.scale, {"units": "1"}),
                "neutral": ((), self.neutral, {"units": "1"}),
                "damping": ("tank", self.damping, {"units": "1"}),
            },
            coords={"tank": list(self.source.plant.tanks)},
            attrs={"disc_margin": self.disc_margin},
        )


def required_scale(case: Case, damping: Real | None = None, amplitude: Real | None = None) -> RequiredScale:
    """Return the least common scale of the tanks' damping: above it, for every larger one, the disc margin is met.

    Args:
        case: one vehicle and autopilot.
        damping: the ratios that are scaled, one for all tanks or one for each; default: small amplitude.
        amplitude: slosh amplitudes in m at which the laws give them instead.

    Raises:
        ValueError: no tank is damped there, so that there is nothing to scale.
    """
    single(case, "required_scale")
    given = open_loop(case, damping, amplitude)
    if not np.any(given.damping > 0.0):
        raise ValueError("no tank has any damping there to scale; name an amplitude")
    axis = NEUTRAL * float(np.max(given.plant.tank_frequency))
    most = MOST_RATIO / float(np.max(given.damping))
    grid = np.concatenate([[0.0], most * np.geomspace(1e-4, 1.0, LEVELS - 1)])
    threshold = case.criteria.disc_margin

    def short(scale: Array) -> tuple[Array, Array]:
        """Return growth beyond neutral and what the least slosh-related disc margin lacks, (K,)."""
        found = loop_margins(open_loop(case, scale[:, None] * given.damping), case.criteria, crossings=False)
        least = np.abs(found.slosh_disc_margin(*range(len(case.vehicle.tanks)))[0])
        return found.growth - axis, np.where(np.isinf(least), -1.0, threshold - least)

    def lacking(scale: Array, _: object) -> Array:
        growth, lack = short(scale)
        return np.where(growth < 0.0, lack, np.maximum(np.abs(lack), threshold))

    growth, lack = short(grid)
    neutral = supremum((growth >= 0.0)[None], grid, lambda scale, _: short(scale)[0])[0]
    scale = supremum(((growth >= 0.0) | (lack > 0.0))[None], grid, lacking)[0]
    return RequiredScale(
        scale=float(scale),
        neutral=float(neutral),
        damping=np.asarray(scale * given.damping),
        disc_margin=threshold,
        source=given,
    )
