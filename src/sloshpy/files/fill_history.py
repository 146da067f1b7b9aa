"""Fill histories: a table of fills in, the table of their slosh masses out."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sloshpy.errors import InputError, Problem
from sloshpy.files.tables import Kind, read_columns
from sloshpy.files.write import write_whole
from sloshpy.tank import Fill, FillHistory
from sloshpy.units import Array

FILLS = Kind(
    what="fill history",
    columns={"time": "s", "fill": "1", "depth": "m", "acceleration": "m/s^2"},
    cure='write the header "time [s], fill [%], acceleration [m/s^2]", or depth [m] in place of fill',
    optional=frozenset({"time", "fill", "depth", "acceleration"}),
    declared=frozenset({"fill"}),
)


@dataclass(frozen=True, kw_only=True)
class FillTable:
    """The rows of a fill history: fills, acceleration in m/s^2 and time in s, None where the table has none."""

    fill: tuple[str | float | Fill, ...]
    acceleration: Array | None
    time: Array | None


def read_fill_table(path: str | os.PathLike[str]) -> FillTable:
    """Read a CSV with the column fill [%] or depth [m] and, where they change, acceleration and time.

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
    fill: list[str | float | Fill] = [*numbers.get("depth", [])]
    fill += [f"{100.0 * part!r} %" for part in numbers.get("fill", [])]
    return FillTable(
        fill=tuple(fill),
        acceleration=np.array(numbers["acceleration"]) if "acceleration" in numbers else None,
        time=time,
    )


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
