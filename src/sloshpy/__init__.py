"""Decide whether propellant slosh and a rocket's autopilot get along.

The public names, in reading order; each is loaded when it is first used.

    nouns        Case, Vehicle, SloshMass, FlexibleMode, Engine, Aerodynamics, Autopilot, Actuator, Filter,
                 DigitalFilter, Criteria
    damping      ConstantDamping, PowerDamping, TableDamping, SumDamping; from a test: read_time_history, free_decay,
                 plot_free_decay, damping_line; DecayRecord, FreeDecay
    tanks        Tank, slosh_masses, slosh_masses_history, tank_damping, wall_damping, baffle_damping, read_tank,
                 read_fill_table, write_fill_history, plot_tank, plot_tank_damping, plot_fill_history;
                 shapes: Cylinder, Capsule, Sphere, Spheroid, Cone, Annulus, Toroid, Contour
    files        read_case, write_case, case_schema, tank_schema, write_example
    dynamics     plant, state_space, open_loop, frequency_response, closed_loop_poles
    stability    margins, margin_table, nichols_disc_margin, root_locus, danger_zone, required_damping,
                 required_damping_map, required_scale, damping_sweep, damping_sensitivity, disc_margin_curve,
                 grid_sweep, track_modes
    limit cycle  predict_limit_cycle, growth_curve, limit_cycles, two_axis_cycles, periodic_orbit,
                 degradation_map
    time         simulate, simulate_ensemble, simulate_two_axes, settled_envelope, verify, forced_response;
                 disturbances: Step, Pulse, OneMinusCosine, Samples, Noise
    flight       read_flight, assess_flight, damping_requirement, write_requirement, write_flight_figures,
                 write_flight_report, growth_along, growth_across, simulate_flight, fly_fast, check_growth; Phase,
                 Trajectory
    dispersions  read_dispersion, Dispersion, run_campaign, read_campaign, rerun, findings, against_time, fly_case,
                 write_campaign, plot_against_time, write_campaign_figures; Cluster
    review       assess, plot_bode and the other plots, write_report, write_figures
    batches      for_each: any verb that answers for one case, asked of each of a batch; Answers
    exchange     to_control, response_to_control, from_control
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

__version__ = "0.1.0"

_ROOMS = {
    "case": ("Case", "Criteria"),
    "batch": ("for_each", "Answers"),
    "vehicle": ("Vehicle", "SloshMass", "FlexibleMode", "ModeShape", "ModeSlope", "Engine", "Aerodynamics"),
    "autopilot": ("Autopilot", "Actuator", "Filter", "DigitalFilter"),
    "tank": (
        "Tank",
        "slosh_masses",
        "slosh_masses_history",
        "tank_damping",
        "wall_damping",
        "baffle_damping",
        "Cylinder",
        "Capsule",
        "Sphere",
        "Spheroid",
        "Cone",
        "Annulus",
        "Toroid",
        "Contour",
    ),
    "damping": (
        "ConstantDamping",
        "PowerDamping",
        "TableDamping",
        "SumDamping",
        "free_decay",
        "DecayRecord",
        "FreeDecay",
    ),
    "files": (
        "read_case",
        "read_dispersion",
        "read_tank",
        "read_time_history",
        "damping_line",
        "read_fill_table",
        "read_flight",
        "write_fill_history",
        "write_requirement",
        "write_case",
        "case_schema",
        "tank_schema",
        "write_example",
        "to_control",
        "response_to_control",
        "from_control",
    ),
    "dynamics": ("plant", "state_space", "open_loop", "frequency_response", "closed_loop_poles"),
    "stability": (
        "grid_sweep",
        "margins",
        "margin_table",
        "nichols_disc_margin",
        "root_locus",
        "danger_zone",
        "required_damping",
        "required_damping_map",
        "required_scale",
        "damping_sweep",
        "damping_sensitivity",
        "disc_margin_curve",
        "track_modes",
    ),
    "limit_cycle": (
        "predict_limit_cycle",
        "growth_curve",
        "limit_cycles",
        "two_axis_cycles",
        "periodic_orbit",
        "degradation_map",
    ),
    "simulation": (
        "simulate",
        "simulate_ensemble",
        "simulate_two_axes",
        "settled_envelope",
        "verify",
        "forced_response",
        "Step",
        "Pulse",
        "OneMinusCosine",
        "Samples",
        "Noise",
    ),
    "assess": ("assess", "Assessment"),
    "flight": (
        "Phase",
        "Trajectory",
        "assess_flight",
        "FlightAssessment",
        "damping_requirement",
        "growth_across",
        "growth_along",
        "simulate_flight",
        "fly_fast",
        "check_growth",
    ),
    "dispersion": (
        "Dispersion",
        "run_campaign",
        "read_campaign",
        "rerun",
        "findings",
        "against_time",
        "fly_case",
        "write_campaign",
        "Cluster",
    ),
    "plots": (
        "plot_against_time",
        "plot_bode",
        "plot_damping_law",
        "plot_damping_sweep",
        "plot_danger_zone",
        "plot_danger_zones",
        "plot_degradation_map",
        "plot_fill_history",
        "plot_flight_cycles",
        "plot_flight_damping",
        "plot_flight_danger_zone",
        "plot_flight_frequencies",
        "plot_flight_growth",
        "plot_flight_margins",
        "plot_free_decay",
        "plot_growth",
        "plot_growth_check",
        "plot_limit_cycle",
        "plot_mode_tracks",
        "plot_nichols",
        "plot_root_locus",
        "plot_tank",
        "plot_tank_damping",
        "plot_time_history",
        "plot_tvc_gain",
        "save_figure",
    ),
    "report": (
        "write_report",
        "write_figures",
        "write_flight_figures",
        "write_flight_report",
        "write_campaign_figures",
    ),
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
