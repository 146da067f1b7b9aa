"""Damping of slosh by a smooth wall: formulas from tests of some shapes, and boundary-layer theory of any mode.

A boundary layer on the wall takes zeta = sqrt(nu / (2 w)) S / (2 V) from a mode of frequency w, with S the integral of
|grad phi|^2 over the wetted wall and V that over the liquid. Deep cylinders measure 1.42 to 1.49 times that.
"""

from dataclasses import dataclass

import numpy as np

from sloshpy.damping import ConstantDamping
from sloshpy.errors import OutsideValidity
from sloshpy.tank.shapes import Cone, Cylinder, Sphere, Toroid
from sloshpy.tank.slosh_masses import SloshModes

CALIBRATION = 1.42  # the lesser of 4.98 (Mikishev and Dorozhkin) and 5.23 (Stephens) over 2 pi, to theory's 0.558
LAYER = f"boundary layer x {CALIBRATION}, calibrated on cylinders"
THICK = 0.05  # damping ratio from which the layer is not thin: the formulas are of first order in its thickness
WIDEST_CONE = np.radians(20.0)
TOROIDS = (0.095 / 0.0635, 0.222 / 0.0635)  # ring to tube radius of the tests
_ROUGH = 1e-3  # of the friction integral
_BOTTOM = 0.05  # share of the friction from which the bottom's is told


@dataclass(frozen=True, kw_only=True)
class WallDamping:
    """Damping ratio of a slosh mode by the wall alone, the same at any amplitude of a wave that does not break.

    formula: which one was taken, the least of those that hold. others: what the others give. layer: what boundary-layer
    theory gives, uncalibrated, and floor_share the part of that on the bottom: what rises by less than 45 degrees.
    """

    modes: SloshModes
    mode: int
    ratio: float
    formula: str
    others: dict[str, float]
    layer: float
    floor_share: float
    reasons: tuple[str, ...]

    @property
    def law(self) -> ConstantDamping:
        """The law of damping for a case."""
        return ConstantDamping(ratio=self.ratio)

    def __str__(self) -> str:
        rest = "".join(f"; {name} {100.0 * xi:.4g} %" for name, xi in self.others.items())
        bottom = f" ({100.0 * self.floor_share:.3g} % of it on the bottom)" if self.floor_share > _BOTTOM else ""
        which = "" if self.mode == 1 else f", mode {self.mode}"
        head = f"{self.modes.tank.name}: smooth wall{which} {100.0 * self.ratio:.4g} % by {self.formula}{bottom}{rest}"
        return "\n".join([head, *(f"  - {reason}" for reason in self.reasons)])


def wall_damping(modes: SloshModes, mode: int = 1) -> WallDamping:
    """Return the damping of a mode by a smooth wall, at any amplitude, by the formula that gives least.

    First mode of a cylinder: Mikishev and Dorozhkin, and Stephens and others. Of a sphere (Mikishev and Dorozhkin), a
    cone up to 20 degrees (SP-106) and a toroid within the tests (Sumner): that, or the calibrated boundary layer where
    it gives less. Any other shape or mode: the calibrated boundary layer. For a cylinder it stands beside the formulas,
    whose tests it is calibrated on.

    Args:
        modes: with the liquid's kinematic viscosity.
        mode: which one, from 1.

    Raises:
        OutsideValidity: a liquid without its viscosity, or one so viscous that the layer is not thin.
    """
    nu = modes.tank.liquid.kinematic_viscosity
    if nu is None:
        raise OutsideValidity("wall damping needs the liquid's kinematic_viscosity")
    n = mode - 1
    layer = boundary_layer(nu, float(modes.frequency[n]), float(modes.wall_friction[n]))
    own = _of_the_shape(modes, nu) if mode == 1 else {}
    measured_here = isinstance(modes.tank.shape, Cylinder) and mode == 1
    candidates = own if measured_here else own | {LAYER: CALIBRATION * layer}
    least = min(candidates, key=lambda name: candidates[name])
    ratio = candidates[least]
    if not ratio < THICK:
        raise OutsideValidity(
            f"wall damping of {100.0 * ratio:.3g} % by {least}: beyond {100.0 * THICK:g} % the layer is not thin"
        )
    given = own | {LAYER: CALIBRATION * layer}
    return WallDamping(
        modes=modes,
        mode=mode,
        ratio=ratio,
        formula=least,
        others={name: xi for name, xi in given.items() if name != least},
        layer=layer,
        floor_share=float(modes.floor_friction[n] / modes.wall_friction[n]),
        reasons=tuple(_reasons(modes, least, given, n)),
    )


