"""A flight file: TOML text and its tables in, a Trajectory out, or everything that is wrong with them.

name = "..."
[[table]]                     any number: name, file, interpolation = "linear" | "pchip", time = "t", columns
[[phase]]                     in order of time: name, case, start, end, step or times, tables
"""

import hashlib
import os
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from sloshpy.case import Case
from sloshpy.errors import InputError, Problem
from sloshpy.files.case_file import read_case
from sloshpy.files.flight_phase import Declared, build_phase
from sloshpy.files.flight_table import FlightTable, Wanted, read_flight_table
from sloshpy.files.places import Path, Places, find_places
from sloshpy.files.tank_file import read_tank
from sloshpy.files.text_file import beside, read_text
from sloshpy.files.toml_text import Found, in_file_order, once, parse_toml
from sloshpy.files.wording import nearest, step_into, value_at
from sloshpy.flight import FileUsed, Phase, Trajectory
from sloshpy.flight.scheduled import scheduled
from sloshpy.flight.scheduled_lag import NotScheduled
from sloshpy.tank import Tank
from sloshpy.units import Array, UnitError, parse

_TOP = ("name", "table", "phase")
_TABLE = ("name", "file", "interpolation", "time", "columns")
_PHASE = ("name", "case", "start", "end", "step", "times", "tables", "reference_dynamic_pressure")
_COLUMN = ("column", "unit", "tank_file")
MOST_TIMES = 20_000
PRESSURE = "aerodynamics.dynamic_pressure"


def read_flight(path: str | os.PathLike[str]) -> Trajectory:
    """Read a flight file with its tables, cases and tanks and return the flight.

    Args:
        path: a TOML file; tables, cases and tank files stand beside it or below its folder.

    Raises:
        InputError: with every fault of the file and of what it names, in file order.
    """
    _, text = read_text(path, "flight file")
    file = os.fspath(path)
    places = find_places(text)
    reader = _Reader(document=parse_toml(text, file, places), places=places, folder=FilePath(file).parent)
    phases = reader.phases()
    if reader.found or not phases:
        raise InputError(*in_file_order(once(reader.found), file, places))
    used = {FilePath(file).name: "flight file", **reader.used}
    return Trajectory(
        name=reader.text(("name",), reader.document),
        phases=phases,
        files=tuple(
            FileUsed(file=name, what=what, sha256=hashlib.sha256((reader.folder / name).read_bytes()).hexdigest())
            for name, what in used.items()
        ),
    )


