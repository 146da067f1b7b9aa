"""Decide whether propellant slosh and a rocket's autopilot get along.

The public names, in reading order; each is loaded when it is first used.

    nouns        Case, Vehicle, SloshMass, Autopilot, Actuator, Filter, Criteria
    damping      ConstantDamping, PowerDamping, TableDamping, SumDamping
    files        read_case, write_case, case_schema, write_example
    dynamics     plant, state_space, open_loop, frequency_response, closed_loop_poles
    stability    margins, nichols_disc_margin, root_locus, danger_zone, required_damping, required_damping_map,
                 damping_sweep
    limit cycle  predict_limit_cycle, growth_curve, limit_cycles
    time         simulate, settled_envelope
    review       assess, write_report, write_figures
    exchange     to_control, response_to_control, from_control
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_ROOMS = {
    "case": ("Case", "Criteria"),
    "vehicle": ("Vehicle", "SloshMass"),
    "autopilot": ("Autopilot", "Actuator", "Filter"),
    "damping": ("ConstantDamping", "PowerDamping", "TableDamping", "SumDamping"),
    "files": (
        "read_case",
        "write_case",
        "case_schema",
        "write_example",
        "to_control",
        "response_to_control",
        "from_control",
    ),
    "dynamics": ("plant", "state_space", "open_loop", "frequency_response", "closed_loop_poles"),
    "stability": (
        "margins",
        "nichols_disc_margin",
        "root_locus",
        "danger_zone",
        "required_damping",
        "required_damping_map",
        "damping_sweep",
    ),
    "limit_cycle": ("predict_limit_cycle", "growth_curve", "limit_cycles"),
    "simulation": ("simulate", "settled_envelope"),
    "assess": ("assess", "Assessment"),
    "report": ("write_report", "write_figures"),
    "errors": ("InputError", "OutsideValidity"),
}
_ROOM_OF = {name: room for room, names in _ROOMS.items() for name in names}
__all__ = [*_ROOM_OF, "__version__"]


def __getattr__(name: str) -> Any:
    if name in _ROOM_OF:
        return getattr(import_module(f"sloshpy.{_ROOM_OF[name]}"), name)
    raise AttributeError(f"module 'sloshpy' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
