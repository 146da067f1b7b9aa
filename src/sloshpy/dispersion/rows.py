"""The numbers of some cases as rows of one table, and what became of each case."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from sloshpy.units import Array


class Status(IntEnum):
    """What became of a case; whatever is not OK counts as worse than every number, and is listed."""

    OK = 0
    FAILED = 1  # refused or raised; its reason is kept
    DIVERGED = 2  # the simulation went beyond every bound
    UNSETTLED = 3  # the simulation ended before a limit cycle could be read
    CRASHED = 4  # its worker died, twice
    TIMEOUT = 5  # it took longer than a case may


@dataclass(frozen=True, kw_only=True)
class Column:
    """One number of a case. worst: -1 where small is bad, +1 where great is, 0 where neither; limit: of the criterion.

    A case breaks the criterion where its number is beyond the limit, to the worst side, or not known. So near the limit
    that rounding or the method's step decides, within `tolerance`, it is marginal: on no sure side, and not met.
    moment: the place in a flight, None for what holds for all of it.
    """

    name: str
    unit: str
    meaning: str
    worst: int = 0
    limit: float | None = None
    tolerance: float = 0.0
    moment: int | None = None


@dataclass(frozen=True, kw_only=True)
class Rows:
    """The cases first, first + 1, ... in order: values (N, columns), status (N,), and a reason for each not OK.

    A value of a case that is OK is never nan; inf says that no number is great enough. Others hold what is known.
    """

    first: int
    values: Array
    status: Array
    reasons: tuple[str, ...]

    @property
    def count(self) -> int:
        """How many cases."""
        return len(self.values)

    def sound(self, first: int, count: int, columns: int) -> bool:
        """Whether these are whole rows of so many cases from one on, of which every OK one has its numbers."""
        shapes = self.values.shape == (count, columns) and self.status.shape == (count,)
        if self.first != first or not shapes or len(self.reasons) != count or self.values.dtype != np.float64:
            return False
        ok = self.status == Status.OK
        told = all((r == "") == bool(good) for r, good in zip(self.reasons, ok, strict=True))
        return told and not np.any(np.isnan(self.values[ok]))


def failed(case: int, columns: int, status: Status, reason: str) -> Rows:
    """Return the row of one case without numbers."""
    values = np.full((1, columns), np.nan)
    return Rows(first=case, values=values, status=np.array([float(status)]), reasons=(reason,))


def joined(parts: list[Rows]) -> Rows:
    """Return rows of neighbouring cases as one table."""
    ends = [p.first + p.count for p in parts]
    if any(end != p.first for end, p in zip(ends, parts[1:], strict=False)):
        raise ValueError("the cases are no neighbours")
    return Rows(
        first=parts[0].first,
        values=np.concatenate([p.values for p in parts]),
        status=np.concatenate([p.status for p in parts]),
        reasons=tuple(reason for p in parts for reason in p.reasons),
    )
