"""Time history of a flight, and where its slosh peaks."""

from dataclasses import dataclass

import numpy as np

from sloshpy.flight.trajectory import Phase
from sloshpy.units import Array


@dataclass(frozen=True, kw_only=True)
class FlightHistory:
    """Slosh and engine angle along one phase or several.

    time: (S,), s. slosh: (S, n_tanks), m. tvc: (S,), rad. step: s, the longest. stopped: why it ended early, "" where
    it did not.
    """

    phases: tuple[Phase, ...]
    time: Array
    slosh: Array
    tvc: Array
    step: float
    stopped: str

    def peaks(self, tank: int) -> tuple[Array, Array]:
        """Return times in s and sizes in m of the extremes of a tank's slosh, each by the parabola through three."""
        t, z = self.time, np.abs(self.slosh[:, tank])
        k = np.flatnonzero((z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])) + 1
        first, second = (z[k] - z[k - 1]) / (t[k] - t[k - 1]), (z[k + 1] - z[k]) / (t[k + 1] - t[k])
        bend = (second - first) / (t[k + 1] - t[k - 1])
        top = 0.5 * (t[k - 1] + t[k]) - 0.5 * first / bend
        return top, z[k - 1] + first * (top - t[k - 1]) + bend * (top - t[k - 1]) * (top - t[k])
