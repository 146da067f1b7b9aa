"""Tanks: contour, liquid, fill and acceleration to slosh masses, fig 1."""

from sloshpy.tank.history import FillHistory, slosh_masses_history
from sloshpy.tank.shapes import Annulus, Capsule, Cone, Contour, Cylinder, Sphere, Spheroid, Toroid
from sloshpy.tank.slosh_masses import SloshModes, slosh_masses
from sloshpy.tank.tank import Fill, Liquid, Ring, Tank

__all__ = [
    "Annulus",
    "Capsule",
    "Cone",
    "Contour",
    "Cylinder",
    "Fill",
    "FillHistory",
    "Liquid",
    "Ring",
    "SloshModes",
    "Sphere",
    "Spheroid",
    "Tank",
    "Toroid",
    "slosh_masses",
    "slosh_masses_history",
]
