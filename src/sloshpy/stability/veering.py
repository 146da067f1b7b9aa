"""Modes that exchange tanks: where two labels swap, and how near the frequencies come there."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sloshpy.stability.between import NotAlike
from sloshpy.stability.follow import Station, halfway
from sloshpy.units import Array


@dataclass(frozen=True, kw_only=True)
class Veering:
    """Two modes that exchange their tanks between two values of the parameter.

    modes: positions of the branches. tanks: of these at `start`; at `end` the other way round. gap: least distance of
    their frequencies, rad/s, at the parameter `at`.
    """

    modes: tuple[int, int]
    tanks: tuple[str, str]
    start: float
    end: float
    gap: float
    at: float

    @property
    def gap_hz(self) -> float:
        """Least distance of the frequencies in Hz."""
        return self.gap / (2.0 * np.pi)


def exchanges(x: Array, stations: Sequence[Station], label: Sequence[Sequence[str]]) -> tuple[Veering, ...]:
    """Return the pairs of branches whose labels are swapped from one point to the next, tanks both."""
    slosh = {f"{t.name} slosh": t.name for t in stations[0].case.vehicle.tanks}
    found = []
    for p, (before, after) in enumerate(pairwise(label)):
        for i in range(len(before)):
            for k in range(i + 1, len(before)):
                swapped = (before[i], before[k]) == (after[k], after[i]) and before[i] != before[k]
                if swapped and before[i] in slosh and before[k] in slosh:
                    tanks = slosh[before[i]], slosh[before[k]]
                    gap, at = _gap(x, stations, p, tanks)
                    found.append(
                        Veering(modes=(i, k), tanks=tanks, start=float(x[p]), end=float(x[p + 1]), gap=gap, at=at)
                    )
    return tuple(found)


def _gap(x: Array, stations: Sequence[Station], p: int, tanks: tuple[str, str]) -> tuple[float, float]:
    """Return the least distance of two tanks' frequencies in interval p, rad/s, and where; between the cases too."""
    from scipy.optimize import minimize_scalar  # 0.3 s: only where modes veer

    def distance(s: Station) -> float:
        one, other = (s.poles.value[s.poles.tank.index(tank)] for tank in tanks)
        return float(abs(one.imag - other.imag))

    def inside(part: float) -> float:
        return distance(halfway(stations[p], stations[p + 1], part))

    parts = np.linspace(0.0, 1.0, 17)
    values = np.full(len(parts), np.inf)
    values[[0, -1]] = distance(stations[p]), distance(stations[p + 1])
    try:
        values[1:-1] = [inside(float(part)) for part in parts[1:-1]]
        k = int(np.argmin(values))
        ends = float(parts[max(k - 1, 0)]), float(parts[min(k + 1, len(parts) - 1)])
        best = minimize_scalar(inside, bounds=ends, method="bounded", options={"xatol": 1e-7})
        least, part = min((values[k], parts[k]), (best.fun, best.x))
    except NotAlike:  # nothing between: the gap is that of the cases given
        least, part = values[0 if values[0] <= values[-1] else -1], float(values[0] > values[-1])
    return float(least), float(x[p] + part * (x[p + 1] - x[p]))
