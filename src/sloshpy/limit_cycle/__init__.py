"""The limit cycles of slosh and engine: five steps (sec C.2-C.3, figs 7-8), growth curve, exact orbit, map."""

from sloshpy.limit_cycle.cycle import Cycle
from sloshpy.limit_cycle.cycles import limit_cycles, slosh_cycles
from sloshpy.limit_cycle.degradation_map import DegradationMap, degradation_map
from sloshpy.limit_cycle.five_steps import predict_limit_cycle
from sloshpy.limit_cycle.growth import GrowthCurve, growth_curve, liveliest_tank
from sloshpy.limit_cycle.limit_cycle import LimitCycle
from sloshpy.limit_cycle.periodic_orbit import PeriodicOrbit, periodic_orbit
from sloshpy.limit_cycle.two_axes import TwoAxisCycle, two_axis_cycles

__all__ = [
    "Cycle",
    "DegradationMap",
    "GrowthCurve",
    "LimitCycle",
    "PeriodicOrbit",
    "TwoAxisCycle",
    "degradation_map",
    "growth_curve",
    "limit_cycles",
    "liveliest_tank",
    "periodic_orbit",
    "predict_limit_cycle",
    "slosh_cycles",
    "two_axis_cycles",
]