@dataclass
class _Reader:
    """One flight file being read; what is wrong with it is gathered."""

    document: dict[str, Any]
    places: Places
    folder: FilePath
    found: Found = field(default_factory=list)
    used: dict[str, str] = field(default_factory=dict)  # file that was named -> what it is

    def refuse(self, path: Path, rule: str, cure: str) -> None:
        self.found.append(
            (path, Problem(key=self._words(path), value=value_at(path, self.places), rule=rule, cure=cure))
        )

    def _words(self, path: Path) -> str:
        words: list[str] = []
        node: Any = self.document
        for step in path:
            node = step_into(node, step)
            if isinstance(step, str):
                words.append(step)
            else:
                name = node.get("name") if isinstance(node, dict) else None
                words.append(f'"{name}"' if isinstance(name, str) else str(step + 1))
        return " ".join(words)

    def phases(self) -> tuple[Phase, ...]:
        """Return the phases; empty where something is wrong."""
        self._known((), self.document, _TOP)
        self.text(("name",), self.document)
        declared = [self._declared(k, one) for k, one in enumerate(self._list("phase"))]
        edges = [(one.start, one.end) for one in declared if one is not None]
        for k in range(1, len(edges)):
            if edges[k][0] < edges[k - 1][1]:
                self.refuse(("phase", k, "start"), f"lies before the end of the phase before, {edges[k - 1][1]:g} s",
                            "phases stand in order of time and do not overlap")  # fmt: skip
        events = sorted({time for pair in edges for time in pair})
        cases = [self._case(k, one) for k, one in enumerate(declared)]
        tables = self._tables(declared, cases, events)
        if self.found or not declared:
            return ()
        phases = []
        for k, (one, case) in enumerate(zip(declared, cases, strict=True)):
            assert one is not None
            assert case is not None
            named = str(self._list("phase")[k]["case"])
            phase, faults = build_phase(one, named, case, [tables[name] for name in one.tables])
            self.found += [(("phase", k), problem) for problem in faults]
            phases += [phase] if phase is not None else []
        return tuple(phases)

    def _declared(self, k: int, one: Any) -> Declared | None:
        """Return what a phase says of itself; None where its times are not known."""
        path: Path = ("phase", k)
        if not isinstance(one, dict):
            self.refuse(path, "must be a table", f"its keys are {', '.join(_PHASE)}")
            return None
        self._known(path, one, _PHASE)
        name = self.text((*path, "name"), one)
        start, end = (self._quantity((*path, key), one, "s") for key in ("start", "end"))
        if start is None or end is None:
            return None
        if not end > start:
            self.refuse((*path, "end"), f"must be after the start, {start:g} s", "swap them or correct one")
            return None
        tables = one.get("tables", [])
        names = [t.get("name") for t in self._list("table") if isinstance(t, dict)]
        if not isinstance(tables, list) or not all(isinstance(t, str) for t in tables):
            self.refuse((*path, "tables"), "must be a list of names of tables", 'write tables = ["ascent"]')
            tables = []
        for t in tables:
            if t not in names:
                self.refuse((*path, "tables"), f'names no table "{t}"', nearest(t, [str(n) for n in names]))
        if "tables" not in one:
            self.refuse((*path, "tables"), "is missing", 'write tables = ["ascent"], or [] where nothing changes')
        pressure = None
        if "reference_dynamic_pressure" in one:
            pressure = self._quantity((*path, "reference_dynamic_pressure"), one, "N/m^2")
        time = self._analysed(path, one, start, end)
        if time is None:
            return None
        return Declared(
            name=name, start=start, end=end, time=time, tables=tuple(tables), reference_dynamic_pressure=pressure
        )

    def _analysed(self, path: Path, one: dict[str, Any], start: float, end: float) -> Array | None:
        """Return the times to be assessed, both ends among them."""
        if ("step" in one) == ("times" in one):
            self.refuse((*path, "step"), "or times is wanted, one of them", 'write step = "1 s"')
            return None
        if "step" in one:
            step = self._quantity((*path, "step"), one, "s")
            if step is None:
                return None
            if not step > 0.0 or (end - start) / step > MOST_TIMES:
                self.refuse((*path, "step"), f"must be > 0 s and give {MOST_TIMES} times at most", 'write step = "1 s"')
                return None
            return np.linspace(start, end, int(np.ceil((end - start) / step * (1.0 - 1e-12))) + 1)
        times = one["times"]
        if not isinstance(times, list) or not 0 < len(times) <= MOST_TIMES:
            self.refuse((*path, "times"), f"must be a list of 1 to {MOST_TIMES} times", 'write times = ["0 s", "10 s"]')
            return None
        read = [self._parsed((*path, "times", n), text, "s") for n, text in enumerate(times)]
        if None in read:
            return None
        wanted = np.unique(np.array([start, *(x for x in read if x is not None), end]))
        if wanted[0] < start or wanted[-1] > end:
            self.refuse((*path, "times"), f"reach beyond the phase, {start:g} to {end:g} s", "drop those outside")
            return None
        return wanted

    def _case(self, k: int, declared: Declared | None) -> Case | None:
        path: Path = ("phase", k, "case")
        one = self._list("phase")[k]
        if declared is None or not isinstance(one, dict):
            return None
        file = self._beside("case", path, one.get("case"), 'write case = "stage_1.toml"')
        if file is None:
            return None
        try:
            return read_case(file)
        except InputError as error:
            self._faults_of(path, error)
            return None

    def _tables(
        self, declared: list[Declared | None], cases: list[Case | None], events: list[float]
    ) -> dict[str, FlightTable]:
        """Return the tables by name, each read for the cases of the phases that use it."""
        read: dict[str, FlightTable] = {}
        seen: set[str] = set()
        for k, one in enumerate(self._list("table")):
            path: Path = ("table", k)
            if not isinstance(one, dict):
                self.refuse(path, "must be a table", f"its keys are {', '.join(_TABLE)}")
                continue
            self._known(path, one, _TABLE)
            name = self.text((*path, "name"), one)
            if name in seen:
                self.refuse((*path, "name"), "is the name of another table too", "rename one")
            seen.add(name)
            users = [c for d, c in zip(declared, cases, strict=True) if d is not None and name in d.tables]
            if not users and self._named_by_a_phase(name):
                continue  # by one of which something else is wrong
            if not users:
                self.refuse((*path, "name"), "is used by no phase", "name it in a phase's tables, or drop it")
                continue
            if None in users:
                continue  # its columns mean nothing before the case is read
            found = self._table(path, name, one, [c for c in users if c is not None], events)
            if found is not None:
                uses = [d for d in declared if d is not None and name in d.tables]
                inner = {a.end: (a.name, b.name) for a in uses for b in uses if b.start == a.end}
                one_sided = found.one_sided(inner)
                if one_sided:
                    self._faults_of((*path, "file"), InputError(*one_sided))
                read[name] = found
        return read

    def _named_by_a_phase(self, table: str) -> bool:
        used = [one.get("tables") for one in self._list("phase") if isinstance(one, dict)]
        return any(table in names for names in used if isinstance(names, list))

    def _table(
        self, path: Path, name: str, one: dict[str, Any], cases: list[Case], events: list[float]
    ) -> FlightTable | None:
        before = len(self.found)
        how = one.get("interpolation")
        if how not in {"linear", "pchip"}:
            rule = "must be linear or pchip" if "interpolation" in one else "is missing"
            self.refuse((*path, "interpolation"), rule, 'write interpolation = "linear" or "pchip"')
        time = self._column((*path, "time"), one.get("time"), "time", "s")
        columns = one.get("columns")
        if not isinstance(columns, dict) or not columns:
            self.refuse((*path, "columns"), "must be a table of quantities", '"vehicle.mass" = "m", "m" in the header')
            return None
        wanted = [time] + [self._wanted((*path, "columns", key), key, value, cases) for key, value in columns.items()]
        names = [one.column for one in wanted if one is not None]
        for key in columns:
            if sum(n == _name_of(columns[key]) for n in names) > 1:
                self.refuse((*path, "columns", key), "reads a column that another quantity reads", "give each its own")
        file = self._beside("table", (*path, "file"), one.get("file"), 'write file = "ascent.csv"')
        if len(self.found) > before or file is None:
            return None
        try:
            return read_flight_table(name, file, [w for w in wanted if w is not None], how == "pchip", events)
        except InputError as error:
            self._faults_of((*path, "file"), error)
            return None

    def _wanted(self, path: Path, key: str, value: Any, cases: list[Case]) -> Wanted | None:
        """Return the column of one quantity, with the tank file of a fill read where it is named."""
        filling = key.startswith("tank.") and key.rsplit(".", 1)[-1] in {"fill", "depth"}
        if filling:
            tank = key[len("tank.") :].rsplit(".", 1)[0]
            for case in cases:
                if tank not in [t.name for t in case.vehicle.tanks]:
                    names = [t.name for t in case.vehicle.tanks]
                    self.refuse(path, "names no tank of the case", nearest(tank, names))
                    return None
                if any(t.name == tank and t.pendulum_length is not None for t in case.vehicle.tanks):
                    rule = "fills a tank that the case gives as a pendulum"
                    self.refuse(path, rule, "give it there by tank_file, or by station and frequency")
                    return None
            return self._column(path, value, key, "1" if key.endswith("fill") else "m", tank_file=True)
        if key == PRESSURE:
            if any(case.vehicle.aerodynamics is None for case in cases):
                self.refuse(path, "is not in the case: it has no [aerodynamics]", "add it to the case file")
                return None
            return self._column(path, value, key, "N/m^2")
        try:
            quantities = [scheduled(case, key) for case in cases]
        except NotScheduled as error:
            self.refuse(path, error.rule, error.cure)
            return None
        return self._column(path, value, key, quantities[0].quantity.unit)

    def _column(self, path: Path, value: Any, key: str, si: str, tank_file: bool = False) -> Wanted | None:
        """Return a column as the mapping names it: a text, or a table with its unit."""
        how = f'write {path[-1]} = "t", the name in the header, or {{ column = "t", unit = "{si}" }}'
        if isinstance(value, str) and value and not tank_file:
            return Wanted(key=key, column=value, si=si, unit="")
        if not isinstance(value, dict):
            if tank_file:
                how = 'write { column = "fill", tank_file = "lox.toml" }, with unit = "%" where the header has none'
            self.refuse(path, "is missing" if value is None else "must name a column", how)
            return None
        self._known(path, value, _COLUMN if tank_file else _COLUMN[:2])
        if not isinstance(value.get("column"), str) or not isinstance(value.get("unit", ""), str):
            self.refuse(path, "must name a column by a text", how)
            return None
        if tank_file:
            named = value.get("tank_file")
            file = self._beside("tank", (*path, "tank_file"), named, 'write tank_file = "lox.toml"')
            tank = None if file is None else self._tank((*path, "tank_file"), file)
            if tank is None:
                return None
            return Wanted(key=key, column=value["column"], si=si, unit=value.get("unit", ""), tank=tank)
        return Wanted(key=key, column=value["column"], si=si, unit=value.get("unit", ""))

    def _tank(self, path: Path, file: FilePath) -> Tank | None:
        try:
            tank = read_tank(file)
        except InputError as error:
            self._faults_of(path, error)
            return None
        if tank.bottom_station is None:
            self.refuse(path, "names a tank file without bottom_station", 'add bottom_station = "4 m" to the tank file')
            return None
        return tank

    def _faults_of(self, path: Path, error: InputError) -> None:
        """Take over the faults of a file that is named at a path; one without a line or a column is about the name."""
        for problem in error.problems:
            if problem.line is None and not problem.key.startswith(("column", "variable")):
                self.refuse(path, problem.rule, problem.cure)
            else:
                self.found.append((path, problem))

    def _beside(self, what: str, path: Path, file: Any, how: str) -> FilePath | None:
        if not isinstance(file, str):
            self.refuse(path, "is missing" if file is None else "must be a text", how)
            return None
        try:
            found = beside(file, self.folder)
            self.used.setdefault(file, what)
            return found
        except ValueError as error:
            self.refuse(path, str(error).replace("case file", "flight file"), "put it beside the flight file or below")
            return None

    def _list(self, key: str) -> list[Any]:
        value = self.document.get(key, [])
        if not isinstance(value, list) or not value:
            rule = "is missing" if key not in self.document else "must be an array of tables"
            self.refuse((key,), rule, f"write [[{key}]]")
            return []
        return value

    def _known(self, path: Path, one: dict[str, Any], keys: tuple[str, ...]) -> None:
        for key in one:
            if key not in keys:
                self.refuse((*path, key), "is an unknown key", nearest(key, list(keys)))

    def text(self, path: Path, one: dict[str, Any]) -> str:
        """Return the text at the last key of a path; what is not one is refused."""
        value = one.get(str(path[-1]))
        if not isinstance(value, str) or not value.strip() or len(value) > 100 or not value.isprintable():
            rule = "is missing" if value is None else "must be a text of 1 to 100 printable characters"
            self.refuse(path, rule, f'write {path[-1]} = "..."')
            return ""
        return value

    def _quantity(self, path: Path, one: dict[str, Any], unit: str) -> float | None:
        key = str(path[-1])
        if key not in one:
            self.refuse(path, "is missing", f'write {key} = "10 {unit}"')
            return None
        return self._parsed(path, one[key], unit)

    def _parsed(self, path: Path, value: Any, unit: str) -> float | None:
        if not isinstance(value, str):
            self.refuse(path, "has no unit" if isinstance(value, int | float) else "is no text", f'write "10 {unit}"')
            return None
        try:
            return parse(value, unit)
        except UnitError as error:
            self.refuse(path, error.rule, error.cure)
            return None


def _name_of(value: Any) -> Any:
    return value.get("column") if isinstance(value, dict) else value
