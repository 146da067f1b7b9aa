"""The stage: rigid body, thrust, slosh masses, bending modes, engine and air; table 1 of the paper."""

from sloshpy.vehicle.flexible_mode import Aerodynamics, Engine, FlexibleMode, ModeShape, ModeSlope
from sloshpy.vehicle.slosh_mass import SloshMass
from sloshpy.vehicle.vehicle import Vehicle

__all__ = ["Aerodynamics", "Engine", "FlexibleMode", "ModeShape", "ModeSlope", "SloshMass", "Vehicle"]
