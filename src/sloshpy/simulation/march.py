"""Adaptive integration of one loop by SciPy's stepping solvers: method of steps, never across a jump or a kink.

Each step ends at the latest where the delay line would have to know the step itself, where something jumps (a
disturbance begins or ends; the first command comes out of the line; both again a few delays later, smoother each
time), and where a slosh velocity changes sign, at which a damper's force has a kink.
"""

import bisect
import contextlib
import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.autopilot import Autopilot
from sloshpy.simulation.model import Model
from sloshpy.units import Array

if TYPE_CHECKING:
    from scipy.integrate import DOP853, RK45

Disturbance = Callable[[float], float]

DIVERGED = 1e3  # m or rad: far beyond any model of this package
ECHOES = 6  # delays after a jump until it is too smooth to matter: each time round it gains an order
NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(8) / 7)  # of a step: the dense output is a polynomial of degree 7 or less
POWERS = np.linalg.inv(np.vander(NODES, increasing=True))  # from values at the nodes to coefficients
EDGE = 1e-9  # of the delay or of a step: what lies nearer to a jump is taken on the side of the step
AT_KINK = 1e-3  # of a step: a sign change nearer to an end of it is the one that the step has been cut at
STABLE = 3.0  # over the fastest pole: where an explicit step of order five or eight is stable
LEAST_RTOL = 1e-13  # SciPy's own share of the present state; the size that a state has had lately counts instead
MOST_STEPS = 5e6  # some minutes


@dataclass(frozen=True, kw_only=True)
class March:
    """States on the mesh, the command that reached the actuator there, and why it ended early, "" where it did not.

    state: (T, size). command: (T,), rad. steps: taken by the solver, kinks found by trial among them.
    """

    state: Array
    command: Array
    stopped: str
    steps: int


class DelayLine:
    """What went in, as one polynomial for each step, comes out after the delay; nothing before the first has passed."""

    def __init__(self, delay: float) -> None:
        """Make an empty line; delay in s."""
        self._delay = delay
        self._begin: list[float] = []
        self._width: list[float] = []
        self._coefficients: list[list[float]] = []

    def fill(self, begin: float, end: float, values: Array) -> None:
        """Take in the values at `NODES` of a step in s."""
        self._begin.append(begin)
        self._width.append(end - begin)
        self._coefficients.append((POWERS @ values).tolist())

    def out(self, time: float) -> float:
        """Return what comes out at a time in s."""
        then = time - self._delay
        k = bisect.bisect_right(self._begin, then) - 1
        if k < 0:
            return 0.0
        x, total = (then - self._begin[k]) / self._width[k], 0.0
        for c in reversed(self._coefficients[k]):
            total = total * x + c
        return total


class SampledLine:
    """A digital autopilot: what is sampled passes its filters and comes out after the delay, held until the next."""

    def __init__(self, autopilot: Autopilot) -> None:
        """Make an empty line of a digital autopilot."""
        assert autopilot.sample_time is not None
        self.period, self._delay = autopilot.sample_time, float(autopilot.delay)
        self._filters = []  # numerator, denominator, states with the newest first
        for f in autopilot.digital_filter:
            top, bottom = np.array(f.numerator) / f.denominator[0], np.array(f.denominator) / f.denominator[0]
            self._filters.append((top, bottom, np.zeros(len(bottom) - 1)))
        self._held: list[float] = []

    def sample(self, value: float) -> None:
        """Take in the value of a sample and hold what the filters make of it."""
        for numerator, denominator, past in self._filters:
            now = value - float(denominator[1:] @ past)
            newest = np.concatenate([[now], past])
            value = float(numerator @ newest[len(newest) - len(numerator) :])
            past[:] = newest[:-1]
        self._held.append(value)

    def out(self, time: float) -> float:
        """Return what is held at a time in s, which must not be that of a change."""
        k = math.floor((time - self._delay) / self.period)
        return self._held[k] if k >= 0 else 0.0


