"""The limit cycle that the worst allowed degradation of a loop can produce, with everything its number rests on."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.case import Case
from sloshpy.limit_cycle.cycle import Cycle
from sloshpy.stability.required_damping import RequiredDamping
from sloshpy.units import Array

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, kw_only=True)
class LimitCycle:
    """The limit cycle of one tank that the worst allowed degradation can produce.

    Two conventions for the amplitude at which the law gives the required damping: `paper` takes the oscillation at
    the slosh frequency, the other keeps its own frequency W (xi = f(W A / w), exact). Amplitudes are nan where the
    law's data do not support them; `reasons` says so.

    required: the damping requirement this rests on; together: with what coupled tanks ask of this one besides, see
    `joint_required_damping`. band: (K, 2), rad/s, slosh-related intervals with
    DM < `limit_cycle_disc_margin`. omega: of the least disc margin, rad/s.
    slosh_amplitude, paper_slosh_amplitude: m. tvc_amplitude, paper_tvc_amplitude: (2,), rad, least and greatest.
    gain, delay: the degradation that makes the loop neutral at omega: amplitude ratio and s.
    degraded_growth: greatest growth of the loop so degraded at the required damping, 1/s, 0 but for rounding; nan for a
    negative delay, which is a phase advance.
    coupled: of several tanks, the cycles of the loop so degraded with every tank at its own amplitude; the five steps
    hold the other tanks at their damping instead, which may be too little for one tank and too much for another.
    acceptable: greatest engine amplitude, of both, within the limit; None where no number is supported.
    band_omega, band_tvc, paper_band_tvc: samples of the engine amplitude over the band, for figures.
    """

    case: Case
    tank: str
    required: RequiredDamping
    together: RequiredDamping
    band: Array
    omega: float
    slosh_amplitude: float
    paper_slosh_amplitude: float
    tvc_amplitude: Array
    paper_tvc_amplitude: Array
    gain: float
    delay: float
    degraded_growth: float
    coupled: tuple[Cycle, ...]
    tvc_limit: float
    acceptable: bool | None
    reasons: tuple[str, ...]
    band_omega: Array
    band_tvc: Array
    paper_band_tvc: Array

    @property
    def coupled_amplitude(self) -> tuple[float, float]:
        """Greatest slosh of this tank in m, and engine in rad, of the coupled cycles that attract; nan without one."""
        stable = [c for c in self.coupled if c.stable]
        slosh = max((c.slosh_amplitude[self.tank] for c in stable), default=np.nan)
        return slosh, max((c.tvc_amplitude for c in stable), default=np.nan)

    @property
    def worst_tvc_amplitude(self) -> float:
        """Greatest engine amplitude of the five steps and of the coupled cycles, rad."""
        return max([float(self.tvc_amplitude[1]), *(c.tvc_amplitude for c in self.coupled if c.stable)])

    @property
    def worst_slosh_amplitude(self) -> float:
        """Greatest slosh amplitude of this tank likewise, m."""
        return max([self.slosh_amplitude, *(c.slosh_amplitude[self.tank] for c in self.coupled if c.stable)])

    @property
    def gain_db(self) -> float:
        """The gain degradation in dB."""
        return float(20.0 * np.log10(self.gain))

    @property
    def _checked(self) -> str:
        if np.isnan(self.degraded_growth):
            return ", a phase advance"
        neutral = abs(self.degraded_growth) < 1e-9 * self.omega
        return " (poles confirm)" if neutral else f" (another mode grows then, {self.degraded_growth:+.3g} 1/s)"

    @property
    def _held(self) -> str:
        others = [
            f"{t.name} at {100 * xi:.3g} %"
            for t, xi in zip(self.case.vehicle.tanks, self.required.source.damping, strict=True)
            if t.name != self.tank
        ]
        return f" (with {', '.join(others)})" if others else ""

    def __str__(self) -> str:
        numbers = np.all(np.isfinite(self.tvc_amplitude))
        return "\n".join([self.summary(), *(f"  {reason}" for reason in self.reasons if numbers)])

    def summary(self) -> str:
        """Return the numbers in four lines, or the reasons where there are none."""
        if not np.all(np.isfinite(self.tvc_amplitude)):
            return f"{self.tank}: " + "; ".join(self.reasons)
        bands = ", ".join(f"{a:.4f}-{b:.4f}" for a, b in self.band / (2.0 * np.pi))
        verdict = {None: "not supported", True: "acceptable", False: "NOT acceptable"}[self.acceptable]
        lines = [
            f"{self.tank}: {verdict}; engine {_angles(self.tvc_amplitude)}, limit {np.degrees(self.tvc_limit):.3f} deg",
            f"  slosh {self.slosh_amplitude:.4f} m at {self.omega / 2 / np.pi:.4f} Hz, band {bands} Hz",
            f"  paper's convention: slosh {self.paper_slosh_amplitude:.4f} m, engine "
            f"{_angles(self.paper_tvc_amplitude).partition(' (')[0]}",
            f"  required damping {100 * float(self.required.required):.4f} %{self._held}; neutral after "
            f"{self.gain_db:.3f} dB and {1e3 * self.delay:.1f} ms{self._checked}",
        ]
        lines += [f"  all tanks coupled: {cycle}" for cycle in self.coupled]
        return "\n".join(lines)

    def to_dataset(self) -> "xr.Dataset":
        """Return the engine amplitude over the band as an xarray Dataset, the rest in its attributes."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "tvc_amplitude": ("omega", self.band_tvc, {"units": "rad"}),
                "paper_tvc_amplitude": ("omega", self.paper_band_tvc, {"units": "rad"}),
            },
            coords={"omega": ("omega", self.band_omega, {"units": "rad/s"})},
            attrs={
                "tank": self.tank,
                "slosh_amplitude_m": self.slosh_amplitude,
                "paper_slosh_amplitude_m": self.paper_slosh_amplitude,
                "gain_db": self.gain_db,
                "delay_s": self.delay,
            },
        )


def _angles(least_greatest: Array) -> str:
    """Return a range of engine angles in mrad and deg."""
    low, high = least_greatest
    if high > 0.5 * np.pi:
        return f"{1e3 * low:.3f} to beyond 1571 mrad ({np.degrees(low):.3f} to beyond 90 deg)"
    return f"{1e3 * low:.3f}-{1e3 * high:.3f} mrad ({np.degrees(low):.3f}-{np.degrees(high):.3f} deg)"
