"""What every reader of time histories hands over, and what it refuses."""

import os
from dataclasses import dataclass

import numpy as np

from sloshpy.errors import InputError, Problem
from sloshpy.files.wording import nearest
from sloshpy.units import Array, IntArray

HISTORY = "time history"
MOST_SAMPLES = 1_000_000
LARGEST = 200_000_000  # bytes: a million rows of ten columns


@dataclass(frozen=True, kw_only=True)
class HistoryColumn:
    """One column as it stands in its file: its numbers in the declared unit, "" where none is declared.

    lines: the line or row of each number, None where the file has none; header: that of the name.
    """

    name: str
    unit: str
    values: Array
    how_to_declare: str
    lines: IntArray | None = None
    header: int | None = None


def refused(
    path: str | os.PathLike[str], key: str, value: str, rule: str, cure: str, line: int | None = None
) -> InputError:
    """Return the error of one place in a time history."""
    return InputError(Problem(key=key, value=value, rule=rule, cure=cure, file=os.fspath(path), line=line))


def not_there(path: str | os.PathLike[str], name: str, names: list[str], line: int | None = None) -> InputError:
    """Return the error of a column that the file does not have."""
    return refused(path, "column", name, "is not in the file", nearest(name, names[:20]), line)


def vector(path: str | os.PathLike[str], name: str, shape: tuple[int, ...], kind: str, dtype: str) -> int:
    """Return the length of an array by its description, before it is read; refuse what is no column of real numbers."""
    key = f"variable {name}"
    if kind not in "iuf":
        raise refused(path, key, dtype, "must hold real numbers", "store it as float64")
    count = int(np.prod(shape, dtype=float)) if shape else 0
    if not shape or max(shape) != count:
        raise refused(
            path, key, f"shape {'x'.join(map(str, shape))}", "must be one column", "store one quantity a variable"
        )
    if count > MOST_SAMPLES:
        raise refused(path, key, f"{count} samples", f"are more than {MOST_SAMPLES}", "thin it out or cut it")
    if count < 2:
        raise refused(path, key, f"{count} samples", "are too few", "name another variable")
    return count


def same_length(path: str | os.PathLike[str], columns: list[HistoryColumn]) -> tuple[HistoryColumn, HistoryColumn]:
    """Return time and quantity, which must have equal lengths."""
    time, found = columns
    if len(time.values) != len(found.values):
        value = f"{len(found.values)} samples"
        rule = f"must be as many as the {len(time.values)} of {time.name}"
        raise refused(
            path, f"variable {found.name}", value, rule, "name the time that belongs to it with --time-column"
        )
    return time, found
