"""What makes a tank's inputs doubtful: too little acceleration, a film of liquid, no propellant, a wall half round."""

from itertools import pairwise

import numpy as np

from sloshpy.tank.liquid import LiquidSection
from sloshpy.tank.pieces import Curve, Line
from sloshpy.tank.shapes import Contour
from sloshpy.units import Array

# Of surface tension over density, m^3/s^2: hydrazine 6.7e-5 and water 7.3e-5, RP-1 3e-5, LH2 2.7e-5, LOX 1.2e-5.
MOST_TENSION = 7e-5
# Surface tension raises w^2 of the first wave by (1.84)^2/Bo, 3 % here, and bends the surface at rest (SP-106, ch 11).
LEAST_BOND = 100.0
LIGHTEST, HEAVIEST = 70.0, 2000.0  # kg/m^3: liquid hydrogen has 70.8 at its boiling point
_SHALLOW = 0.01  # of the surface's radius
_SHARP = np.radians(60.0)  # an edge that turns by more is meant
_GENTLE = np.radians(15.0)  # and one that turns by less costs little


def doubts_about(density: float, acceleration: float, section: LiquidSection) -> list[str]:
    """Return cautions about density in kg/m^3, acceleration in m/s^2 and depth; empty where all are usual.

    The Bond number a R^2 / (sigma/rho), R the surface's radius or the width of a ring of it, takes the greatest
    sigma/rho of a propellant, since none is known: of another one the number is greater.
    """
    found = []
    width = section.radius - section.inner_radius
    bond = acceleration * width**2 / MOST_TENSION
    if bond < LEAST_BOND:
        found.append(
            f"caution: at {acceleration:.3g} m/s^2 the Bond number may be as low as {bond:.2g} (as of hydrazine); "
            f"below {LEAST_BOND:g} surface tension counts, which this model leaves out"
        )
    if section.depth < _SHALLOW * width:
        found.append(
            f"caution: a depth of {section.depth:.3g} m is {100.0 * section.depth / width:.2g} % of the surface's "
            "radius: any wave there is as high as the liquid is deep"
        )
    if not LIGHTEST <= density <= HEAVIEST:
        found.append(
            f"caution: a density of {density:.4g} kg/m^3 is that of no propellant, which have {LIGHTEST:g} (hydrogen) "
            f"to {HEAVIEST:g} kg/m^3: check value and unit"
        )
    return found


def doubtful_edges(shape: Contour) -> list[str]:
    """Return cautions about edges between a line of two points and a curve that few points of a round wall make too."""
    found = []
    for points, wall in ((shape.outer_points, shape.outer), (shape.inner_points, shape.inner)):
        given = set() if points is None else set(zip(*(x.tolist() for x in points), strict=True))
        for low, high in pairwise(wall):
            line = low if isinstance(low, Line) else high
            if not isinstance(line, Line) or not isinstance(high if line is low else low, Curve):
                continue
            one, two = np.array(line.start), np.array(line.end)
            between = [p for p in given if 0.0 < (p - one) @ (two - one) < (two - one) @ (two - one)]
            if any(abs(_cross(two - one, p - one)) < 1e-9 * (two - one) @ (two - one) for p in between):
                continue  # a third point says that it is straight
            a, b = low.tangent(1.0), high.tangent(0.0)
            turn = abs(float(np.arctan2(_cross(a, b), a @ b)))
            if _GENTLE < turn < _SHARP:
                r, z = high.point(0.0)
                found.append(
                    f"caution: the wall has an edge of {np.degrees(turn):.0f} deg at r = {r:.4g} m, z = {z:.4g} m, "
                    "between a curve and a line of two points: where it is round, give it more points there"
                )
    return found


def _cross(a: Array, b: Array) -> float:
    return float(a[0] * b[1] - a[1] * b[0])
