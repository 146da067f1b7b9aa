"""One dataset of an HDF5 file, as MAT v7.3 and NetCDF-4 are: looked at before it is read."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from sloshpy.files.history_columns import HISTORY, not_there, refused, vector
from sloshpy.units import Array

_NOT_OPENED = (OSError, RuntimeError, ValueError, KeyError, TypeError)


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[Any]:
    """Open an HDF5 file for reading; what HDF5 says of a broken one becomes the one error form."""
    import h5py  # 0.1 s: only when such a file is read

    try:
        with h5py.File(path, "r") as file:
            yield file
    except _NOT_OPENED as error:
        if type(error).__name__ == "InputError":
            raise
        why = str(error).split("(")[-1].rstrip(")")[:80]
        raise refused(path, HISTORY, "", f"is truncated or damaged ({why})", "copy or save it again") from None


def dataset(path: str | os.PathLike[str], file: Any, name: str) -> Any:
    """Return a dataset by its name, which must be real numbers of this file, all of them written."""
    import h5py  # as above

    if name not in file or "/" in name:
        raise not_there(path, name, [key for key in file if isinstance(key, str) and not key.startswith("#")])
    if not isinstance(file.get(name, getlink=True), h5py.HardLink):
        raise refused(path, f"variable {name}", "", "is a link", "store the numbers in the file itself")
    found = file[name]
    if not isinstance(found, h5py.Dataset):
        raise refused(
            path, f"variable {name}", type(found).__name__.lower(), "must hold real numbers", "name a variable"
        )
    if found.external or found.is_virtual:
        raise refused(path, f"variable {name}", "", "is stored in another file", "store the numbers in the file itself")
    count = vector(path, name, found.shape or (), found.dtype.kind, str(found.dtype))
    if found.id.get_storage_size() == 0:
        raise refused(path, f"variable {name}", f"{count} samples", "were never written", "write it again")
    if found.chunks is not None:
        wanted = int(np.prod([-(-n // c) for n, c in zip(found.shape, found.chunks, strict=True)]))
        missing = wanted - found.id.get_num_chunks()
        if missing > 0:
            rule = f"has {missing} of {wanted} parts that were never written"
            raise refused(path, f"variable {name}", "", rule, "write it again")
    return found


def letters(path: str | os.PathLike[str], file: Any, name: str) -> str:
    """Return a text that MATLAB stores as codes of letters, "" where there is none."""
    import h5py  # as above

    found = file[name] if isinstance(file.get(name, getlink=True), h5py.HardLink) else None
    if not isinstance(found, h5py.Dataset) or found.dtype.kind != "u" or not 0 < found.size <= 40:
        return ""
    return "".join(chr(int(code)) for code in np.asarray(found[()]).reshape(-1)).strip()


def numbers(found: Any) -> Array:
    """Return the numbers of a dataset as one column."""
    return np.asarray(found[()], dtype=float).reshape(-1)


def text_of(value: Any) -> str:
    """Return an attribute as text, "" where it is none."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(-1)[0]
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace").strip()
    return str(value).strip() if isinstance(value, str) else ""
