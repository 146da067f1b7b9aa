"""Laws of slosh damping, their describing functions and forces, eqs 14-20; damping identified from free decays."""

from sloshpy.damping.decay_record import DecayRecord
from sloshpy.damping.decay_result import FreeDecay
from sloshpy.damping.describing_function import describing_function_factor, describing_function_integral
from sloshpy.damping.free_decay import free_decay
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
    "DecayRecord",
    "FreeDecay",
    "PowerDamping",
    "SumDamping",
    "TableDamping",
    "describing_function_factor",
    "describing_function_integral",
    "free_decay",
    "ratios",
    "small_amplitude_ratio",
]
