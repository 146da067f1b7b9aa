"""What makes a tank's inputs doubtful: too little acceleration, a film of liquid, no propellant, a wall half round."""

from sloshpy.tank.contour import doubtful_edges
from sloshpy.tank.liquid import LiquidSection
from sloshpy.tank.shapes import Contour

# Of surface tension over density, m^3/s^2: hydrazine 6.7e-5 and water 7.3e-5, RP-1 3e-5, LH2 2.7e-5, LOX 1.2e-5.
MOST_TENSION = 7e-5
# Surface tension raises w^2 of the first wave by (1.84)^2/Bo, 3 % here, and bends the surface at rest (SP-106, ch 11).
LEAST_BOND = 100.0
LIGHTEST, HEAVIEST = 70.0, 2000.0  # kg/m^3: liquid hydrogen has 70.8 at its boiling point
_SHALLOW = 0.01  # of the surface's radius


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


def doubts_about_wall(shape: Contour) -> list[str]:
    """Return a caution where few points with edges between them may be of a round wall."""
    if shape.straight:
        return []
    found = []
    for points in (shape.outer_points, shape.inner_points):
        r, z = ((), ()) if points is None else doubtful_edges(*points)
        if len(z):
            where = "; ".join(f"r {a:.4g} m, z {b:.4g} m" for a, b in list(zip(r, z, strict=True))[:3])
            more = f"; and {len(z) - 3} more" if len(z) > 3 else ""
            found.append(
                f"caution: the wall may be round where few points make edges ({where}{more}); the error holds what "
                "that would change. Give more points there, or a third one on a straight part, or straight = true"
            )
    return found
