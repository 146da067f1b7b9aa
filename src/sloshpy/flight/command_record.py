"""What the engine was told, kept at every step of a simulation: the content of a delay line of changing length.

What reaches the actuator at t left the autopilot at t - tau(t), which never runs backward while d tau / dt < 1.
"""

import bisect
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from sloshpy.errors import OutsideValidity
from sloshpy.flight.trajectory import Phase
from sloshpy.units import Array


def delays(phase: Phase) -> Array:
    """Return the delay at each time of a phase, (T,), s.

    Raises:
        OutsideValidity: a sampler, a delay that overtakes time or is 0 s at some times alone.
    """
    pilot = phase.case.autopilot
    if pilot.sample_time is not None:
        raise OutsideValidity(
            "a flight is not simulated with a sampler: each phase would begin at a sampling instant of its own, with "
            "states of digital filters that no event carries; simulate single times of it"
        )
    tau = np.broadcast_to(np.asarray(pilot.delay, dtype=float), phase.time.shape)
    k = int(np.argmax(np.diff(tau) / np.diff(phase.time)))
    if tau[k + 1] - tau[k] >= phase.time[k + 1] - phase.time[k]:
        raise OutsideValidity(
            f"the delay grows from {tau[k]:g} to {tau[k + 1]:g} s between {phase.time[k]:g} and "
            f"{phase.time[k + 1]:g} s, as fast as time passes: nothing would come out of the line"
        )
    if np.any(tau == 0.0) and np.any(tau > 0.0):
        raise OutsideValidity("the delay is 0 s at some times of a phase and more at others: give it a least value")
    return tau


def emptied_after(phase: Phase, tau: Array, start: float) -> float:
    """Return how long after a start, in s, what was told before it still comes out: T with T = tau(start + T)."""
    edges = np.append(start, phase.time[phase.time > start])
    left = np.array([t - float(np.interp(t, phase.time, tau)) for t in edges]) - start  # when what comes out went in
    if left[-1] <= 0.0:
        return float(np.interp(edges[-1], phase.time, tau))
    k = int(np.argmax(left > 0.0))
    share = -left[k - 1] / (left[k] - left[k - 1])
    return float(edges[k - 1] + share * (edges[k] - edges[k - 1]) - start)


@dataclass
class _Stretch:
    time: list[float] = field(default_factory=list)
    value: list[float] = field(default_factory=list)
    slope: list[float] = field(default_factory=list)

    def at(self, time: float) -> float:
        """Return the cubic through values and slopes of the two steps beside a time."""
        if len(self.time) == 1:
            return self.value[0]
        k = min(max(bisect.bisect_right(self.time, time) - 1, 0), len(self.time) - 2)
        h = self.time[k + 1] - self.time[k]
        x = (time - self.time[k]) / h
        a, b, c, d = self.value[k], h * self.slope[k], self.value[k + 1], h * self.slope[k + 1]
        return a + x * (b + x * (3.0 * (c - a) - 2.0 * b - d + x * (2.0 * (a - c) + b + d)))


class CommandRecord:
    """Commands in rad and their slopes at the times of one stretch after another."""

    def __init__(self, past: Callable[[float], float] | None = None) -> None:
        """Make an empty record; `past` tells the command before the first stretch, by default none."""
        self._past = past
        self._stretches: list[_Stretch] = []

    def begin(self) -> None:
        """Start a stretch; what is in the others is `before` it."""
        self._stretches.append(_Stretch())

    def add(self, time: float, value: float, slope: float) -> None:
        """Keep the command at a step, s, rad and rad/s."""
        now = self._stretches[-1]
        now.time.append(time)
        now.value.append(value)
        now.slope.append(slope)

    def before(self, time: float) -> float:
        """Return the command at a time before the present stretch, s."""
        older = self._stretches[:-1]
        k = bisect.bisect_right([one.time[0] for one in older], time) - 1
        return older[k].at(time) if k >= 0 else 0.0 if self._past is None else self._past(time)

    def within(self, time: float) -> float:
        """Return the command at a time of the present stretch, s."""
        return self._stretches[-1].at(time)
