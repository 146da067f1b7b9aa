"""A flight: the same questions along a trajectory, growth along it, and the damping it asks of each tank."""

from sloshpy.flight.assess_flight import FlightAssessment, assess_flight
from sloshpy.flight.events import Event
from sloshpy.flight.growth_along import FlightGrowth, growth_along
from sloshpy.flight.phase_review import PhaseReview
from sloshpy.flight.requirement import DampingRequirement, damping_requirement
from sloshpy.flight.simulate_flight import FlightHistory, GrowthCheck, check_growth, mode_state, simulate_flight
from sloshpy.flight.trajectory import FileUsed, Phase, Trajectory
from sloshpy.flight.windows import GrowthWindow
from sloshpy.flight.worst import Worst

__all__ = [
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
    "growth_along",
    "mode_state",
    "simulate_flight",
]
