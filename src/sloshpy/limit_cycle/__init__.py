"""The limit cycles of slosh and engine: five steps (sec C.2-C.3, figs 7-8), growth curve, exact periodic orbit."""

from sloshpy.limit_cycle.five_steps import LimitCycle, predict_limit_cycle
from sloshpy.limit_cycle.growth import Cycle, GrowthCurve, growth_curve, limit_cycles
from sloshpy.limit_cycle.periodic_orbit import PeriodicOrbit, periodic_orbit

__all__ = [
    "Cycle",
    "GrowthCurve",
    "LimitCycle",
    "PeriodicOrbit",
    "growth_curve",
    "limit_cycles",
    "periodic_orbit",
    "predict_limit_cycle",
]
