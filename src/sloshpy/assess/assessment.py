"""The review of one case and of each of its tanks: what was found, as text, JSON and a dataset."""

import functools
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.assess.contract import contract
from sloshpy.case import Case
from sloshpy.dynamics import Poles
from sloshpy.limit_cycle import Cycle, LimitCycle
from sloshpy.stability import DangerZone, Margins, RequiredDamping, required_damping

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, kw_only=True)
class TankReview:
    """What was found for one tank; angles in rad, lengths in m, frequencies in rad/s.

    damping_ratio: at which the loop was read. limit_cycle: with the other tanks where all meet the margin together.
    disc_margin, omega: the tank's own, signed; inf and nan where no minimum of the disc margin belongs to it.
    """

    name: str
    damping_ratio: float
    disc_margin: float
    omega: float
    zone: DangerZone
    limit_cycle: LimitCycle

    @functools.cached_property
    def required(self) -> RequiredDamping:
        """Neutral and required damping with the other tanks at small amplitude; found when first asked for."""
        case = self.limit_cycle.case
        return self.limit_cycle.required if len(case.vehicle.tanks) == 1 else required_damping(case, self.name)


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """The review of one case; `reasons` are worst first.

    verdict: "pass", "fail", or "invalid" where the model supports no verdict.
    cycles: limit cycles of the loop as given; None where one sinusoid predicts none (a reason says so).
    read_at: how the damping of the loop properties was chosen, in words.
    other_disc_margin: least disc margin that belongs to no tank; inf where there is none.
    """

    case: Case
    verdict: str
    reasons: tuple[str, ...]
    read_at: str
    poles: Poles
    margins: Margins
    tanks: tuple[TankReview, ...]
    cycles: tuple[Cycle, ...] | None
    other_disc_margin: float

    @property
    def worst_tvc_amplitude(self) -> float:
        """Greatest engine amplitude of the tanks' limit cycles, rad; nan where no number is supported for one."""
        amplitudes = [t.limit_cycle.worst_tvc_amplitude for t in self.tanks if t.limit_cycle.band.size]
        return float(np.max(amplitudes)) if amplitudes else 0.0

    def __str__(self) -> str:
        m = self.margins
        lines = [f"{self.verdict.upper()}  {self.case.name}", *(f"  - {reason}" for reason in self.reasons), ""]
        if not m.trusted:
            return "\n".join(lines[:-1])
        state = "NEUTRAL" if m.neutral else "stable" if m.stable else "UNSTABLE"
        lines.append(f"Loop ({self.read_at}): {state}, nichols disc margin {float(m.nichols_disc_margin):+.4f}")
        lines.append(str(self.poles))
        lines += m.lines()
        lines.append("")
        for tank in self.tanks:
            lines += [str(tank.zone), tank.limit_cycle.summary()]
        lines += [str(cycle) for cycle in self.cycles or ()]
        return "\n".join(lines)

    def to_json(self) -> str:
        """Return the review as one JSON object in SI units; null where not applicable."""
        return json.dumps(contract(self), indent=1, allow_nan=False)

    def to_dataset(self) -> "xr.Dataset":
        """Return the margins of the review as an xarray Dataset; verdict and reasons are its attributes."""
        return self.margins.to_dataset().assign_attrs(
            case=self.case.name, verdict=self.verdict, reasons=list(self.reasons)
        )
