"""The stage: rigid body, thrust and slosh masses, nomenclature and table 1 of the paper."""

from sloshpy.vehicle.slosh_mass import SloshMass
from sloshpy.vehicle.vehicle import Vehicle

__all__ = ["SloshMass", "Vehicle"]