class Marcher:
    """One run: the solver's stretches, the delay line, the mesh filled so far."""

    def __init__(
        self,
        model: Model,
        start: Array,
        mesh: Array,
        autopilot: Autopilot,
        disturbed: tuple[Disturbance, Disturbance],
        longest: float,
        fastest: float,
        rtol: float,
        atol: float,
    ) -> None:
        """Start at 0 s; the arguments are those of `march`."""
        from scipy.integrate import DOP853, RK45  # 0.3 s: only for a run

        delay, period = float(autopilot.delay), autopilot.sample_time
        self._model, self._delay, self._disturbed, self._mesh = model, delay, disturbed, mesh
        self.sampled = None if period is None else SampledLine(autopilot)
        self._line = self.sampled or (DelayLine(delay) if delay else None)
        self._kinks = model.kinks(start)
        # long steps want a high order; where delay or fastest pole keep them short, little work for each
        largest = min(longest, STABLE / fastest, (delay or np.inf) if period is None else period)
        method = RK45 if largest < longest else DOP853
        self._rtol, self._atol, self._size = rtol, atol, np.abs(start)
        self._forget = 0.1 / longest
        options = {"rtol": LEAST_RTOL, "atol": atol, "max_step": largest}
        self._begin = functools.partial(method, self._slope, **options)
        self._low, self._high = 0.0, 0.0  # of the stretch between two jumps
        self._beyond = False  # the damping data, since the last accepted step
        self._usual = period  # step, s
        self.time, self._x, self.steps, self.filled = 0.0, start, 0, 1
        self.states, self.command = np.zeros((len(mesh), model.size)), np.zeros(len(mesh))
        self.states[0] = start

    def _slope(self, time: float, x: Array) -> Array:
        """Return x' at a time in s, on the stretch's own side of the jumps at its ends."""
        t = time if self._low < time < self._high else self._inside(time)
        engine, wind = self._disturbed
        found = self._model.slope(x, self._line.out(t) if self._line is not None else None, engine(t), wind(t))
        if found[0] != found[0] and not np.any(np.isnan(x)):  # by the products of `Model` nan is in every entry
            self._beyond = self._model.outside(x)
        return found

    def sample(self) -> None:
        """Let a digital autopilot take its sample of the present state."""
        if self.sampled is not None:
            wind = np.array([self._disturbed[1](self._inside(self.time))])
            self.sampled.sample(float(self._model.commands(self._x[None], wind)[0]))

    def _inside(self, time: float) -> float:
        return min(max(time, self._low), self._high)

    def stretch(self, end: float) -> str:
        """March to a jump at `end` in s; return why it ended before, "" where it did not."""
        edge = EDGE * min(self._delay or np.inf, end - self.time)
        self._low, self._high = self.time + edge, end - edge
        solver = self._solver(end)
        while True:
            solver.atol = self._atol + self._rtol * self._size
            message = solver.step()
            self.steps += 1
            if solver.status == "failed":
                why = "beyond the damping data" if self._beyond else f"the integrator gave up ({message})"
                return f"{why} at {self.time:.1f} s"
            if self.steps > MOST_STEPS:
                return f"more than {MOST_STEPS:.0e} steps at {self.time:.1f} s"
            kink = self._kink(solver)
            if kink is not None:  # once more, to the kink and no further
                solver = self._solver(kink)
                continue
            self._take(solver)
            if not np.max(np.abs(self._x)) < DIVERGED:
                return f"diverged at {self.time:.1f} s"
            if self.time >= end:
                return ""
            if solver.status == "finished" or self._x is not solver.y:
                solver = self._solver(end)

    def _solver(self, bound: float) -> "RK45 | DOP853":
        """Return a solver from here on; it starts with the step that was usual."""
        first = None if self._usual is None else min(self._usual, bound - self.time)
        return self._begin(self.time, self._x, bound, first_step=first)

    def _kink(self, solver: "RK45 | DOP853") -> float | None:
        """Return where a step first passes a kink, in s and a trifle beyond it; None where it passes none."""
        kinks = self._model.kinks
        passed = [i for i, (a, b) in enumerate(zip(self._kinks, kinks(solver.y), strict=True)) if a * b < 0.0]
        if not passed:
            return None
        from scipy.optimize import brentq  # as SciPy's solvers

        within, old, width = solver.dense_output(), self.time, solver.t - self.time
        near = EDGE * width
        found = [old]
        for i in passed:
            with contextlib.suppress(ValueError):  # at an end of the step, by rounding
                found.append(float(brentq(lambda t, i=i: kinks(within(t))[i], old, solver.t, xtol=near)))
        inner = [t for t in found if AT_KINK * width < t - old < (1.0 - AT_KINK) * width]
        return min(inner) + 2.0 * near if inner else None

    def _take(self, solver: "RK45 | DOP853") -> None:
        """Take a step over: into the delay line, onto the mesh, into the state."""
        old, new = self.time, float(solver.t)
        width = new - old
        last = self.filled + int(np.searchsorted(self._mesh[self.filled :], new - EDGE * width))
        if new >= self._mesh[-1]:
            last = len(self._mesh)
        moments = self._mesh[self.filled : last]
        nodes = old + width * NODES if isinstance(self._line, DelayLine) else NODES[:0]
        if len(nodes) or len(moments):
            within = solver.dense_output()(np.concatenate([nodes, moments])).T
            if isinstance(self._line, DelayLine):
                wind = np.array([self._disturbed[1](self._inside(t)) for t in nodes.tolist()])
                self._line.fill(old, new, self._model.commands(within[: len(nodes)], wind))
            if self._line is not None:
                self.command[self.filled : last] = [self._line.out(self._inside(t)) for t in moments.tolist()]
            self.states[self.filled : last] = within[len(nodes) :]
        self.filled = last
        if solver.status == "running":
            self._usual = width
        self._beyond = False
        self.time, self._x = new, self._model.held(solver.y)
        self._kinks = self._model.kinks(self._x)
        self._size = np.maximum(np.abs(self._x), self._size * math.exp(-width * self._forget))


