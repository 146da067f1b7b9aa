"""What no draw of a flight could be simulated with: told once, not by every flight that fails."""

import itertools

import numpy as np

from sloshpy.dispersion.dispersion import Dispersion, Nonlinear, Parameter
from sloshpy.flight.equations import Equations
from sloshpy.flight.events import INSTANT
from sloshpy.flight.switched import switched
from sloshpy.flight.trajectory import Phase

Fault = tuple[str, str, str]  # key of the analysis, "" for all of it; rule; cure


def flown_fault(dispersion: Dispersion) -> Fault | None:
    """Return why a flight cannot be simulated as it is asked; None where it can."""
    how = dispersion.analysis
    if not dispersion.phases or not isinstance(how, Nonlinear):
        return None
    found = gust_fault(dispersion.phases, how, dispersion.parameters)
    if found is not None:
        return ("gust_start", *found)
    for stretch in dispersion.stretches:
        try:
            each = [Equations.of(phase) for phase in stretch]
            for one, two in itertools.pairwise(each):  # at rest, for what it refuses
                time = one.phase.time[-2:]
                switched((one.phase, two.phase), [(time, np.zeros((2, one.models[0].size)))])
        except ValueError as error:
            where = f"the flight cannot be simulated from {stretch[0].time[0]:g} s on"
            return "", f"{where}: {error}", "change that, or ask [linear] of the flight"
    return None


def gust_fault(
    phases: tuple[Phase, ...], analysis: Nonlinear, parameters: tuple[Parameter, ...]
) -> tuple[str, str] | None:
    """Return rule and cure where a gust can blow, wholly or in part, outside the air of a flight; None where it cannot.

    What a gust gives that is cut off by an event, or begins before the simulation does, is no answer to a gust.
    """
    varied = {p.input: p for p in parameters}
    if analysis.gust_speed == 0.0 and "run.gust_speed" not in varied:
        return None
    ends = []
    for name in ("gust_start", "gust_duration"):
        own, p = float(getattr(analysis, name)), varied.get(f"run.{name}")
        low, high = (1.0, 1.0) if p is None else (p.distribution.low, p.distribution.high)
        ends.append((low, high) if p is not None and not p.factor else (own * low, own * high))
    first, last = ends[0][0], ends[0][1] + ends[1][1]
    air = in_air(phases)
    if any(begin <= first and last <= end for begin, end in air):
        return None
    if not air:
        return "blows where the flight has no air", "add [aerodynamics] to a phase's case, or leave the gust out"
    where = ", ".join(f"{begin:g} to {end:g} s" for begin, end in air)
    rule = f"lets the gust blow from {first:g} to {last:g} s of the flight; air and simulation are there from {where}"
    return rule, "let it begin and end within that"


def in_air(phases: tuple[Phase, ...]) -> list[tuple[float, float]]:
    """Return from when to when, in s, phases with aerodynamics follow each other without a gap."""
    found: list[tuple[float, float]] = []
    for phase in phases:
        begin, end = float(phase.time[0]), float(phase.time[-1])
        if phase.case.vehicle.aerodynamics is None:
            continue
        if found and begin - found[-1][1] <= INSTANT:
            found[-1] = (found[-1][0], end)
        else:
            found.append((begin, end))
    return found
