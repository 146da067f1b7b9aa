"""The autopilot from the measured attitude to the engine angle, eq 13 and what a real loop adds to it."""

from sloshpy.autopilot.autopilot import Actuator, Autopilot, DigitalFilter, Filter
from sloshpy.autopilot.blocks import PADE_ORDER, Block, delay_error, series_blocks
from sloshpy.autopilot.transfer import forward_transfer

__all__ = [
    "PADE_ORDER",
    "Actuator",
    "Autopilot",
    "Block",
    "DigitalFilter",
    "Filter",
    "delay_error",
    "forward_transfer",
    "series_blocks",
]