def _of_the_shape(modes: SloshModes, nu: float) -> dict[str, float]:
    """Return what the formulas from tests of this very shape give, by name; none where it has none."""
    g, h, a = modes.tank.acceleration, modes.section.depth, modes.section.radius
    match modes.tank.shape:
        case Cylinder(radius=R):
            return {
                "Mikishev and Dorozhkin": mikishev_cylinder(nu, R, g, h),
                "Stephens and others (TN D-1367)": stephens_cylinder(nu, R, g, h),
            }
        case Sphere(radius=R):
            return {"Mikishev and Dorozhkin": mikishev_sphere(nu, R, g, h)}
        case Cone(half_angle=alpha) if alpha <= WIDEST_CONE:
            return {"SP-106, cone": sp106_cone(nu, a, g, alpha)}
        case Toroid(ring_radius=R, tube_radius=r_0) if TOROIDS[0] <= R / r_0 <= TOROIDS[1]:
            return {"Sumner, toroid": sumner_toroid(nu, r_0, g, h)}
    return {}


def _reasons(modes: SloshModes, taken: str, given: dict[str, float], n: int) -> list[str]:
    """Return what to know before the number is used."""
    shape, found = modes.tank.shape, []
    if taken == LAYER:
        for name, xi in given.items():
            if name != LAYER:
                more = xi / given[LAYER]
                found.append(f"{name} gives {more:.3g} times as much; the lower of the two was chosen, to be safe")
        if len(given) == 1:
            found.append(f"wall damping of this {shape.kind} rests on theory, on no test of such a tank; measure it")
    if isinstance(shape, Toroid) and taken != LAYER:
        found.append("the formula of toroids is a curve fit of tests with tubes of 63.5 mm radius")
    if isinstance(shape, Cone) and taken != LAYER:
        found.append("the formula of cones is a curve fit of figures, to half angles of 20 degrees")
    if modes.friction_error[n] > _ROUGH and taken == LAYER:
        found.append(f"the friction along the wall is good to {modes.friction_error[n]:.1e} only")
    return found


def boundary_layer(nu: float, w: float, friction: float) -> float:
    """Return zeta = sqrt(nu / (2 w)) S / (2 V), pure theory, of a mode with w in rad/s and friction S/V in 1/m.

    Work done by Stokes' layer on the wall, (rho/2) sqrt(nu w / 2) |U|^2 per area, to twice w times the energy
    (rho/2) V. Deep cylinder: 0.558 nu^1/2 R^-3/4 g^-1/4. Holds for a thin layer on a smooth wall, without what the
    surface and its contact line lose.
    """
    return float(np.sqrt(nu / (2.0 * w)) * 0.5 * friction)


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


def sp106_cone(nu: float, R: float, g: float, half_angle: float) -> float:
    """Return zeta = 4.964/(2 pi) C5 C4^-1/2 nu^1/2 R^-3/4 g^-1/4 of a cone, apex down; R of the surface.

    C5 = 1.0037 + 0.0126 a, C4 = 1.0010 - 0.0031 a - 0.0003 a^2 with the half angle a in degrees: the curve fits of
    SP-106's figures in SLOSH-ML. To half angles of 20 degrees.
    """
    a = np.degrees(half_angle)
    C5, C4 = 1.0037 + 0.0126 * a, 1.0010 - 0.0031 * a - 0.0003 * a**2
    return float(4.964 / (2.0 * np.pi) * C5 / np.sqrt(C4) * np.sqrt(nu) * R**-0.75 * g**-0.25)


def sumner_toroid(nu: float, r_0: float, g: float, h: float) -> float:
    """Return zeta = delta/(2 pi), delta = 1.6629 y^4 - 3.7955 y^3 + 3.5583 y^2 - 1.6759 y + 0.3865, y = h/(2 r_0).

    A curve fit of Sumner's tests: tube radius r_0 = 63.5 mm, ring radius 95 to 222 mm, nu = 3.3e-6 m^2/s at 9.81 m/s^2;
    scaled by the square root of nu / sqrt(g r_0^3).
    """
    y = h / (2.0 * r_0)
    delta = 1.6629 * y**4 - 3.7955 * y**3 + 3.5583 * y**2 - 1.6759 * y + 0.3865
    scale = np.sqrt(nu / np.sqrt(g * r_0**3) / (3.3e-6 / np.sqrt(9.81 * 0.0635**3)))
    return float(delta * scale / (2.0 * np.pi))
