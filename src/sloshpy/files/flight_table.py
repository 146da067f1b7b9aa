"""One table of a flight: the columns that its mapping names, in SI, over time; nothing is guessed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np

from sloshpy.errors import InputError, Problem
from sloshpy.files.history_columns import HistoryColumn
from sloshpy.files.history_grid import read_csv, read_xlsx
from sloshpy.files.history_mat import read_mat
from sloshpy.files.history_netcdf import read_netcdf
from sloshpy.tank import Tank
from sloshpy.units import Array, BoolArray, UnitError, parse

Reader = Callable[[FilePath, tuple[str, str]], tuple[HistoryColumn, HistoryColumn]]
_READERS: dict[str, Reader] = {
    ".csv": read_csv,
    ".xlsx": read_xlsx,
    ".mat": read_mat,
    ".nc": read_netcdf,
    ".h5": read_netcdf,  # units in the attribute "units" of each dataset
    ".hdf5": read_netcdf,
}
STEPPED = 0.05  # of the mass between two rows: more is an event that nobody declared


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """A column that a mapping asks for: the quantity's key, the column's name, its SI unit, the unit declared or "".

    tank: of a fill, the tank whose slosh mass it gives.
    """

    key: str
    column: str
    si: str
    unit: str
    tank: Tank | None = None


@dataclass(frozen=True, kw_only=True)
class FlightTable:
    """Columns over time, (R,) each, SI; line: of each row in its file. tanks: of the columns that are fills."""

    name: str
    file: str
    time: Array
    values: dict[str, Array]
    line: tuple[int, ...]
    pchip: bool
    tanks: dict[str, Tank]

    def within(self, start: float, end: float) -> "FlightTable":
        """Return the rows of a phase: from its start, the last row of that time, to its end, the first of that time.

        Raises:
            InputError: no row at the start or at the end: what lies between rows on both sides of an event is unknown.
        """
        rows = []
        for when, side, last in ((start, "start", True), (end, "end", False)):
            at = np.flatnonzero(_same(self.time, when))
            if not len(at):
                near = float(self.time[np.argmin(np.abs(self.time - when))])
                raise InputError(
                    Problem(
                        key=f'table "{self.name}"',
                        value=f"nearest row at {near:g} s",
                        rule=f"has no row at {when:g} s, the {side} of a phase that uses it",
                        cure="add that row: no interpolation crosses an event",
                        file=self.file,
                        line=self.line[int(np.argmin(np.abs(self.time - when)))],
                    )
                )
            rows.append(int(at[-1] if last else at[0]))
        part = slice(rows[0], rows[1] + 1)
        return FlightTable(
            name=self.name,
            file=self.file,
            time=self.time[part],
            values={key: x[part] for key, x in self.values.items()},
            line=self.line[part],
            pchip=self.pchip,
            tanks=self.tanks,
        )

    def one_sided(self, events: dict[float, tuple[str, str]]) -> list[Problem]:
        """Return the events with one row for both sides; events: times and the phases before and after that use it.

        A row that stands for both sides says that nothing jumps, or that a side was forgotten, and does not say which.
        """
        found = []
        for when, (before, after) in sorted(events.items()):
            rows = np.flatnonzero(_same(self.time, when))
            if len(rows) == 1:
                rule = f'stands once, for the end of phase "{before}" and the start of phase "{after}"'
                cure = "give a row for each side, before and after the event; the same twice where nothing jumps"
                found.append(self.problem(int(rows[0]), "time", rule, cure, f"{when:g} s"))
        return found

    def at(self, key: str, time: Array) -> Array:
        """Return a column at times within the table, linear or monotone cubic, always within its neighbours' range."""
        if not self.pchip:
            return np.asarray(np.interp(time, self.time, self.values[key]))
        from scipy.interpolate import PchipInterpolator  # 0.3 s: only where it is asked for

        return np.asarray(PchipInterpolator(self.time, self.values[key])(time))

    def problem(self, row: int, key: str, rule: str, cure: str, value: str = "") -> Problem:
        """Return what is wrong with a row."""
        return Problem(key=key, value=value, rule=rule, cure=cure, file=self.file, line=self.line[row])


