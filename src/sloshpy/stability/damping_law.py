"""A tank's damping law against what its loop needs: the amplitudes at which it is neutral and at which it suffices."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.case import Case
from sloshpy.stability.required_damping import RequiredDamping
from sloshpy.units import Array

if TYPE_CHECKING:
    import xarray as xr

HEADROOM = 1.5  # a formula is followed to this multiple of the required damping


@dataclass(frozen=True, kw_only=True)
class DampingLawCurve:
    """xi(A) of one tank; amplitudes are of the slosh mass at its own slosh frequency, in m.

    amplitude, ratio: (A,). neutral_amplitude, required_amplitude: from which on the law gives the neutral and the
    required damping; nan where the data end before or no damping suffices, inf where a constant never gives it, 0 where
    none is needed.
    tested: the range that the law's data cover, m; (0, inf) for a formula.
    """

    case: Case
    tank: str
    amplitude: Array
    ratio: Array
    required: RequiredDamping
    neutral_amplitude: float
    required_amplitude: float
    tested: tuple[float, float]

    def __str__(self) -> str:
        marks = (("neutral", self.neutral_amplitude), ("required", self.required_amplitude))
        return f"{self.tank}: " + ", ".join(f"{name} damping from {value:.4g} m on" for name, value in marks)

    def to_dataset(self) -> "xr.Dataset":
        """Return the law as an xarray Dataset over the amplitude."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {"damping": ("amplitude", self.ratio, {"units": "1"})},
            coords={"amplitude": ("amplitude", self.amplitude, {"units": "m"})},
            attrs={
                "tank": self.tank,
                "neutral_amplitude_m": self.neutral_amplitude,
                "required_amplitude_m": self.required_amplitude,
            },
        )


def damping_law_curve(case: Case, required: RequiredDamping, amplitude: Array | None = None) -> DampingLawCurve:
    """Return the damping law of the tank that a requirement speaks of.

    Args:
        case: one vehicle, no batch.
        required: the tank's neutral and required damping.
        amplitude: m, increasing; default: the tested range, or past the required damping.
    """
    law = next(t.damping for t in case.vehicle.tanks if t.name == required.tank)
    marks = [
        float(law.amplitude(xi)) if xi > 0.0 else 0.0 if xi == 0.0 else np.nan
        for xi in (float(required.neutral), float(required.required))
    ]
    tested = law.smallest_amplitude, law.largest_amplitude
    if amplitude is None:
        most = tested[1]
        if np.isinf(most):
            wanted = HEADROOM * float(required.required) if float(required.required) > 0.0 else 0.05
            reached = float(law.amplitude(wanted))
            most = reached if 0.0 < reached < np.inf else 1.0  # m: a constant has no scale of its own
        amplitude = np.linspace(tested[0], most, 201)
    return DampingLawCurve(
        case=case,
        tank=required.tank,
        amplitude=np.asarray(amplitude, dtype=float),
        ratio=np.asarray(law.ratio(amplitude)),
        required=required,
        neutral_amplitude=marks[0],
        required_amplitude=marks[1],
        tested=tested,
    )
