"""One phase of a flight file: its case with the columns of its tables put in, at the times to be assessed."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sloshpy.case import Case
from sloshpy.damping import AnyDamping
from sloshpy.errors import InputError, Problem
from sloshpy.files.flight_lag import Lag, lag_problems
from sloshpy.files.flight_table import FlightTable, mass_problems
from sloshpy.flight import Phase
from sloshpy.flight.filled import Filled, filled
from sloshpy.flight.scheduled import Steps, as_springs, first_fault, frequencies_follow, scheduled, with_schedules
from sloshpy.flight.scheduled_lag import lag_values
from sloshpy.tank import Fill
from sloshpy.units import Array

PRESSURE = "aerodynamics.dynamic_pressure"


@dataclass(frozen=True, kw_only=True)
class Declared:
    """What a phase says of itself: its events, the times to be assessed, the names of its tables; SI."""

    name: str
    start: float
    end: float
    time: Array
    tables: tuple[str, ...]
    reference_dynamic_pressure: float | None


@dataclass
class _Columns:
    """What the tables give for one phase: arrays by place in the case, fills by tank, columns of filters."""

    values: dict[Steps, Array] = field(default_factory=dict)
    fills: dict[int, tuple[FlightTable, str]] = field(default_factory=dict)
    given: dict[str, str] = field(default_factory=dict)  # key -> table
    lags: list[Lag] = field(default_factory=list)  # of filters and actuator
    problems: list[Problem] = field(default_factory=list)


def build_phase(
    declared: Declared, case_file: str, case: Case, tables: Sequence[FlightTable]
) -> tuple[Phase | None, list[Problem]]:
    """Return a phase, or what is wrong with its tables: each fault with the row that it is about."""
    columns = _gathered(declared, case, tables)
    if columns.problems:
        return None, columns.problems
    thrust: Steps = ("vehicle", "thrust")
    own = "vehicle.vectored_thrust" in (case.source.given if case.source is not None else {})
    if thrust in columns.values and not own:  # all of it is gimballed, as in a case that does not say
        columns.values.setdefault(("vehicle", "vectored_thrust"), columns.values[thrust])
    moving = with_schedules(case, columns.values)
    slow = np.flatnonzero(np.broadcast_to(np.asarray(moving.vehicle.acceleration), declared.time.shape) <= 0.0)
    if len(slow):
        rule = f"drag is at least the thrust at {declared.time[slow[0]]:g} s: slosh has no spring without acceleration"
        return None, [_of_phase(declared, rule, "end the phase before, a coast is none")]
    notes: list[str] = []
    laws: list[tuple[AnyDamping, ...] | None] = [None] * len(case.vehicle.tanks)
    fill = np.full((len(declared.time), len(laws)), np.nan)
    values: dict[Steps, Array] = {}
    acceleration = np.broadcast_to(np.asarray(moving.vehicle.acceleration), declared.time.shape)
    for j, (table, key) in columns.fills.items():
        tank = _drained(declared, table, key, acceleration)
        if tank.missing is not None:
            k, why = tank.missing
            rule = f"{case.vehicle.tanks[j].name} has no slosh mass at {declared.time[k]:g} s: {why}"
            return None, [
                _of_phase(declared, rule, "end the phase there, and leave the tank out of the next one's case")
            ]
        place: Steps = ("vehicle", "tanks", j)
        values |= {(*place, name): getattr(tank, name) for name in ("slosh_mass", "station", "frequency", "radius")}
        fill[:, j] = tank.fraction
        laws[j], told = _own_laws(case, j, tank)
        notes += [f"{case.vehicle.tanks[j].name}: {one}" for one in told]
        for first, count, why in tank.doubts:
            more = f" and at {count - 1} more times" if count > 1 else ""
            notes.append(f"{case.vehicle.tanks[j].name}, at {declared.time[first]:g} s{more}: {why}")
    free = frozenset({int(s[2]) for s in columns.values if s[:2] == ("vehicle", "tanks") and s[-1] == "frequency"})
    moving, scaled = frequencies_follow(with_schedules(moving, values), case, free | frozenset(columns.fills))
    if scaled:
        notes.append(f"slosh frequency of {', '.join(scaled)} from the case, with the square root of the acceleration")
    whole = as_springs(moving).model_copy(update={"source": None})  # its texts are of the case file alone
    phase = Phase(
        name=declared.name,
        time=declared.time,
        case=whole,
        laws=_rows(whole, laws, len(declared.time)),
        fill=fill,
        notes=tuple(notes),
        schedules=tuple((key, f'table "{name}", {_course(tables, name)}') for key, name in columns.given.items()),
        case_file=case_file,
    )
    fault = first_fault(phase.cases)
    if fault is not None:
        k, key, rule, cure = fault
        return None, [_of_phase(declared, f"at {declared.time[k]:g} s: {key} {rule}", cure)]
    return phase, []


def _gathered(declared: Declared, case: Case, tables: Sequence[FlightTable]) -> _Columns:
    """Return the columns of a phase's tables at its times; ranges are checked row by row."""
    found = _Columns()
    for whole in tables:
        try:
            table = whole.within(declared.start, declared.end)
        except InputError as error:
            found.problems += error.problems
            continue
        found.problems += mass_problems(table)
        for key in table.values:
            if key in found.given:
                rule = f'{key} stands in the tables "{found.given[key]}" and "{table.name}"'
                found.problems.append(_of_phase(declared, rule, "leave one of them out"))
            found.given[key] = table.name
            _take(found, declared, case, table, key)
    found.problems += [] if found.problems else lag_problems(declared.name, case, found.lags, declared.time)
    for j, (_, key) in found.fills.items():
        name = case.vehicle.tanks[j].name
        both = [
            other
            for other in found.given
            if other.startswith(f"tank.{name}.") and other != key and not other.endswith(".damping")
        ]
        if both:
            found.problems.append(_of_phase(declared, f"{both[0]} stands beside {key}", "the tank file gives it"))
    return found


