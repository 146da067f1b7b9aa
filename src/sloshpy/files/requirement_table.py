"""A damping requirement as a table to hand on: CSV, XLSX or NetCDF, criterion and assumptions in it."""

import io
import os
from pathlib import Path

from sloshpy.errors import InputError, Problem
from sloshpy.files.write import write_whole
from sloshpy.flight import DampingRequirement


def write_requirement(found: DampingRequirement, path: str | os.PathLike[str]) -> Path:
    """Write a damping requirement: .csv with what it rests on in comments, .xlsx on a second sheet, .nc as attributes.

    Raises:
        InputError: another suffix, or a folder that is not there.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in {".csv", ".xlsx", ".nc"}:
        raise InputError(
            Problem(
                key="table", value=str(path), rule="must end in .csv, .xlsx or .nc", cure="name a file of that format"
            )
        )
    head = [f"damping required of {found.tank}, {found.flight}", f"criterion: {found.criterion}", *found.assumptions]
    stream = io.BytesIO()
    if suffix == ".nc":
        found.to_dataset().to_netcdf(stream, engine="h5netcdf")
    else:
        import pandas as pd  # 1 s: only when a table is written

        frame = pd.DataFrame(found.columns())
        if suffix == ".csv":
            text = "".join(f"# {line}\n" for line in head)
            stream.write((text + frame.to_csv(index=False, na_rep="nan")).encode())
        else:
            with pd.ExcelWriter(stream) as book:
                frame.to_excel(book, sheet_name="requirement", index=False, na_rep="nan")
                pd.DataFrame({"criterion and assumptions": head}).to_excel(book, sheet_name="basis", index=False)
    write_whole(path, stream.getvalue())
    return path
