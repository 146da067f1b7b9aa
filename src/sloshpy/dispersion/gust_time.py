"""When the gust of a simulated flight can blow, and when there is air for it."""

from sloshpy.dispersion.dispersion import Linear, Nonlinear, Parameter
from sloshpy.flight.events import INSTANT
from sloshpy.flight.trajectory import Phase


def gust_fault(
    phases: tuple[Phase, ...], analysis: Linear | Nonlinear, parameters: tuple[Parameter, ...]
) -> tuple[str, str] | None:
    """Return rule and cure where a gust can blow, wholly or in part, outside the air of a flight; None where it cannot.

    What a gust gives that is cut off by an event, or begins before the simulation does, is no answer to a gust.
    """
    varied = {p.input: p for p in parameters}
    if not phases or not isinstance(analysis, Nonlinear):
        return None
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
