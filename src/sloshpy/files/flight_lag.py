"""Filters and actuator of a phase by its tables: whether they are sound at each time, row and halfway between."""

from collections.abc import Sequence

import numpy as np

from sloshpy.case import Case
from sloshpy.errors import Problem
from sloshpy.files.flight_table import FlightTable
from sloshpy.flight.scheduled_lag import Place, lag_fault, lag_values
from sloshpy.units import Array

Lag = tuple[FlightTable, str, Place]  # the table of a column, its key, its place in the case


def lag_problems(phase: str, case: Case, lags: Sequence[Lag], time: Array) -> list[Problem]:
    """Return what makes a filter or actuator of a phase none, once for each, with the row where it stands in one.

    Args:
        phase: its name. lags: the columns that move filters and actuator, of tables cut to the phase.
        time: s, that are assessed.
    """
    found = []
    for owner in dict.fromkeys(_owner(place) for _, _, place in lags):
        own = [lag for lag in lags if _owner(lag[2]) == owner]
        part = case.autopilot.filter[owner[1]] if owner[0] == "filter" else case.autopilot.actuator
        if part is None or part.denominator is None:
            continue  # frequency and damping: each has its range, and with both in it an actuator is sound
        rows = np.unique(np.concatenate([table.time for table, _, _ in own]))
        ends = np.union1d(rows, time)
        for instants in (rows, np.sort(np.concatenate([ends, 0.5 * (ends[1:] + ends[:-1])]))):  # a row is told first
            moved = {
                (str(at[-2]), int(at[-1])): x
                for table, key, place in own
                for at, x in lag_values(case.autopilot, place, table.at(key, instants)).items()
            }
            fault = lag_fault(part, moved)
            if fault is not None:
                found.append(_told(phase, own, float(instants[fault[0]]), fault[1], fault[2]))
                break
    return found


def _owner(place: Place) -> tuple[str, int]:
    return ("filter", int(place[2])) if place[1] == "filter" else ("actuator", 0)


def _told(phase: str, lags: Sequence[Lag], when: float, rule: str, cure: str) -> Problem:
    """Return a fault at a time in s, with a line where a table has a row of that time."""
    name, number = _owner(lags[0][2])
    key = f"autopilot.{name}.{number + 1}" if name == "filter" else f"autopilot.{name}"
    for table, _, _ in lags:
        rows = np.flatnonzero(table.time == when)
        if len(rows):
            return table.problem(int(rows[0]), key, rule, cure, f"at {when:g} s")
    return Problem(key=f'phase "{phase}"', value="", rule=f"at {when:g} s: {key} {rule}", cure=cure)
