"""Fill histories: a table of fills in, the table of their slosh masses out."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sloshpy.errors import InputError, Problem
from sloshpy.files.tables import Kind, Row, TableColumn, read_columns
from sloshpy.files.write import write_whole
from sloshpy.tank import Fill, FillHistory, Tank
from sloshpy.units import Array

FILLS = Kind(
    what="fill history",
    columns={"time": "s", "fill": "1", "depth": "m", "acceleration": "m/s^2"},
    cure='write the header "time [s], fill [%], acceleration [m/s^2]", or depth [m] in place of fill',
    optional=frozenset({"time", "fill", "depth", "acceleration"}),
    declared=frozenset({"fill"}),
)
_ROUNDING = 1e-9  # of the tank's height: a depth that is the height but for its last digits is a full tank
_SHOWN = 50  # faults told at once


@dataclass(frozen=True, kw_only=True)
class FillTable:
    """The rows of a fill history: fills, acceleration in m/s^2 and time in s, None where the table has none."""

    fill: tuple[str | float | Fill, ...]
    acceleration: Array | None
    time: Array | None


def read_fill_table(path: str | os.PathLike[str], tank: Tank | None = None) -> FillTable:
    """Read a CSV with the column fill [%] or depth [m] and, where they change, acceleration and time.

    A fill is 0 to 100 %, both ends included, a depth 0 m to the tank's height where the tank is given, an acceleration
    above 0 m/s^2. An empty and a full tank are no faults: `slosh_masses_history` says of such a row that it has no
    slosh masses.

    Raises:
        InputError: with every fault of the table, each with its line.
    """
    columns, rows, numbers = read_columns(path, FILLS)
    name, line = os.fspath(path), rows[0].line

    def refused(rule: str, cure: str = FILLS.cure, line: int | None = line) -> InputError:
        return InputError(Problem(key=FILLS.what, value="", rule=rule, cure=cure, file=name, line=line))

    if ("fill" in numbers) == ("depth" in numbers):
        raise refused("has not one of the columns fill and depth")
    short = [column.name for column in columns if len(numbers[column.name]) < len(rows) - 1]
    if short:
        raise refused(f"has blank cells in {short[0]}", "fill the cells, drop the rows, or leave the column out")
    time = np.array(numbers["time"]) if "time" in numbers else None
    if time is not None and np.any(np.diff(time) <= 0.0):
        k = 1 + int(np.argmax(np.diff(time) <= 0.0))
        rule = f"has times that do not increase: {time[k]:.10g} s follows {time[k - 1]:.10g} s"
        raise refused(rule, "sort the rows by time and drop those given twice", rows[1 + k].line)
    outside = _outside(columns, rows, numbers, tank, name)
    if outside:
        raise InputError(*outside[:_SHOWN])
    fill: list[str | float | Fill] = [*numbers.get("depth", [])]
    fill += [f"{100.0 * part!r} %" for part in numbers.get("fill", [])]
    return FillTable(
        fill=tuple(fill),
        acceleration=np.array(numbers["acceleration"]) if "acceleration" in numbers else None,
        time=time,
    )


def _outside(
    columns: list[TableColumn], rows: list[Row], numbers: dict[str, list[float]], tank: Tank | None, file: str
) -> list[Problem]:
    """Return what no tank can have, in file order."""
    height = np.inf if tank is None else tank.height
    most = "" if tank is None else f" and <= {height:.6g} m, the height of the tank"
    acceleration = "drop the row: the model is of a liquid held down by acceleration; in coast it has no meaning"
    ranges: dict[str, tuple[float, str, str]] = {
        "fill": (1.0, "must be >= 0 % and <= 100 % of the volume", "half is 50 under fill [%] and 0.5 under fill [1]"),
        "depth": (
            height * (1.0 + _ROUNDING),
            f"must be >= 0 m{most}",
            "check the unit; it counts from the bottom",
        ),
        "acceleration": (np.inf, "must be > 0 m/s^2", acceleration),
    }
    found = []
    for k, row in enumerate(rows[1:]):
        for at, column in enumerate(columns):
            if column.name not in ranges:
                continue
            largest, rule, cure = ranges[column.name]
            value = numbers[column.name][k]
            if 0.0 <= value <= largest and (value > 0.0 or column.name != "acceleration"):
                continue
            unit = column.unit or "1"
            written = f"{row.cells[at]} [{unit}]"
            key = f"column {column.name}"
            found.append(Problem(key=key, value=written, rule=rule, cure=cure, file=file, line=row.line))
    return found


def write_fill_history(found: FillHistory, path: str | os.PathLike[str]) -> Path:
    """Write a fill history as a table, .csv or .xlsx with units in the header, or as NetCDF, .nc.

    Raises:
        InputError: another suffix, a folder that is not there, or a missing XLSX writer.
    """
    path = Path(path)
    dataset = found.to_dataset()
    if path.suffix.lower() == ".nc":
        try:
            dataset.to_netcdf(path, engine="h5netcdf")
        except OSError as error:
            raise _refused(path, f"cannot be written ({error.strerror})", "check the folder") from None
        return path
    import pandas as pd  # 1 s: only when a table is written

    columns: dict[str, Any] = {}
    if "time" in dataset.coords:
        columns["time [s]"] = dataset["time"].values
    for name, values in dataset.data_vars.items():
        unit = values.attrs.get("units")
        head = f"{name} [{unit}]" if unit else str(name)
        if values.ndim == 1:
            columns[head] = values.values
        else:
            columns |= {head.replace(str(name), f"{name}_{n + 1}"): values.values[:, n] for n in range(values.shape[1])}
    frame = pd.DataFrame(columns)
    if path.suffix.lower() == ".csv":
        write_whole(path, frame.to_csv(index=False).encode())
    elif path.suffix.lower() == ".xlsx":
        try:
            frame.to_excel(path, index=False)
        except ImportError:
            raise _refused(
                path, "needs openpyxl, which is not installed", "pip install openpyxl, or write CSV"
            ) from None
        except OSError as error:
            raise _refused(path, f"cannot be written ({error.strerror})", "check the folder") from None
    else:
        raise _refused(path, "must end in .csv, .xlsx or .nc", "name a file of that format")
    return path


def _refused(path: Path, rule: str, cure: str) -> InputError:
    return InputError(Problem(key="table", value=str(path), rule=rule, cure=cure))
