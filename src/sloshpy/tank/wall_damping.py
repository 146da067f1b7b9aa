"""Damping of slosh by a smooth wall: empirical formulas of the cylinder and the sphere (NASA SP-106, TN D-1367)."""

from dataclasses import dataclass

import numpy as np

from sloshpy.damping import ConstantDamping
from sloshpy.errors import OutsideValidity
from sloshpy.tank.shapes import Cylinder, Sphere
from sloshpy.tank.slosh_masses import SloshModes


@dataclass(frozen=True, kw_only=True)
class WallDamping:
    """Damping ratio of the first slosh mode by the wall alone, at any amplitude of a wave that does not break.

    formula: which one was taken, the least of those that hold. others: what the others give.
    """

    modes: SloshModes
    ratio: float
    formula: str
    others: dict[str, float]

    @property
    def law(self) -> ConstantDamping:
        """The law of damping for a case."""
        return ConstantDamping(ratio=self.ratio)

    def __str__(self) -> str:
        rest = "".join(f"; {name} {100.0 * xi:.4g} %" for name, xi in self.others.items())
        return f"{self.modes.tank.name}: smooth wall {100.0 * self.ratio:.4g} % by {self.formula}{rest}"


def wall_damping(modes: SloshModes) -> WallDamping:
    """Return the damping of the first mode by a smooth wall, by the formula that gives least.

    Cylinder: Mikishev and Dorozhkin, and Stephens and others; sphere: Mikishev and Dorozhkin.

    Raises:
        OutsideValidity: another shape, or a liquid without its viscosity.
    """
    tank, h = modes.tank, modes.section.depth
    nu, g = tank.liquid.kinematic_viscosity, tank.acceleration
    if nu is None:
        raise OutsideValidity("wall damping needs the liquid's kinematic_viscosity")
    match tank.shape:
        case Cylinder(radius=R):
            found = {
                "Mikishev and Dorozhkin": mikishev_cylinder(nu, R, g, h),
                "Stephens and others (TN D-1367)": stephens_cylinder(nu, R, g, h),
            }
        case Sphere(radius=R):
            found = {"Mikishev and Dorozhkin": mikishev_sphere(nu, R, g, h)}
        case _:
            raise OutsideValidity(
                f"no formula of wall damping for a {tank.shape.kind}, of cylinder and sphere only. "
                "Cure: give measured damping"
            )
    least = min(found, key=lambda name: found[name])
    others = {name: xi for name, xi in found.items() if name != least}
    return WallDamping(modes=modes, ratio=found[least], formula=least, others=others)


def mikishev_cylinder(nu: float, R: float, g: float, h: float) -> float:
    """Return zeta = 4.98/(2 pi) nu^1/2 R^-3/4 g^-1/4 [1 + 0.318/sinh(1.84 h/R) (1 + (1 - h/R)/cosh(1.84 h/R))]."""
    depth = min(1.84 * h / R, 300.0)  # beyond, both terms are nothing
    shallow = 1.0 + 0.318 / np.sinh(depth) * (1.0 + (1.0 - h / R) / np.cosh(depth))
    return float(4.98 / (2.0 * np.pi) * np.sqrt(nu) * R**-0.75 * g**-0.25 * shallow)


def stephens_cylinder(nu: float, R: float, g: float, h: float) -> float:
    """Return zeta = 5.23/(2 pi) nu^1/2 R^-3/4 g^-1/4 tanh(1.84 h/R)^-1/4 [1 + 2 (1 - h/R) / sinh(3.68 h/R)]."""
    depth = min(1.84 * h / R, 150.0)
    shallow = np.tanh(depth) ** -0.25 * (1.0 + 2.0 * (1.0 - h / R) / np.sinh(2.0 * depth))
    return float(5.23 / (2.0 * np.pi) * np.sqrt(nu) * R**-0.75 * g**-0.25 * shallow)


def mikishev_sphere(nu: float, R: float, g: float, h: float) -> float:
    """Return zeta = delta/(2 pi), delta = 0.131 B^0.359 (R/h) up to half full, else [1 + 0.46 k]/(1.46 k), k = 2 - h/R.

    B = 1e4 / (2 sqrt 2) nu R^-3/2 g^-1/2.
    """
    B = 1e4 / (2.0 * np.sqrt(2.0)) * nu * R**-1.5 * g**-0.5
    k = 2.0 - h / R
    share = R / h if h <= R else (1.0 + 0.46 * k) / (1.46 * k)
    return float(0.131 * B**0.359 * share / (2.0 * np.pi))
