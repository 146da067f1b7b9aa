"""A limit cycle of the loop, all tanks coupled."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.case import Case
from sloshpy.damping.validity import words_on_radius

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, kw_only=True)
class Cycle:
    """A limit cycle of the loop as given: frequency in rad/s, amplitudes in m and rad.

    tank: whose branch led there; "" of a cycle of the engine at its limits, whatever mode carries it.
    disturbance: greatest growth rate of a small disturbance of the cycle, 1/s; it attracts where that is negative.
    """

    tank: str
    omega: float
    slosh_amplitude: dict[str, float]
    tvc_amplitude: float
    disturbance: float

    @property
    def stable(self) -> bool:
        """Whether the cycle attracts: every small disturbance of it, in whatever mode, dies out."""
        return self.disturbance < 0.0

    def on_radius(self, case: Case) -> dict[str, tuple[str, bool]]:
        """Return what to say of each tank that sloshes far in its radius, and whether no model holds there."""
        told = {
            t.name: words_on_radius(self.slosh_amplitude[t.name], float(t.radius))
            for t in case.vehicle.tanks
            if t.radius
        }
        return {name: one for name, one in told.items() if one[0]}

    def to_dataset(self) -> "xr.Dataset":
        """Return the cycle as an xarray Dataset over the tanks."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "slosh": ("tank", list(self.slosh_amplitude.values()), {"units": "m"}),
                "omega": ((), self.omega, {"units": "rad/s"}),
                "tvc": ((), self.tvc_amplitude, {"units": "rad"}),
                "disturbance": ((), self.disturbance, {"units": "1/s"}),
            },
            coords={"tank": list(self.slosh_amplitude)},
            attrs={"stable": int(self.stable)},
        )

    def __str__(self) -> str:
        slosh = ", ".join(f"{name} {a:.4f} m" for name, a in self.slosh_amplitude.items())
        kind = "stable" if self.stable else "unstable"
        at_limits = "" if self.tank else " with the engine at its limits"
        engine = f"engine {1e3 * self.tvc_amplitude:.3f} mrad"
        return f"{kind} limit cycle{at_limits} at {self.omega / 2 / np.pi:.4f} Hz: {slosh}, {engine}"
