"""A flight: the same questions along a trajectory, growth along it, and the damping it asks of each tank."""

from sloshpy.flight.assess_flight import FlightAssessment, assess_flight
from sloshpy.flight.events import Event
from sloshpy.flight.flight_history import FlightHistory
from sloshpy.flight.fly_fast import fly_fast
from sloshpy.flight.growth_across import CarriedGrowth, growth_across
from sloshpy.flight.growth_along import FlightGrowth, growth_along
from sloshpy.flight.growth_check import GrowthCheck, check_growth
from sloshpy.flight.mode_state import mode_state
from sloshpy.flight.phase_review import PhaseReview
from sloshpy.flight.requirement import DampingRequirement, damping_requirement
from sloshpy.flight.simulate_flight import simulate_flight
from sloshpy.flight.trajectory import FileUsed, Phase, Trajectory
from sloshpy.flight.windows import GrowthWindow
from sloshpy.flight.worst import Worst

__all__ = [
    "CarriedGrowth",
    "DampingRequirement",
    "Event",
    "FileUsed",
    "FlightAssessment",
    "FlightGrowth",
    "FlightHistory",
    "GrowthCheck",
    "GrowthWindow",
    "Phase",
    "PhaseReview",
    "Trajectory",
    "Worst",
    "assess_flight",
    "check_growth",
    "damping_requirement",
    "fly_fast",
    "growth_across",
    "growth_along",
    "mode_state",
    "simulate_flight",
]
