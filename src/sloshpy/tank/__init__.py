"""Tanks: contour, liquid, fill and acceleration to slosh masses, fig 1; damping by the wall and by ring baffles."""

from sloshpy.tank.history import FillHistory, slosh_masses_history
from sloshpy.tank.ring_baffles import BaffleDamping, baffle_damping
from sloshpy.tank.shapes import Annulus, Capsule, Cone, Contour, Cylinder, Sphere, Spheroid, Toroid
from sloshpy.tank.slosh_masses import SloshModes, slosh_masses
from sloshpy.tank.tank import Fill, Liquid, Ring, Tank
from sloshpy.tank.tank_damping import TankDamping, tank_damping
from sloshpy.tank.wall_damping import WallDamping, wall_damping

__all__ = [
    "Annulus",
    "BaffleDamping",
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
    "TankDamping",
    "Toroid",
    "WallDamping",
    "baffle_damping",
    "slosh_masses",
    "slosh_masses_history",
    "tank_damping",
    "wall_damping",
]
