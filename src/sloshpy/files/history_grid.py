"""Time histories in rows and columns: strict CSV, and the one sheet of an XLSX."""

import io
import os
import re
import warnings
import zipfile
from collections.abc import Sequence
from typing import Any

import numpy as np

from sloshpy.errors import InputError, Problem
from sloshpy.files.history_columns import HISTORY, LARGEST, MOST_SAMPLES, HistoryColumn, not_there, refused
from sloshpy.files.tables import TableColumn, bare, cells_of, read_cell
from sloshpy.files.text_file import read_bytes, read_text
from sloshpy.units import UnitError

_HEADER = re.compile(r"\s*([^\[\]]+?)\s*(?:\[([^\[\]]*)\])?\s*")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_CURE = 'write the header "time [s], wave [mm]"'
_MOST_PROBLEMS = 50
_SHOWN = 80  # characters of a cell in a message
_INFLATED = 1_000_000_000  # bytes that the parts of an XLSX may have

Named = tuple[str, str]


def read_csv(path: str | os.PathLike[str], names: Named) -> tuple[HistoryColumn, HistoryColumn]:
    """Read two columns of a CSV in UTF-8 with commas, decimal points and # for comments; other columns are not read."""
    _, text = read_text(path, HISTORY, LARGEST)
    rows: list[tuple[int, list[Any]]] = []
    for number, line in enumerate(text.split("\n"), 1):
        if '"' in line or "#" in line:
            if bare(line):
                rows.append((number, cells_of(line)))
        elif line.strip():
            rows.append((number, [cell.strip() for cell in line.split(",")]))
    return _columns(path, rows, names)


def read_xlsx(path: str | os.PathLike[str], names: Named) -> tuple[HistoryColumn, HistoryColumn]:
    """Read two columns of the only sheet of an XLSX: its first row holds names and units, its cells numbers."""
    from openpyxl import load_workbook  # 0.2 s: only when a sheet is read

    raw = read_bytes(path, HISTORY, LARGEST)
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as parts:
            inflated = sum(part.file_size for part in parts.infolist())
        if inflated > _INFLATED:
            raise refused(path, HISTORY, f"{inflated} bytes inflated", f"are more than {_INFLATED}", "save it as CSV")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # openpyxl's, of styles and drawings that do not concern the numbers
            book = load_workbook(io.BytesIO(raw), read_only=True, data_only=True)
            if len(book.worksheets) != 1:
                sheets = ", ".join(book.sheetnames)[:_SHOWN]
                rule = f"has {len(book.worksheets)} sheets, must have one"
                raise refused(path, HISTORY, sheets, rule, "save the sheet as a file of its own")
            rows = [
                (number, _filled(cells))
                for number, cells in enumerate(book.worksheets[0].iter_rows(values_only=True), 1)
                if any(cell is not None for cell in cells)
            ]
    except (zipfile.BadZipFile, EOFError, KeyError, OSError, SyntaxError, ValueError, TypeError) as error:
        if isinstance(error, InputError):
            raise
        raise refused(path, HISTORY, "", "is no XLSX, or a truncated one", "save it again") from None
    return _columns(path, rows, names)


def _filled(cells: Sequence[Any]) -> list[Any]:
    """Return a row without the blank cells beyond its last one."""
    row = list(cells)
    while row and row[-1] is None:
        row.pop()
    return row


def _columns(
    path: str | os.PathLike[str], rows: list[tuple[int, list[Any]]], names: Named
) -> tuple[HistoryColumn, HistoryColumn]:
    if not rows:
        raise refused(path, HISTORY, "", "has no header", _CURE)
    line, header = rows[0]
    if len(header) == 1 and ";" in str(header[0]):
        cure = "separate the cells by commas, with decimal points in them"
        raise refused(path, "header", str(header[0])[:_SHOWN], "is separated by semicolons", cure, line)
    heads = [_HEADER.fullmatch("" if cell is None else str(cell)) for cell in header]
    known = [head.group(1) if head else "" for head in heads]
    if all(not name or _NUMBER.fullmatch(name) for name in known):
        raise refused(path, "header", ", ".join(map(str, header))[:_SHOWN], "is not a header", _CURE, line)
    for name in names:
        if name not in known:
            raise not_there(path, name, [one for one in known if one], line)
        if known.count(name) > 1:
            raise refused(path, "header", name, "is there twice", "rename one of the columns", line)
    if len(rows) - 1 > MOST_SAMPLES:
        raise refused(path, HISTORY, f"{len(rows) - 1} rows", f"are more than {MOST_SAMPLES}", "thin it out or cut it")
    if len(rows) < 3:
        raise refused(
            path, HISTORY, "", f"has {len(rows) - 1} data row{'s' * (len(rows) != 2)}", "give at least two", line
        )
    at = [known.index(name) for name in names]
    numbers, problems = np.empty((2, len(rows) - 1)), []
    for k, (row, cells) in enumerate(rows[1:]):
        if len(cells) != len(header) and (len(cells) > len(header) or len(cells) <= max(at)):
            rule = f"has {len(cells)} cells where the header has {len(header)}"
            cure = "separate cells by commas, write decimal points, and fill every cell"
            text = ", ".join(map(str, cells))[:_SHOWN]
            problems.append(Problem(key="row", value=text, rule=rule, cure=cure, file=os.fspath(path), line=row))
        else:
            for j, name in zip(at, names, strict=True):
                try:
                    numbers[names.index(name), k] = _number(cells[j])
                except UnitError as error:
                    value = "" if cells[j] is None else str(cells[j])[:_SHOWN]
                    key = f"column {name}"
                    words = {"rule": error.rule, "cure": error.cure, "file": os.fspath(path)}
                    problems.append(Problem(key=key, value=value, line=row, **words))
        if len(problems) >= _MOST_PROBLEMS:
            break
    if problems:
        raise InputError(*problems)
    lines = np.array([row for row, _ in rows[1:]])
    time, found = (
        HistoryColumn(
            name=name,
            unit=(heads[j].group(2) or "").strip() if heads[j] else "",  # type: ignore[union-attr]
            values=numbers[n],
            how_to_declare=f'write "{name} [{"s" if n == 0 else "mm"}]" in the header',
            lines=lines,
            header=line,
        )
        for n, (j, name) in enumerate(zip(at, names, strict=True))
    )
    return time, found


def _number(cell: Any) -> float:
    """Return the number of a cell: a text of one grammar, or a number of a sheet."""
    if isinstance(cell, str) or cell is None:
        text = (cell or "").strip()
        if _NUMBER.fullmatch(text):
            value = float(text)
            if np.isfinite(value):
                return value
        try:
            return read_cell(text, TableColumn(name="", unit="", si="1"))
        except UnitError as error:
            if "must be a plain number" in error.rule:
                raise UnitError("has a unit in the cell", "write the unit into the header only") from None
            raise
    if isinstance(cell, bool) or not isinstance(cell, int | float):
        raise UnitError(f"is a {type(cell).__name__}, must be a number", "format the cell as a number")
    if not np.isfinite(cell):
        raise UnitError("must be finite", "write a number")
    return float(cell)
