"""Least common scale of the tanks' damping: how much more of the same all tanks need together."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import NEUTRAL
from sloshpy.stability.damping_search import LEVELS, DampingSearch, damping_levels
from sloshpy.units import Array, Real

if TYPE_CHECKING:
    import xarray as xr


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
    greatest = float(np.max(given.damping))  # a level is the damping ratio of the tank that is damped most
    every = tuple(range(len(given.plant.tanks)))
    search = DampingSearch(
        at=lambda level, _: replace(given, damping=level[..., None] * given.damping / greatest),
        size=1,
        moved=every,
        counted=every,
        criteria=case.criteria,
        threshold=case.criteria.disc_margin,
        axis=NEUTRAL * float(np.max(given.plant.tank_frequency)),
    )
    neutral, level, _ = (float(x[0]) for x in search.suprema(damping_levels(LEVELS)))
    scale = level / greatest
    return RequiredScale(
        scale=scale,
        neutral=neutral / greatest,
        damping=np.asarray(scale * given.damping),
        disc_margin=case.criteria.disc_margin,
        source=given,
    )