def march(
    model: Model,
    start: Array,
    mesh: Array,
    autopilot: Autopilot,
    disturbed: tuple[Disturbance, Disturbance],
    jumps: Array,
    longest: float,
    fastest: float,
    rtol: float,
    atol: float,
) -> March:
    """Integrate a loop from its state at 0 s over a mesh of times.

    Args:
        model: the equations. start: (size,). mesh: (T,), s, from 0 on.
        autopilot: its delay and sampling. disturbed: engine command in rad and wind in m/s over time.
        jumps: of the disturbances, s.
        longest: step that sees every sign change, s. fastest: pole, rad/s.
        rtol, atol: error of a step, in parts of what each state has been lately and in its unit.
    """
    marcher = Marcher(model, start, mesh, autopilot, disturbed, longest, fastest, rtol, atol)
    delay, end = float(autopilot.delay), float(mesh[-1])
    samples: Array = np.zeros(0)
    if autopilot.sample_time is not None:
        samples = autopilot.sample_time * np.arange(np.floor(end / autopilot.sample_time) + 1.0)
        ends = np.concatenate([jumps, samples, samples + delay])
    else:
        first = np.append(jumps, 0.0)  # the vehicle is let go
        ends = (first[:, None] + delay * np.arange(ECHOES + 1)).ravel() if delay else first
    ends = np.unique(np.append(ends[(ends > 0.0) & (ends < end)], end))
    if len(samples):  # what rounding has set apart is one
        ends = ends[np.append(np.diff(ends) > EDGE * samples[-1] / len(samples), True)]
    taken, stopped = 0, ""
    for stop in (0.0, *ends.tolist()):
        if stop > 0.0:
            stopped = marcher.stretch(stop)
        if stopped:
            break
        if taken < len(samples) and samples[taken] <= stop * (1.0 + 1e-12) + 1e-12:
            marcher.sample()
            taken += 1
    count = marcher.filled
    return March(state=marcher.states[:count], command=marcher.command[:count], stopped=stopped, steps=marcher.steps)
