"""Damping of slosh by flat rings on a cylindrical wall: Miles (1958), several rings after Bauer, decay after Coogan
and Green (AIAA 2019-4436)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from sloshpy.damping import PowerDamping
from sloshpy.errors import OutsideValidity
from sloshpy.tank.slosh_masses import SloshModes
from sloshpy.tank.tank import Ring
from sloshpy.units import Array, Real

Decay = Literal["coogan-green", "miles"]
_DECAY: dict[Decay, float] = {"coogan-green": 4.60 * 1.55, "miles": 4.60}
WIDEST = 0.2  # of the radius
HIGHEST_WAVE = 0.1  # of the radius
_CYLINDRICAL = 1e-3  # of the radius: how far the wall by a ring and the surface may differ
_DEEP = 1.0  # radii of liquid below the lowest ring


@dataclass(frozen=True, kw_only=True)
class BaffleDamping:
    """zeta = coefficient (eta/R)^1/2 of the first slosh mode, eta the wave height at the wall; by `rings` alone.

    wave_per_displacement turns it into the slosh-mass displacement A of the laws of damping: eta = wave A. The formula
    holds to largest_amplitude, m of slosh-mass displacement. decay: whose decay with the depth of a ring was taken.
    """

    modes: SloshModes
    coefficient: float
    rings: tuple[Ring, ...]
    decay: Decay
    reasons: tuple[str, ...]

    @property
    def wave_per_displacement(self) -> float:
        """eta/A at the wall."""
        return float(self.modes.wave_per_displacement[0])

    @property
    def largest_amplitude(self) -> float:
        """Slosh-mass displacement in m to which the formula holds: a wave of a tenth of the radius, no ring dry."""
        section = self.modes.section
        nearest = min(section.depth - ring.height for ring in self.rings)
        return min(HIGHEST_WAVE * section.radius, nearest) / self.wave_per_displacement

    @property
    def law(self) -> PowerDamping:
        """The law of damping for a case, in slosh-mass displacement; not supported beyond `largest_amplitude`."""
        slope = self.coefficient * np.sqrt(self.wave_per_displacement / self.modes.section.radius)
        return PowerDamping(slope=float(slope), exponent=0.5, largest_amplitude=self.largest_amplitude)

    @property
    def whose(self) -> str:
        """Whose decay with the depth of a ring was taken."""
        return {"coogan-green": "decay after Coogan and Green", "miles": "decay after Miles, not conservative"}[
            self.decay
        ]

    def ratio(self, amplitude: Real) -> Array:
        """Return the damping ratio at slosh-mass displacements in m; nan beyond what the formula supports."""
        return self.law.ratio(amplitude)

    def __str__(self) -> str:
        head = f"{self.modes.tank.name}: {len(self.rings)} ring{'s' * (len(self.rings) != 1)}"
        lines = [f"{head}, zeta = {self.coefficient:.4g} (eta/R)^(1/2) ({self.whose})"]
        most = self.largest_amplitude
        ratio = 100.0 * float(self.ratio(most))
        wave = most * self.wave_per_displacement
        lines.append(f"  {ratio:.3g} % at {most:.3g} m of slosh, to where it holds (wave of {wave:.3g} m at the wall)")
        return "\n".join([*lines, *(f"  - {reason}" for reason in self.reasons)])


def baffle_damping(modes: SloshModes, decay: Decay = "coogan-green") -> BaffleDamping:
    """Return the damping of the first mode by the ring baffles of the tank.

        zeta = 2.83 sum exp(-c d/R) A_b^(3/2) (eta/R)^(1/2),  A_b = (w/R)(2 - w/R)

    with d a ring's depth below the surface and w its width; c = 4.60 (Miles) or 1.55 times that (Coogan and Green, who
    found Miles not conservative), the default. Rings above the surface count for nothing. A ring less than a tenth of
    the radius below it comes out of the highest wave for which the formula holds: it counts for nothing beside deeper
    ones; alone it counts, and the formula ends at the wave that lays it dry. A ring below which the wall is a cylinder
    for less than the ring's depth counts for nothing beside others: the formula is of a cylinder that goes on.

    Raises:
        OutsideValidity: no ring is wet, a wall that anywhere from the surface to a ring's width below a ring differs by
            more than a thousandth of the radius from a cylinder, no ring below which it is one for the ring's depth, a
            ring wider than a fifth of the radius, no ring but one that the surface at rest stands at.
    """
    section, R = modes.section, modes.section.radius
    wet = tuple(ring for ring in modes.tank.baffle if ring.height <= section.depth)
    if not wet:
        raise OutsideValidity("no ring baffle is wet: the surface stands below every ring")
    for ring in wet:
        _check_cylinder(modes, ring, ring.width)
        if ring.width > WIDEST * R:
            raise OutsideValidity(f"the ring of {ring.height:g} m is wider than {WIDEST:g} of the radius {R:.4g} m")
    held = tuple(ring for ring in wet if not _off_cylinder(modes, 2.0 * ring.height - section.depth))
    if not held:
        _check_cylinder(modes, wet[-1], section.depth - wet[-1].height)
    deep = tuple(ring for ring in held if section.depth - ring.height >= HIGHEST_WAVE * R * (1.0 - 1e-9))
    counted = deep or tuple(ring for ring in held if ring.height < section.depth)
    if not counted:
        raise OutsideValidity(f"the surface stands at the ring of {held[0].height:g} m, which every wave lays dry")
    total = sum(ring_coefficient(ring.width / R, (section.depth - ring.height) / R, decay) for ring in counted)
    reasons = []
    dry = len(modes.tank.baffle) - len(wet)
    if dry:
        reasons.append(f"{dry} ring{'s' * (dry != 1)} above the surface left out")
    if min(ring.height for ring in counted) < _DEEP * R:
        reasons.append("less than a radius of liquid below the lowest ring: outside the tests of the formula")
    if len(held) < len(wet):
        out = ", ".join(f"{ring.height:g}" for ring in wet if ring not in held)
        reasons.append(
            f"the wall leaves the cylinder less than the ring's depth below the ring of {out} m: left out, since the "
            "formula is of a cylinder that goes on"
        )
    if len(counted) < len(held):
        dry_in_wave = [section.depth - ring.height for ring in held if ring not in counted]
        below = " and ".join(f"{depth:.3g}" for depth in dry_in_wave)
        many = len(dry_in_wave) > 1
        reasons.append(
            f"{'rings' if many else 'a ring'} {below} m below the surface left out: "
            f"{'they come' if many else 'it comes'} out of a wave higher than that"
        )
    if not deep:
        nearest = min(section.depth - ring.height for ring in counted)
        reasons.append(
            f"a ring {nearest:.3g} m below the surface comes out of a wave higher than that: this ends there"
        )
    return BaffleDamping(modes=modes, coefficient=total, rings=counted, decay=decay, reasons=tuple(reasons))


def _check_cylinder(modes: SloshModes, ring: Ring, below: float) -> None:
    """Refuse a wall that is no cylinder between the surface and so many metres below a ring."""
    off = _off_cylinder(modes, ring.height - below)
    if off:
        raise OutsideValidity(
            f"Miles' formula is of a cylinder from the surface to below a ring: by the ring of {ring.height:g} m {off}"
        )


def _off_cylinder(modes: SloshModes, low: float) -> str:
    """Return where between a height and the surface the liquid is no cylinder of the surface's radius; "" if nowhere.

    A flat bottom is no fault of the wall.
    """
    section, R = modes.section, modes.section.radius
    if len(modes.walls) > 1:
        top = float(modes.walls[1][1, -1])
        if section.inner_radius > 0.0 or top > low:
            return f"an inner wall rises to {min(top, section.depth):.4g} m"
    r, z = modes.walls[0]
    near = (z > max(low, 0.0)) & (z <= section.depth)
    if low > 0.0:
        r, z = np.append(r[near], np.interp(low, z, r)), np.append(z[near], low)
    else:
        r, z = r[near], z[near]
    worst = int(np.argmax(np.abs(r - R)))
    if abs(r[worst] - R) <= _CYLINDRICAL * R:
        return ""
    return f"the radius is {r[worst]:.4g} m at {z[worst]:.4g} m, and {R:.4g} m at the surface"


def ring_coefficient(width: float, depth: float, decay: Decay = "miles") -> float:
    """Return zeta/(eta/R)^1/2 of one ring of a width and at a depth in radii."""
    area = width * (2.0 - width)
    return float(2.83 * np.exp(-_DECAY[decay] * depth) * area**1.5)
