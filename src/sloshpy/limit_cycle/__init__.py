"""The limit cycles of slosh and engine: the paper's five steps (sec C.2-C.3, figs 7-8) and the growth curve."""

from sloshpy.limit_cycle.cycles import Cycle, limit_cycles
from sloshpy.limit_cycle.five_steps import LimitCycle, predict_limit_cycle
from sloshpy.limit_cycle.growth import GrowthCurve, growth_curve
from sloshpy.limit_cycle.two_axes import TwoAxisCycle, two_axis_cycles

__all__ = [
    "Cycle",
    "GrowthCurve",
    "LimitCycle",
    "TwoAxisCycle",
    "growth_curve",
    "limit_cycles",
    "predict_limit_cycle",
    "two_axis_cycles",
]
