"""Laws of slosh damping, their describing functions and their forces, eqs 14-20."""

from sloshpy.damping.describing_function import describing_function_factor, describing_function_integral
from sloshpy.damping.laws import (
    AnyDamping,
    ConstantDamping,
    DampingLaw,
    PowerDamping,
    SumDamping,
    TableDamping,
    ratios,
    small_amplitude_ratio,
)

__all__ = [
    "AnyDamping",
    "ConstantDamping",
    "DampingLaw",
    "PowerDamping",
    "SumDamping",
    "TableDamping",
    "describing_function_factor",
    "describing_function_integral",
    "ratios",
    "small_amplitude_ratio",
]
