"""Time histories in MAT files, version 5 by SciPy and version 7.3 by h5py; units in a text variable NAME_unit."""

import io
import os
import struct
import zlib

import numpy as np

from sloshpy.errors import InputError
from sloshpy.files.history_columns import HISTORY, LARGEST, HistoryColumn, not_there, refused, same_length, vector
from sloshpy.files.history_hdf5 import dataset, letters, numbers, opened, text_of
from sloshpy.files.text_file import read_bytes

_KINDS = {f"{sign}int{bits}": "i" for sign in ("", "u") for bits in (8, 16, 32, 64)} | {"double": "f", "single": "f"}
_BROKEN = (ValueError, TypeError, OSError, EOFError, KeyError, IndexError, OverflowError, zlib.error, struct.error)


def read_mat(path: str | os.PathLike[str], names: tuple[str, str]) -> tuple[HistoryColumn, HistoryColumn]:
    """Read two variables of a MAT file."""
    raw = read_bytes(path, HISTORY, LARGEST)
    if raw.startswith(b"MATLAB 7.3"):
        return _version_7_3(path, names)
    if not raw.startswith(b"MATLAB 5.0"):
        raise refused(path, HISTORY, "", "is no MAT-file of version 5 or 7.3", "save it with -v7 or -v7.3")
    return _version_5(path, raw, names)


def _version_5(path: str | os.PathLike[str], raw: bytes, names: tuple[str, str]) -> tuple[HistoryColumn, HistoryColumn]:
    from scipy.io import loadmat, whosmat  # 0.1 s: only when such a file is read

    try:
        listed = {name: (shape, kind) for name, shape, kind in whosmat(io.BytesIO(raw))}
        for name in names:
            if name not in listed:
                raise not_there(path, name, list(listed))
            shape, kind = listed[name]
            vector(path, name, shape, _KINDS.get(kind, "O"), kind)
        units = [f"{name}_unit" for name in names if listed.get(f"{name}_unit", ((), ""))[1] == "char"]
        found = loadmat(io.BytesIO(raw), variable_names=[*names, *units])
    except _BROKEN as error:
        if isinstance(error, InputError):
            raise
        raise refused(path, HISTORY, "", "is truncated or damaged", "copy or save it again") from None
    for name in names:
        vector(path, name, found[name].shape, found[name].dtype.kind, str(found[name].dtype))
    columns = [
        HistoryColumn(
            name=name,
            unit=text_of(found.get(f"{name}_unit", "")),
            values=np.asarray(found[name], dtype=float).reshape(-1),
            how_to_declare=_how(name, n),
        )
        for n, name in enumerate(names)
    ]
    return same_length(path, columns)


def _version_7_3(path: str | os.PathLike[str], names: tuple[str, str]) -> tuple[HistoryColumn, HistoryColumn]:
    columns = []
    with opened(path) as file:
        for n, name in enumerate(names):
            found = dataset(path, file, name)
            if found.attrs.get("MATLAB_class", b"double") in {b"char", b"logical", b"function_handle"}:
                kind = text_of(found.attrs["MATLAB_class"])
                raise refused(path, f"variable {name}", kind, "must hold real numbers", "store it as double")
            unit = text_of(found.attrs.get("units", ""))
            if not unit:
                unit = letters(path, file, f"{name}_unit")
            columns.append(HistoryColumn(name=name, unit=unit, values=numbers(found), how_to_declare=_how(name, n)))
    return same_length(path, columns)


def _how(name: str, place: int) -> str:
    return f"store {name}_unit = '{'s' if place == 0 else 'mm'}' beside it"
