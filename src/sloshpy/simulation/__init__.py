"""Nonlinear time histories: linear plant, damping force, true delay line, actuator limits (eq 20, fig 9)."""

from sloshpy.simulation.degraded import simulate_degraded
from sloshpy.simulation.ensemble import Ensemble, simulate_ensemble
from sloshpy.simulation.envelope import Envelope, settled_envelope
from sloshpy.simulation.forced import ForcedResponse, forced_response
from sloshpy.simulation.signals import Noise, OneMinusCosine, Pulse, Samples, Step
from sloshpy.simulation.simulate import TimeHistory, simulate
from sloshpy.simulation.two_axes import TwoAxisHistory, simulate_two_axes
from sloshpy.simulation.verify import Verification, verify

__all__ = [
    "Ensemble",
    "Envelope",
    "ForcedResponse",
    "Noise",
    "OneMinusCosine",
    "Pulse",
    "Samples",
    "Step",
    "TimeHistory",
    "TwoAxisHistory",
    "Verification",
    "forced_response",
    "settled_envelope",
    "simulate",
    "simulate_degraded",
    "simulate_ensemble",
    "simulate_two_axes",
    "verify",
]