def read_flight_table(
    name: str, path: FilePath, wanted: Sequence[Wanted], pchip: bool, events: Sequence[float]
) -> FlightTable:
    """Read the columns that a mapping names.

    Args:
        name: of the table in the flight file. path: .csv, .xlsx, .mat (version 5 or 7.3), .h5, .hdf5 or .nc.
        wanted: the time first. pchip: how it is interpolated.
        events: times at which two rows may stand, one for each side.

    Raises:
        InputError: with every fault of the table, each with its line.
    """
    suffix = path.suffix.lower()
    if suffix not in _READERS:
        rule = f"must end in {', '.join(sorted(_READERS))}"
        raise InputError(Problem(key="table", value=path.name, rule=rule, cure="name a file of that format"))
    clock, problems, values = wanted[0], [], {}
    time, lines = np.zeros(0), None
    for one in wanted[1:]:
        try:
            first, found = _READERS[suffix](path, (clock.column, one.column))
            time, lines = _in_si(path, first, clock), found.lines
            values[one.key] = _in_si(path, found, one)
        except InputError as error:
            problems += [problem for problem in error.problems if problem not in problems]
    if problems:
        raise InputError(*problems)
    table = FlightTable(
        name=name,
        file=str(path),
        time=time,
        values=values,
        line=tuple(range(1, len(time) + 1)) if lines is None else tuple(int(k) for k in lines),
        pchip=pchip,
        tanks={one.key: one.tank for one in wanted if one.tank is not None},
    )
    problems = _times(table, events)
    if problems:
        raise InputError(*problems)
    return table


def _in_si(path: FilePath, column: HistoryColumn, wanted: Wanted) -> Array:
    """Return a column in SI by the unit in its file or, where that has none, the one that the mapping declares."""

    def refused(rule: str, cure: str) -> InputError:
        value = f"[{column.unit or wanted.unit}]" if column.unit or wanted.unit else ""
        key = f"column {column.name}"
        return InputError(Problem(key=key, value=value, rule=rule, cure=cure, file=str(path), line=column.header))

    if column.unit and wanted.unit:
        raise refused("has a unit here and in the flight file", "declare it once")
    unit = column.unit or wanted.unit
    if unit in {"", "1"}:
        if wanted.si != "1":
            how = column.how_to_declare.replace("[mm]", f"[{wanted.si}]").replace("'mm'", f"'{wanted.si}'")
            raise refused("has no unit", f"{how}, or declare unit in the flight file")
        return column.values
    try:
        if wanted.si == "dB":
            return np.array([parse(f"{x!r} {unit}", "dB") for x in column.values.tolist()])
        return np.asarray(column.values * parse(f"1 {unit}", wanted.si))
    except UnitError as error:
        plain = "leave the unit out: coefficients are in powers of seconds" if ".s^" in wanted.key else error.cure
        raise refused(error.rule, plain) from None


def _same(time: Array, when: float) -> BoolArray:
    """Return which times are one time, to the rounding of its unit."""
    return np.asarray(np.isclose(time, when, rtol=1e-12, atol=1e-9))


def _times(table: FlightTable, events: Sequence[float]) -> list[Problem]:
    """Return what is wrong with the order of the rows."""
    found = []
    t = table.time
    for k in np.flatnonzero(np.diff(t) <= 0.0)[:20] + 1:
        shown, before = f"{t[k]:g} s", f"{t[k - 1]:g} s in line {table.line[k - 1]}"
        if t[k] < t[k - 1]:
            found.append(table.problem(k, "time", f"must increase, but follows {before}", "sort the rows", shown))
        elif not np.any(_same(np.array(events), float(t[k]))):
            rule, cure = f"stands twice, first in line {table.line[k - 1]}", "declare an event there, or drop one row"
            found.append(table.problem(k, "time", rule, cure, shown))
        elif k > 1 and t[k - 2] == t[k]:
            found.append(table.problem(k, "time", "stands three times", "an event has two sides", shown))
    return found


def mass_problems(table: FlightTable) -> list[Problem]:
    """Return the rows of a phase at which the vehicle gains mass, or loses so much that an event is missing."""
    mass = table.values.get("vehicle.mass")
    if mass is None:
        return []
    found = []
    for k in np.flatnonzero(np.diff(mass) > 0.0)[:20] + 1:
        rule = f"rises from {mass[k - 1]:g} kg in line {table.line[k - 1]}"
        cure = "a vehicle gains no mass within a phase: declare an event, or correct the row"
        found.append(table.problem(k, "vehicle.mass", rule, cure, f"{mass[k]:g} kg"))
    for k in np.flatnonzero(mass[1:] < (1.0 - STEPPED) * mass[:-1])[:20] + 1:
        rule = f"falls by {100.0 * (1.0 - mass[k] / mass[k - 1]):.3g} % from line {table.line[k - 1]}"
        cure = "declare an event there, or give rows between: 5 % at most from one to the next"
        found.append(table.problem(k, "vehicle.mass", rule, cure, f"{mass[k]:g} kg"))
    return found
