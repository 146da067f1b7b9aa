"""Decide whether propellant slosh and a rocket's autopilot get along.

The public names, in reading order; each is loaded when it is first used.

    nouns        Case, Vehicle, SloshMass, FlexibleMode, Engine, Aerodynamics, Autopilot, Actuator, Filter, Criteria
    damping      ConstantDamping, PowerDamping, TableDamping, SumDamping
    files        read_case, write_case, case_schema, write_example
    dynamics     plant, state_space, open_loop, frequency_response, closed_loop_poles
    stability    margins, nichols_disc_margin, root_locus, danger_zone, required_damping, required_damping_map,
                 damping_sweep, disc_margin_curve, grid_sweep
    limit cycle  predict_limit_cycle, growth_curve, limit_cycles, periodic_orbit,
                 degradation_map
    time         simulate, settled_envelope, verify
    review       assess, plot_bode and the other plots, write_report, write_figures
    exchange     to_control, response_to_control, from_control
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

__version__ = "0.1.0"

_ROOMS = {
    "case": ("Case", "Criteria"),
    "vehicle": ("Vehicle", "SloshMass", "FlexibleMode", "ModeShape", "ModeSlope", "Engine", "Aerodynamics"),
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
        "grid_sweep",
        "margins",
        "nichols_disc_margin",
        "root_locus",
        "danger_zone",
        "required_damping",
        "required_damping_map",
        "damping_sweep",
        "disc_margin_curve",
    ),
    "limit_cycle": ("predict_limit_cycle", "growth_curve", "limit_cycles", "periodic_orbit", "degradation_map"),
    "simulation": ("simulate", "settled_envelope", "verify"),
    "assess": ("assess", "Assessment"),
    "plots": (
        "plot_bode",
        "plot_damping_law",
        "plot_damping_sweep",
        "plot_danger_zone",
        "plot_degradation_map",
        "plot_growth",
        "plot_limit_cycle",
        "plot_nichols",
        "plot_root_locus",
        "plot_time_history",
        "plot_tvc_gain",
        "save_figure",
    ),
    "report": ("write_report", "write_figures"),
    "errors": ("InputError", "OutsideValidity"),
}
_ROOM_OF = {name: room for room, names in _ROOMS.items() for name in names}
__all__ = [*_ROOM_OF, "__version__"]


class _Contents(ModuleType):
    """The package itself: importing the room `assess` must not hide the verb of the same name."""

    def __setattr__(self, name: str, value: Any) -> None:
        super().__setattr__(name, getattr(value, name) if name in _ROOM_OF and isinstance(value, ModuleType) else value)

    def __getattr__(self, name: str) -> Any:
        if name in _ROOM_OF:
            return getattr(import_module(f"sloshpy.{_ROOM_OF[name]}"), name)
        raise AttributeError(f"module 'sloshpy' has no attribute {name!r}")

    def __dir__(self) -> list[str]:
        return sorted(__all__)


sys.modules[__name__].__class__ = _Contents
