"""All damping that the formulas give a tank: smooth wall and ring baffles together."""

from dataclasses import dataclass
from typing import Any

from sloshpy.damping import SumDamping
from sloshpy.errors import OutsideValidity
from sloshpy.tank.ring_baffles import BaffleDamping, baffle_damping
from sloshpy.tank.slosh_masses import SloshModes
from sloshpy.tank.wall_damping import WallDamping, wall_damping


@dataclass(frozen=True, kw_only=True)
class TankDamping:
    """Wall and baffle damping of the first slosh mode, each None where it is not asked for or no formula holds."""

    wall: WallDamping | None
    baffles: BaffleDamping | None
    reasons: tuple[str, ...]

    @property
    def law(self) -> SumDamping:
        """The laws together, in slosh-mass displacement.

        Raises:
            OutsideValidity: there is neither.
        """
        laws = [part.law for part in (self.wall, self.baffles) if part is not None]
        if not laws:
            raise OutsideValidity("; ".join(self.reasons) or "the tank has neither a viscosity nor a ring baffle")
        return SumDamping(of=tuple(laws))

    def __str__(self) -> str:
        parts = [str(part) for part in (self.wall, self.baffles) if part is not None]
        return "\n".join([*parts, *(f"  - {reason}" for reason in self.reasons)])

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers; the coefficient is in m^-1/2 of slosh-mass displacement, xi = coefficient A^(1/2)."""
        baffles = None
        if self.baffles is not None:
            baffles = {
                "law": "power",
                "exponent": 0.5,
                "coefficient": self.baffles.law.slope,
                "amplitude": "slosh-mass displacement in m",
                "largest_amplitude": self.baffles.largest_amplitude,
                "decay": self.baffles.decay,
                "reasons": list(self.baffles.reasons),
            }
        return {
            "wall_damping": None if self.wall is None else self.wall.ratio,
            "baffle_damping": baffles,
            "damping_reasons": list(self.reasons),
        }


def tank_damping(modes: SloshModes) -> TankDamping:
    """Return what the formulas say of a tank's damping: of the wall where a viscosity is given, of its ring baffles."""
    wall, baffles, reasons = None, None, []
    if modes.tank.liquid.kinematic_viscosity is not None:
        try:
            wall = wall_damping(modes)
        except OutsideValidity as error:
            reasons.append(str(error))
    if modes.tank.baffle:
        try:
            baffles = baffle_damping(modes)
        except OutsideValidity as error:
            reasons.append(f"baffles: {error}")
    return TankDamping(wall=wall, baffles=baffles, reasons=tuple(reasons))
