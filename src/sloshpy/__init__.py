"""Decide whether propellant slosh and a rocket's autopilot get along."""

__version__ = "0.1.0"
