"""The equations of motion, the loop, its exact frequency response and its poles, eqs 1-12."""

from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.plant import Plant, plant, state_space, without_drift
from sloshpy.dynamics.poles import Poles, closed_loop_poles, open_loop_poles
from sloshpy.dynamics.response import FrequencyResponse, frequency_response

__all__ = [
    "FrequencyResponse",
    "Loop",
    "Plant",
    "Poles",
    "closed_loop_poles",
    "frequency_response",
    "open_loop",
    "open_loop_poles",
    "plant",
    "state_space",
    "without_drift",
]
