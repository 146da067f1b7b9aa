"""The autopilot from the measured attitude to the engine angle, eq 13 and what a real loop adds to it."""

from sloshpy.autopilot.autopilot import Actuator, Autopilot, DigitalFilter, Filter
from sloshpy.autopilot.blocks import Block, series_blocks
from sloshpy.autopilot.transfer import forward_transfer

__all__ = ["Actuator", "Autopilot", "Block", "DigitalFilter", "Filter", "forward_transfer", "series_blocks"]
