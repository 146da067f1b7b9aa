"""What is computed of a liquid's lateral motion, before density and acceleration come in."""

from dataclasses import dataclass

import numpy as np

from sloshpy.units import Array


@dataclass(frozen=True, kw_only=True)
class Modal:
    """The lateral motion of a liquid with free surface, by its modes, and with a lid.

    Of each mode, (n,): kappa = w^2/a in 1/m; slosh mass over density in m^3; height of the spring-mass above the lowest
    point in m, nan where there is no mass; wave height at the outer wall over displacement of the slosh mass; error:
    estimated, relative. lid_volume: effective inertia under a rigid lid about the c.g. over density, m^5. radius (k,)
    and shape (n, k): the surface along a radius in m, 1 at the outer wall.
    friction and floor_friction: int |grad phi|^2 over the wetted wall, and over its floor, to that over the volume,
    1/m, of each mode; friction_error: estimated, relative. fixed_error: of the inertia that the modes wanted leave.
    """

    kappa: Array
    mass_volume: Array
    spring_height: Array
    wave: Array
    lid_volume: float
    error: Array
    radius: Array
    shape: Array
    friction: Array
    floor_friction: Array
    friction_error: Array
    method: str
    fixed_error: float


def fixed_part(modal: Modal, volume: float, cg_height: float, wanted: int) -> tuple[float, float, float]:
    """Return volume in m^3, height in m and inertia about itself over density in m^5 of what the first modes leave.

    It completes volume, c.g. and rigid-lid inertia of the whole liquid.
    """
    V, H_s = modal.mass_volume[:wanted], modal.spring_height[:wanted]
    felt = np.isfinite(H_s)
    V_0 = volume - float(np.sum(V))
    H_0 = (volume * cg_height - float(V[felt] @ H_s[felt])) / V_0
    turning = V_0 * (H_0 - cg_height) ** 2 + float(V[felt] @ (H_s[felt] - cg_height) ** 2)
    return V_0, H_0, modal.lid_volume - turning
