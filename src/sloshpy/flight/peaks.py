"""How great a signal gets along a flight: over all of it, about each time of a phase, and in its last swing."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sloshpy.flight.trajectory import Phase
from sloshpy.units import Array


@dataclass(frozen=True, kw_only=True)
class Course:
    """A signal at its steps and at the extremes between them. time: (P,), s, in order. value: (P,)."""

    time: Array
    value: Array

    @classmethod
    def of(cls, time: Array, signal: Array) -> "Course":
        """Return steps (S,) with each extreme between them, by the parabola through three."""
        t, y = time, signal
        first, second = np.diff(y)[:-1], np.diff(y)[1:]
        k = np.flatnonzero(first * second < 0.0) + 1
        first, second = (y[k] - y[k - 1]) / (t[k] - t[k - 1]), (y[k + 1] - y[k]) / (t[k + 1] - t[k])
        bend = (second - first) / (t[k + 1] - t[k - 1])
        top = 0.5 * (t[k - 1] + t[k]) - 0.5 * first / bend
        peak = y[k - 1] + first * (top - t[k - 1]) + bend * (top - t[k - 1]) * (top - t[k])
        whole, values = np.concatenate([t, top]), np.concatenate([y, peak])
        order = np.argsort(whole, kind="stable")
        return cls(time=whole[order], value=values[order])

    def greatest(self) -> tuple[float, float]:
        """Return the greatest magnitude and its time in s."""
        k = int(np.argmax(np.abs(self.value)))
        return float(np.abs(self.value[k])), float(self.time[k])

    def about(self, phase: Phase) -> Array:
        """Return the greatest magnitude nearer to each time of a phase than to its others, (T,).

        nan where the signal ends before that stretch of time does.
        """
        t = phase.time
        found, edges = np.full(len(t), np.nan), 0.5 * (t[:-1] + t[1:])
        inside = (self.time >= t[0]) & (self.time <= t[-1])
        np.fmax.at(found, np.searchsorted(edges, self.time[inside], side="right"), np.abs(self.value[inside]))
        # at both ends of each stretch too, and at its time: a step may be longer, or the signal rise there
        ends, middle = (np.abs(np.interp(at, self.time, self.value)) for at in (edges, t))
        found = np.fmax(np.fmax(found, middle), np.fmax(np.append(ends, middle[-1]), np.append(middle[0], ends)))
        return np.where(np.append(edges, t[-1]) <= self.time[-1], found, np.nan)

    def amplitude(self, period: float) -> float:
        """Return half peak to peak over the last period in s."""
        last = self.value[self.time >= self.time[-1] - period]
        return float(0.5 * (np.max(last) - np.min(last)))


def stretches(phases: Sequence[Phase], carries: Sequence[bool]) -> tuple[tuple[Phase, ...], ...]:
    """Return the phases in runs between which nothing is carried; carries: of each event, whether it is crossed."""
    found: list[list[Phase]] = [[phases[0]]]
    for phase, over in zip(phases[1:], carries, strict=True):
        if over:
            found[-1].append(phase)
        else:
            found.append([phase])
    return tuple(tuple(run) for run in found)
