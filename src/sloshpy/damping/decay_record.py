"""A record of one free decay: what was measured, when, in which SI unit, and where it stands in its file."""

import os
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sloshpy.errors import InputError, Problem
from sloshpy.units import Array, IntArray

Measured = Literal["displacement", "wave", "force"]
UNIT_OF: dict[str, str] = {"displacement": "m", "wave": "m", "force": "N"}
MOST_SAMPLES = 100_000  # of one decay: 100 cycles of 1000 samples each


@dataclass(frozen=True, kw_only=True)
class DecayRecord:
    """A time history of one column, in SI.

    time: s, increasing, (n,). value: of the column, (n,), in `unit`, "m" or "N". lines: the line or row of each sample
    in the file, (n,), None where it has none.
    """

    time: Array
    value: Array
    unit: str
    column: str = "record"
    file: str = ""
    lines: IntArray | None = None

    def __post_init__(self) -> None:
        if self.time.ndim != 1 or self.time.shape != self.value.shape:
            shapes = f"{self.time.shape} and {self.value.shape}"
            raise self.refused(
                f"time and value have the shapes {shapes}", "must be two equal columns", "give one column"
            )
        if self.unit not in set(UNIT_OF.values()):
            raise self.refused(f"[{self.unit}]", "must be in m or N", "convert it")
        for name, numbers in (("time", self.time), (self.column, self.value)):
            bad = ~np.isfinite(numbers)
            if np.any(bad):
                k = int(np.argmax(bad))
                raise self.refused(f"{numbers[k]}", "must be finite", "mend or drop the sample", k, name)
        late = np.diff(self.time) <= 0.0
        if np.any(late):
            k = int(np.argmax(late)) + 1
            what = f"{self.time[k]:.10g} s follows {self.time[k - 1]:.10g} s"
            raise self.refused(what, "must increase", "sort the rows and drop those given twice", k, "time")

    def refused(self, value: str, rule: str, cure: str, sample: int | None = None, key: str = "") -> InputError:
        """Return the error of this record in the one form, at the line of a sample where one is to blame."""
        line = None if sample is None or self.lines is None else int(self.lines[sample])
        key = f"column {key or self.column}"
        return InputError(Problem(key=key, value=value, rule=rule, cure=cure, file=os.fspath(self.file), line=line))

    def between(self, start: float | None, end: float | None) -> "DecayRecord":
        """Return the part from `start` to `end`, both in s of the record's own time; None leaves an end as it is."""
        low, high = self.time[0] if start is None else start, self.time[-1] if end is None else end
        kept = (self.time >= low) & (self.time <= high)
        if np.count_nonzero(kept) < 2:
            span = f"{self.time[0]:.6g} to {self.time[-1]:.6g} s"
            raise self.refused(f"{low:.6g} to {high:.6g} s", f"leaves no samples of {span}", "name times in the record")
        return DecayRecord(
            time=self.time[kept],
            value=self.value[kept],
            unit=self.unit,
            column=self.column,
            file=self.file,
            lines=None if self.lines is None else self.lines[kept],
        )
