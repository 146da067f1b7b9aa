"""Time histories of tests: a column and its time from CSV, XLSX, MAT or NetCDF, in the units that the file declares."""

import os
from pathlib import Path

import numpy as np

from sloshpy.damping import DecayRecord
from sloshpy.errors import InputError, Problem
from sloshpy.files.history_columns import HISTORY, HistoryColumn
from sloshpy.files.history_grid import read_csv, read_xlsx
from sloshpy.files.history_mat import read_mat
from sloshpy.files.history_netcdf import read_netcdf
from sloshpy.units import UnitError, parse

_READERS = {".csv": read_csv, ".xlsx": read_xlsx, ".mat": read_mat, ".nc": read_netcdf}


def read_time_history(path: str | os.PathLike[str], column: str, *, time_column: str = "time") -> DecayRecord:
    """Read one column of a time history and its time, in SI.

    Units are declared, never guessed: in the header of CSV and XLSX, "wave [mm]"; in the attribute `units` of
    NetCDF and MAT v7.3; or, in MAT, in a text variable `wave_unit`.

    Args:
        path: .csv, .xlsx, .mat (version 5 or 7.3) or .nc.
        column: the quantity, a length or a force.
        time_column: its time.

    Raises:
        InputError: with every fault found, each with its line or row.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _READERS:
        rule = f"must end in {', '.join(sorted(_READERS))}"
        raise InputError(Problem(key=HISTORY, value=os.fspath(path), rule=rule, cure="name a file of that format"))
    time, found = _READERS[suffix](path, (time_column, column))
    seconds = _factor(time, ("s",), path)[0]
    factor, unit = _factor(found, ("m", "N"), path)
    return DecayRecord(
        time=np.asarray(time.values * seconds),
        value=np.asarray(found.values * factor),
        unit=unit,
        column=column,
        file=os.fspath(path),
        lines=found.lines,
    )


def _factor(column: HistoryColumn, allowed: tuple[str, ...], path: str | os.PathLike[str]) -> tuple[float, str]:
    """Return what a column's numbers are to be multiplied by, and the SI unit that they are then in."""
    name = os.fspath(path)
    what = "time" if allowed == ("s",) else "length or force"

    def refused(rule: str, cure: str) -> InputError:
        key = f"column {column.name}"
        value = f"[{column.unit}]" if column.unit else ""
        return InputError(Problem(key=key, value=value, rule=rule, cure=cure, file=name, line=column.header))

    if not column.unit:
        raise refused("has no unit", column.how_to_declare)
    rules = []
    for unit in allowed:
        try:
            return parse(f"1 {column.unit}", unit), unit
        except UnitError as error:
            rules.append(error.rule)
    unknown = next((rule for rule in rules if "unknown unit" in rule), None)
    raise refused(unknown or f"is no {what}", f"declare its unit: {' or '.join(allowed)}, or another of that kind")
