"""Tables of numbers, as tests and computations deliver them: strict CSV, units in the header, one number grammar."""

import csv
import math
import os
import re
from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from sloshpy.damping import TableDamping
from sloshpy.errors import InputError, Problem
from sloshpy.files.text_file import read_text
from sloshpy.units import Array, UnitError, parse

_HEADER = re.compile(r"\s*([A-Za-z_]+)\s*(?:\[([^\[\]]*)\])?\s*")
_COMMENT = re.compile(r"#(?!N/A|DIV/0!|VALUE!|REF!|NUM!|NAME\?|NULL!)")  # those are cells that a spreadsheet gave up
_MOST_PROBLEMS = 50
_SHOWN = 80  # characters of a row or cell in a message
_MOST_ROWS = 10_000  # a law of damping or a wall bends a few times, not ten thousand times


@dataclass(frozen=True, kw_only=True)
class Kind:
    """What a table of this kind holds: its columns with their SI units, and which may be missing or end early.

    declared: columns of plain numbers whose header must say % or 1 all the same, since both are written.
    """

    what: str
    columns: dict[str, str]
    cure: str
    optional: frozenset[str] = frozenset()
    declared: frozenset[str] = frozenset()


DAMPING = Kind(
    what="damping table", columns={"amplitude": "m", "ratio": "1"}, cure='write the header "amplitude [m], ratio [%]"'
)


@dataclass(frozen=True, kw_only=True)
class Row:
    """One line of the table that holds cells."""

    line: int
    cells: list[str]


@dataclass(frozen=True, kw_only=True)
class TableColumn:
    """What a header says of its column: the quantity and the unit its cells are in."""

    name: str
    unit: str
    si: str


def read_damping_table(path: str | os.PathLike[str]) -> tuple[Array, Array]:
    """Read a table with the columns amplitude and ratio, units in the header, and return both in SI.

        amplitude [m], ratio [%]
        0.00, 0.2      # smooth wall
        0.10, 1.2

    Args:
        path: a CSV file in UTF-8 with commas between cells and decimal points; # starts a comment.

    Returns:
        Slosh-mass displacement amplitudes in m, increasing, and damping ratios, both of shape (rows,).

    Raises:
        InputError: with every fault of the table, each with its line.
    """
    name = os.fspath(path)
    columns, rows, numbers = read_columns(path, DAMPING)
    try:
        law = TableDamping.model_validate(numbers)
    except ValidationError as error:
        raise InputError(*_row_problems(error, rows, columns, name)) from None
    return law.tested_amplitude, law.tested_ratio


def read_columns(
    path: str | os.PathLike[str], kind: Kind
) -> "tuple[list[TableColumn], list[Row], dict[str, list[float]]]":
    """Read a table and return its columns, its rows, the header first, and the numbers of each column in SI.

    Raises:
        InputError: with every fault of the table, each with its line.
    """
    name = os.fspath(path)
    _, text = read_text(path, kind.what)
    rows = [Row(line=k, cells=cells_of(line)) for k, line in enumerate(text.split("\n"), 1) if bare(line)]
    if not rows:
        raise InputError(Problem(key=kind.what, value="", rule="has no header", cure=kind.cure, file=name))
    columns = _columns(rows[0], name, kind)
    if len(rows) == 1:
        few = Problem(key=kind.what, value="", rule="has 0 data rows", cure="give at least two", file=name)
        raise InputError(few.at(name, rows[0].line))
    if len(rows) > _MOST_ROWS:
        rule = f"has {len(rows) - 1} rows, more than {_MOST_ROWS}"
        raise InputError(Problem(key=kind.what, value="", rule=rule, cure="thin it out", file=name, line=1))
    problems: list[Problem] = []
    numbers: dict[str, list[float]] = {column.name: [] for column in columns}
    ended: set[str] = set()
    for row in rows[1:]:
        problems += _read_row(row, columns, numbers, ended, name, kind)
        if len(problems) >= _MOST_PROBLEMS:
            break
    if problems:
        raise InputError(*problems)
    return columns, rows, numbers


def bare(line: str) -> str:
    """Return a line without its comment."""
    return _COMMENT.split(line, maxsplit=1)[0].strip()


def cells_of(line: str) -> list[str]:
    """Return the cells of a line."""
    try:
        return [cell.strip() for cell in next(csv.reader([bare(line)], skipinitialspace=True), [])]
    except csv.Error:  # a cell of more than 131 072 characters
        return [line[:_SHOWN]]


