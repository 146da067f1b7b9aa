"""Tanks that the tests of the tank room share."""

from typing import Any

import numpy as np

from sloshpy.tank import Tank

DENSITY = 1141.0  # kg/m^3


def tank(shape: dict[str, Any], fill: str | float, modes: int = 1, **more: Any) -> Tank:
    return Tank(
        name="LOX",
        fill=fill,
        acceleration=more.pop("acceleration", 12.1),
        liquid={"density": DENSITY},
        shape=shape,
        modes=modes,
        **more,
    )


def hyperboloid(b: float, c: float, points: int = 80, top: float = 1.2) -> dict[str, Any]:
    """Return the contour r^2 = (z + c)^2 - b^2, c = b, at points evenly far apart along it."""
    assert b == c  # so that it begins on the axis
    u = np.linspace(0.0, np.arccosh((top + c) / b), points)
    return {"kind": "contour", "z": (b * np.cosh(u) - c).tolist(), "r": (b * np.sinh(u)).tolist()}


CYLINDER = {"kind": "cylinder", "radius": 2.0, "height": 9.0}
SPHERE = {"kind": "sphere", "radius": 2.0}
CAPSULE = {"kind": "capsule", "radius": 2.0, "barrel": 3.0, "dome": 1.2}
SPHEROID = {"kind": "spheroid", "radius": 2.0, "half_height": 1.3}
CONE_30 = {"kind": "cone", "half_angle": np.pi / 6, "height": 4.0}
CONE_45 = {"kind": "cone", "half_angle": np.pi / 4, "height": 4.0}
ANNULUS = {"kind": "annulus", "radius": 2.0, "inner_radius": 0.6, "height": 9.0}
TOROID = {"kind": "toroid", "ring_radius": 2.0, "tube_radius": 0.8}
_T = np.linspace(0.0, 0.5 * np.pi, 25)
BULKHEAD = {  # a dome of half-height 0.5 pushed up into a cylinder
    "kind": "contour",
    "z": [0.0, 3.0],
    "r": [1.0, 1.0],
    "z_inner": (0.5 * np.sin(_T)).tolist(),
    "r_inner": [*np.cos(_T[:-1]).tolist(), 0.0],
}
SUMP = {"kind": "contour", "z": [0, 0, 0.2, 0.2, 1], "r": [0, 0.3, 0.3, 1, 1]}