def _take(found: _Columns, declared: Declared, case: Case, table: FlightTable, key: str) -> None:
    """Put one column into its place."""
    if key in table.tanks:
        name = key[len("tank.") :].rsplit(".", 1)[0]
        found.fills[[t.name for t in case.vehicle.tanks].index(name)] = (table, key)
        return
    if key == PRESSURE:
        reference, air = declared.reference_dynamic_pressure, case.vehicle.aerodynamics
        if reference is None or not reference > 0.0 or air is None:
            rule = "reference_dynamic_pressure is missing, at which the case's normal_force_slope holds"
            found.problems.append(_of_phase(declared, rule, 'write reference_dynamic_pressure = "30 kPa"'))
            return
        low = np.flatnonzero(table.values[key] <= 0.0)
        if len(low):
            cure = "begin the phase in the air, or leave [aerodynamics] out of its case"
            found.problems.append(table.problem(int(low[0]), key, "must be > 0 N/m^2", cure))
            return
        place: Steps = ("vehicle", "aerodynamics", "normal_force_slope")
        if place in found.values:
            rule = f"{key} stands beside aerodynamics.normal_force_slope, which it would give"
            found.problems.append(_of_phase(declared, rule, "leave one of them out"))
        slope = float(air.normal_force_slope) * table.at(key, declared.time) / reference
        found.values[place] = slope
        return
    quantity = scheduled(case, key)
    fault = quantity.fault(table.values[key])
    if fault is not None:
        k, rule, cure = fault
        value = f"{table.values[key][k]:g}" + ("" if quantity.quantity.unit == "1" else f" {quantity.quantity.unit}")
        found.problems.append(table.problem(k, key, rule, cure, value))
        return
    if quantity.steps[:2] in {("autopilot", "filter"), ("autopilot", "actuator")}:
        found.lags.append((table, key, quantity.steps))
    for place, values in lag_values(case.autopilot, quantity.steps, table.at(key, declared.time)).items():
        if place in found.values:
            rule = f"{key} stands beside another schedule of the same quantity"
            found.problems.append(_of_phase(declared, rule, "leave one of them out"))
        found.values[place] = values


def _drained(declared: Declared, table: FlightTable, key: str, acceleration: Array) -> Filled:
    values = table.at(key, declared.time)
    fill: tuple[str | float | Fill, ...]
    fill = tuple(f"{100.0 * x!r} %" for x in values.tolist()) if key.endswith(".fill") else tuple(values.tolist())
    return filled(table.tanks[key], fill, acceleration)


def _own_laws(case: Case, j: int, tank: Filled) -> tuple[tuple[AnyDamping, ...] | None, tuple[str, ...]]:
    """Return the laws that a tank's fills give, and what to say; None where the case gives the damping."""
    given = case.source.given if case.source is not None else {}
    if any(key.startswith(f"tank.{case.vehicle.tanks[j].name}.damping") for key in given):
        return None, ("damping as the case gives it",)
    if not tank.laws:
        return None, ("damping of the case, the tank file gives none", *tank.sources)
    return tank.laws, ("at the first time " + tank.sources[0], *tank.sources[1:])


def _rows(case: Case, laws: Sequence[tuple[AnyDamping, ...] | None], count: int) -> tuple[tuple[AnyDamping, ...], ...]:
    """Return the laws of each time, () where none changes."""
    if all(one is None for one in laws):
        return ()
    own = [t.damping for t in case.vehicle.tanks]
    return tuple(
        tuple(law if some is None else some[k] for law, some in zip(own, laws, strict=True)) for k in range(count)
    )


def _course(tables: Sequence[FlightTable], name: str) -> str:
    return "monotone cubic between rows" if next(t for t in tables if t.name == name).pchip else "linear between rows"


def _of_phase(declared: Declared, rule: str, cure: str) -> Problem:
    return Problem(key=f'phase "{declared.name}"', value="", rule=rule, cure=cure)