def _columns(header: Row, file: str, kind: Kind) -> list[TableColumn]:
    """Return what the header says of each column."""

    def refused(value: str, rule: str, cure: str = kind.cure) -> InputError:
        return InputError(Problem(key="header", value=value, rule=rule, cure=cure, file=file, line=header.line))

    written = ", ".join(header.cells)
    if len(header.cells) == 1 and ";" in written:
        raise refused(
            written, "is separated by semicolons", "separate the cells by commas, with decimal points in them"
        )
    columns: list[TableColumn] = []
    for cell in header.cells:
        found = _HEADER.fullmatch(cell)
        if found is None:
            raise refused(
                written, "is not a header" if _number(cell) else f'has the column "{cell}", which is no name and unit'
            )
        name, unit = found.group(1), found.group(2)
        if name not in kind.columns:
            raise refused(written, f'has the unknown column "{name}"')
        if name in [column.name for column in columns]:
            raise refused(written, f'has the column "{name}" twice')
        if not unit and (kind.columns[name] != "1" or name in kind.declared):
            raise refused(written, f"has no unit for the {name}")
        if unit and unit != "1":
            try:
                parse(f"1 {unit}", kind.columns[name])
            except UnitError as error:
                raise refused(written, f"[{unit}] {error.rule}") from None
        plain = unit is None or unit == "1"
        columns.append(TableColumn(name=name, unit="" if plain else unit.strip(), si=kind.columns[name]))
    for name in kind.columns:
        if name not in [*kind.optional, *(column.name for column in columns)]:
            raise refused(written, f'has no column "{name}"')
    return columns


def _number(cell: str) -> bool:
    return cell[:1].isdigit() or cell[:1] in {"-", "+", "."}


def _read_row(
    row: Row, columns: list[TableColumn], numbers: dict[str, list[float]], ended: set[str], file: str, kind: Kind
) -> list[Problem]:
    """Append a row's numbers to its columns; return what is wrong with it. An optional column may end before others."""
    if len(row.cells) != len(columns):
        rule = f"has {len(row.cells)} cells where the header has {len(columns)}"
        cure = "separate cells by commas, write decimal points, and fill every cell"
        return [Problem(key="row", value=", ".join(row.cells)[:_SHOWN], rule=rule, cure=cure, file=file, line=row.line)]
    problems = []
    for column, cell in zip(columns, row.cells, strict=True):
        if not cell and column.name in kind.optional:
            ended.add(column.name)
            continue
        try:
            if column.name in ended:
                raise UnitError("follows a blank cell", "leave blank cells at the end of the column only")
            numbers[column.name].append(read_cell(cell, column))
        except UnitError as error:
            key = f"column {column.name}"
            problems.append(
                Problem(key=key, value=cell[:_SHOWN], rule=error.rule, cure=error.cure, file=file, line=row.line)
            )
    return problems


def read_cell(cell: str, column: TableColumn) -> float:
    """Return a cell in SI."""
    cure = "write a number with a decimal point"
    if not cell:
        raise UnitError("is blank", "fill the cell or drop the row")
    if cell.lstrip("+-").lower() in {"nan", "inf", "infinity"}:
        raise UnitError("must be finite", cure)
    try:
        plain = parse(cell, "1")
    except UnitError as error:
        raise UnitError(error.rule, error.cure if "Fortran" in error.rule else cure) from None
    if re.search(r"[^\d.eE+-]", cell):
        raise UnitError("has a unit in the cell", "write the unit into the header only")
    value = parse(f"{cell} {column.unit}", column.si) if column.unit else plain
    if not math.isfinite(value):
        raise UnitError("must be finite", cure)
    return value


def _row_problems(error: ValidationError, rows: list[Row], columns: list[TableColumn], file: str) -> list[Problem]:
    """Return what the law says of the numbers, each with the row that it is about."""
    problems = []
    for fault in error.errors():
        words = fault.get("ctx", {})
        path = (*fault["loc"], *words.get("key", ()))
        row = rows[1 + path[1]] if len(path) > 1 and isinstance(path[1], int) else rows[-1]
        at = [column.name for column in columns].index(str(path[0]))
        value = row.cells[at] if len(path) > 1 else ""
        rule, cure = words.get("rule", fault["msg"]), words.get("cure", "")
        problems.append(Problem(key=f"column {path[0]}", value=value, rule=rule, cure=cure, file=file, line=row.line))
    return sorted(problems, key=lambda problem: problem.line or 0)


def as_written(amplitude: Array) -> list[str]:
    """Return lengths in m as texts that read back to the same numbers."""
    return [f"{value!r} m" for value in np.asarray(amplitude).tolist()]
