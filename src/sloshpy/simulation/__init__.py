"""Nonlinear time histories: the linear plant plus the damping force, a true delay line, actuator limits (eq 20, fig 9)."""

from sloshpy.simulation.envelope import Envelope, settled_envelope
from sloshpy.simulation.simulate import TimeHistory, simulate

__all__ = ["Envelope", "TimeHistory", "settled_envelope", "simulate"]
