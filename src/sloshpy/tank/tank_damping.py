"""All damping that a tank file gives a slosh mode: smooth wall, ring baffles and a floor under them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from sloshpy.damping import ConstantDamping, SumDamping
from sloshpy.errors import OutsideValidity
from sloshpy.tank.ring_baffles import BaffleDamping, baffle_damping
from sloshpy.tank.slosh_masses import SloshModes
from sloshpy.tank.wall_damping import WallDamping, wall_damping
from sloshpy.units import Array, Real

_POINTS = 201  # of the curve that is drawn
_BEYOND = 1.3  # of the range in which the law holds: how far it is drawn


@dataclass(frozen=True, kw_only=True)
class TankDamping:
    """Damping of one slosh mode, each part None where it is not asked for or no formula holds.

    All together: xi(A) = max(wall, floor) + baffles(A), A the slosh-mass displacement. The floor is a level and no
    addend: the ratio that the tank has at any amplitude, such as one measured without baffles, of which the wall is a
    part. What the boundary layer on the bottom gives is within the wall's. reasons: why a part is missing.
    """

    modes: SloshModes
    mode: int
    wall: WallDamping | None
    baffles: BaffleDamping | None
    floor: float | None
    reasons: tuple[str, ...]

    @property
    def constant(self) -> float | None:
        """The ratio at any amplitude: of the wall or the floor, the greater; None where there is neither."""
        known = [xi for xi in (None if self.wall is None else self.wall.ratio, self.floor) if xi is not None]
        return max(known) if known else None

    @property
    def rings_left_out(self) -> bool:
        """Whether the tank has ring baffles and none of them counts."""
        return bool(self.modes.tank.baffle) and self.baffles is None

    @property
    def constant_name(self) -> str:
        """What the ratio at any amplitude is of."""
        if self.constant is None:
            return ""
        if self.wall is None or self.constant > self.wall.ratio:
            return f"floor given, {100.0 * self.constant:.3g} %"
        return f"smooth wall, {100.0 * self.constant:.3g} %, {self.wall.formula}"

    def wave_height(self, displacement: Real) -> Real:
        """Return the wave height at the wall in m of slosh-mass displacements in m."""
        return displacement * float(self.modes.wave_per_displacement[self.mode - 1])

    def displacement(self, wave_height: Real) -> Real:
        """Return the slosh-mass displacement in m of wave heights at the wall in m."""
        return wave_height / float(self.modes.wave_per_displacement[self.mode - 1])

    @property
    def known(self) -> bool:
        """Whether there is any law of damping."""
        return self.constant is not None or self.baffles is not None

    @property
    def law(self) -> SumDamping:
        """The laws together, in slosh-mass displacement; not supported beyond what the baffles' formula is.

        Raises:
            OutsideValidity: there is none.
        """
        if not self.known:
            nothing = "the tank has neither a viscosity nor a ring baffle nor a damping_floor"
            raise OutsideValidity("; ".join(self.reasons) or nothing)
        parts = [] if self.constant is None else [ConstantDamping(ratio=self.constant)]
        return SumDamping(of=(*parts, *(() if self.baffles is None else (self.baffles.law,))))

    @property
    def sources(self) -> tuple[str, ...]:
        """What was taken and what it assumes, a line each."""
        said = []
        if self.floor is not None and self.floor == self.constant:
            said.append(f"damping at any amplitude {100.0 * self.floor:.4g} %, the damping_floor given")
        elif self.wall is not None:
            said.append(f"damping at any amplitude {100.0 * self.wall.ratio:.4g} %, smooth wall by {self.wall.formula}")
            said += self.wall.reasons
        if self.baffles is not None:
            said.append(
                f"ring baffles after Miles, {self.baffles.whose}: {self.baffles.law.slope:.4g} A^(1/2), A the "
                f"slosh-mass displacement in m, to {self.baffles.largest_amplitude:.4g} m"
            )
            said += self.baffles.reasons
        return (*said, *self.reasons)

    def __str__(self) -> str:
        parts = [str(part) for part in (self.wall, self.baffles) if part is not None]
        if self.floor is not None:
            taken = "taken" if self.floor == self.constant else "below the wall's, not taken"
            parts.append(f"{self.modes.tank.name}: floor {100.0 * self.floor:.4g} %, {taken}")
        return "\n".join([*parts, *(f"  - {reason}" for reason in self.reasons)])

    def curve(self) -> tuple[Array, Array]:
        """Return amplitudes in m of the slosh mass and the ratios there: to where the law holds, and nan beyond.

        Where no formula ends the range, to a tenth of the surface's radius.
        """
        end = self.law.largest_amplitude
        close = np.linspace(0.0, 1.0, _POINTS) ** 2  # a root rises steeply at first
        A = np.append(close, _BEYOND) * end if np.isfinite(end) else close * 0.1 * self.modes.section.radius
        return A, self.law.ratio(A)

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
        wall = self.wall
        return {
            "wall_damping": None if wall is None else wall.ratio,
            "wall_damping_formula": None if wall is None else wall.formula,
            "wall_damping_others": {} if wall is None else wall.others,
            "boundary_layer": None if wall is None else {"theory": wall.layer, "share_of_bottom": wall.floor_share},
            "damping_floor": self.floor,
            "baffle_damping": baffles,
            "damping_reasons": [*(() if wall is None else wall.reasons), *self.reasons],
        }


def tank_damping(modes: SloshModes, mode: int = 1) -> TankDamping:
    """Return what is known of a mode's damping: by the wall where a viscosity is given, by ring baffles, by a floor.

    Rings and floor are of the first mode; of the others the boundary layer alone is known.
    """
    tank = modes.tank
    wall, baffles, reasons = None, None, []
    if tank.liquid.kinematic_viscosity is not None:
        try:
            wall = wall_damping(modes, mode)
        except OutsideValidity as error:
            reasons.append(str(error))
    if tank.baffle and mode == 1:
        try:
            baffles = baffle_damping(modes)
        except OutsideValidity as error:
            reasons.append(f"baffles: {error}")
    if mode > 1 and (tank.baffle or tank.damping_floor is not None):
        reasons.append(f"ring baffles and damping_floor are of the first mode: left out of mode {mode}")
    floor = tank.damping_floor if mode == 1 else None
    return TankDamping(modes=modes, mode=mode, wall=wall, baffles=baffles, floor=floor, reasons=tuple(reasons))
