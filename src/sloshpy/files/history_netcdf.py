"""Time histories in NetCDF, version 4 by h5py and the classic one by SciPy; packed numbers are unpacked."""

import io
import os
from typing import Any

import numpy as np

from sloshpy.errors import InputError
from sloshpy.files.history_columns import HISTORY, LARGEST, HistoryColumn, not_there, refused, same_length, vector
from sloshpy.files.history_hdf5 import dataset, numbers, opened, text_of
from sloshpy.files.text_file import read_bytes
from sloshpy.units import Array

_BROKEN = (ValueError, TypeError, OSError, EOFError, KeyError, IndexError, OverflowError, AssertionError)


def read_netcdf(path: str | os.PathLike[str], names: tuple[str, str]) -> tuple[HistoryColumn, HistoryColumn]:
    """Read two variables of a NetCDF file; a missing value is refused."""
    raw = read_bytes(path, HISTORY, LARGEST)
    if raw.startswith(b"CDF"):
        return same_length(path, _classic(path, raw, names))
    if not raw.startswith(b"\x89HDF"):
        raise refused(path, HISTORY, "", "is no NetCDF file", "save it as NetCDF-4")
    columns = []
    with opened(path) as file:
        for name in names:
            found = dataset(path, file, name)
            columns.append(_column(path, name, numbers(found), dict(found.attrs)))
    return same_length(path, columns)


def _classic(path: str | os.PathLike[str], raw: bytes, names: tuple[str, str]) -> list[HistoryColumn]:
    from scipy.io import netcdf_file  # 0.1 s: only when such a file is read

    try:
        with netcdf_file(io.BytesIO(raw), "r", mmap=False) as file:
            columns = []
            for name in names:
                if name not in file.variables:
                    raise not_there(path, name, list(file.variables))
                found = file.variables[name]
                stored = np.asarray(found.data)
                vector(path, name, stored.shape, stored.dtype.kind, str(stored.dtype))
                keys = ("units", "scale_factor", "add_offset", "_FillValue", "missing_value")
                attributes = {key: getattr(found, key) for key in keys if key in found._attributes}
                columns.append(_column(path, name, np.array(stored, dtype=float).reshape(-1), attributes))
            return columns
    except _BROKEN as error:
        if isinstance(error, InputError):
            raise
        raise refused(path, HISTORY, "", "is truncated or damaged", "copy or save it again") from None


def _column(path: str | os.PathLike[str], name: str, stored: Array, attributes: dict[str, Any]) -> HistoryColumn:
    """Return the numbers unpacked, x = stored * scale_factor + add_offset, by the conventions of NetCDF."""
    for key in ("_FillValue", "missing_value"):
        if key in attributes:
            missing = np.isin(stored, np.asarray(attributes[key], dtype=float))
            if np.any(missing):
                value = f"{np.count_nonzero(missing)} samples, the first is number {int(np.argmax(missing)) + 1}"
                raise refused(path, f"variable {name}", value, "are missing", "fill or cut the gap")
    scale, offset = (
        float(np.asarray(attributes.get(key, usual)).reshape(-1)[0])
        for key, usual in (("scale_factor", 1), ("add_offset", 0))
    )
    return HistoryColumn(
        name=name,
        unit=text_of(attributes.get("units", "")),
        values=stored * scale + offset,
        how_to_declare="give the variable the attribute units",
    )
