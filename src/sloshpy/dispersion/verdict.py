"""The verdict on each case: every criterion that a campaign asks of it, taken together."""

import numpy as np

from sloshpy.dispersion.rows import Column
from sloshpy.dispersion.statements import marginal, violates
from sloshpy.units import Array

VERDICT = Column(
    name="verdict",
    unit="1",
    meaning="1 meets every criterion, 0 on no sure side of one, -1 breaks one",
    worst=-1,
    limit=1,
)


def verdicts(columns: tuple[Column, ...], values: Array) -> Array:
    """Return the verdict on each row (N, columns before it): 1 pass, 0 marginal, -1 fail; nan where a number lacks.

    A case that surely breaks one criterion fails, however near it is to the limit of another.
    """
    found = np.ones(len(values))
    for k, c in enumerate(columns):
        if c.limit is not None:
            near = marginal(values[:, k], c.limit, c.tolerance)
            broken = violates(values[:, k], c.worst, c.limit, c.tolerance) & ~near
            found = np.where(broken, -1.0, np.where(near, np.minimum(found, 0.0), found))
            found = np.where(np.isnan(values[:, k]), np.nan, found)
    return found
