"""Disturbances over time: steps, pulses, 1-cosine gusts, tables and band-limited noise.

A signal is a value that answers `signal(time)`, in the unit of what it disturbs: rad for the engine command, m/s for
the lateral wind. Nothing is random but the phases of `Noise`, which come from its seed.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from sloshpy.units import Array, Real


class Signal(Protocol):
    """What a simulation asks of a disturbance."""

    @property
    def jumps(self) -> Array:
        """Times in s at which the signal or its slope jumps."""

    def __call__(self, time: Real) -> Array:
        """Return the signal at times in s, any shape."""


@dataclass(frozen=True, kw_only=True)
class Step:
    """A jump to `size` at `start` in s."""

    size: float
    start: float = 0.0

    @property
    def jumps(self) -> Array:
        return np.array([self.start])

    def __call__(self, time: Real) -> Array:
        return np.where(np.asarray(time) >= self.start, self.size, 0.0)


@dataclass(frozen=True, kw_only=True)
class Pulse:
    """`size` for `duration` from `start` on, both in s."""

    size: float
    duration: float
    start: float = 0.0

    @property
    def jumps(self) -> Array:
        return np.array([self.start, self.start + self.duration])

    def __call__(self, time: Real) -> Array:
        t = np.asarray(time) - self.start
        return np.where((t >= 0.0) & (t < self.duration), self.size, 0.0)


@dataclass(frozen=True, kw_only=True)
class OneMinusCosine:
    """The discrete gust: (1 - cos(2 pi t / duration)) / 2 of its peak `size`, from `start` on, both in s.

    Arrays where `simulate_ensemble` is given one for each run.
    """

    size: Real
    duration: Real
    start: Real = 0.0

    @property
    def jumps(self) -> Array:
        return np.array([self.start, np.asarray(self.start) + self.duration], dtype=float)

    def __call__(self, time: Real) -> Array:
        t = (np.asarray(time, dtype=float) - self.start) / self.duration
        return np.where((t > 0.0) & (t < 1.0), 0.5 * self.size * (1.0 - np.cos(2.0 * np.pi * t)), 0.0)


@dataclass(frozen=True, kw_only=True)
class Samples:
    """A table, linear between its rows and zero outside them. time: (K,), s, increasing. value: (K,)."""

    time: Array
    value: Array

    def __post_init__(self) -> None:
        if np.shape(self.time) != np.shape(self.value) or np.ndim(self.time) != 1 or len(self.time) < 2:
            raise ValueError("a table of a disturbance has two columns of at least two rows")
        if not (np.all(np.diff(self.time) > 0.0) and np.all(np.isfinite(self.value))):
            raise ValueError("the times of a disturbance must increase and its values be finite")

    @property
    def jumps(self) -> Array:
        return np.array(self.time, dtype=float)

    def __call__(self, time: Real) -> Array:
        return np.asarray(np.interp(time, self.time, self.value, left=0.0, right=0.0))


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Gaussian noise of even power between two frequencies: many sinusoids of random phase.

    rms: in the unit of what it disturbs. low, high: rad/s. seed: of the phases. lines: their number; the signal repeats
    after 2 pi lines / (high - low) s, and `simulate` refuses a longer run.
    """

    rms: float
    low: float
    high: float
    seed: int = 0
    lines: int = 2000
    _phase: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not (self.rms > 0.0 and 0.0 < self.low < self.high):
            raise ValueError("noise needs rms > 0 and 0 < low < high in rad/s")
        phase = np.random.default_rng(self.seed).uniform(0.0, 2.0 * np.pi, self.lines)
        object.__setattr__(self, "_phase", phase)

    @property
    def period(self) -> float:
        """Time in s after which the signal repeats."""
        return 2.0 * np.pi * self.lines / (self.high - self.low)

    @property
    def density(self) -> float:
        """One-sided power spectral density, unit^2 s/rad."""
        return self.rms**2 / (self.high - self.low)

    def until(self, end: float) -> Callable[[float], float]:
        """Return the signal from 0 to `end` in s for one time at a time: its spline through ten samples a radian.

        (1/10)^4 5/384 = 1.3e-6 of the fastest line, and a thousandth of the work of its sum.
        """
        from scipy.interpolate import CubicSpline  # 0.3 s: only for noise

        step = 0.1 / self.high
        time = step * np.arange(int(np.ceil(end / step)) + 2, dtype=float)
        cubics: list[list[float]] = CubicSpline(time, self(time)).c.T.tolist()

        def at(t: float) -> float:
            k = int(t / step)
            (a, b, c, d), x = cubics[k], t - k * step
            return d + x * (c + x * (b + x * a))

        return at

    @property
    def jumps(self) -> Array:
        return np.array([], dtype=float)

    def __call__(self, time: Real) -> Array:
        t = np.asarray(time, dtype=float)
        step = (self.high - self.low) / self.lines
        omega = self.low + step * (np.arange(self.lines) + 0.5)
        total = np.zeros(t.shape)
        flat, out = t.reshape(-1), total.reshape(-1)
        for k in range(0, len(flat), 4096):  # bounds the memory
            out[k : k + 4096] = np.cos(flat[k : k + 4096, None] * omega + self._phase).sum(axis=-1)
        return np.asarray(self.rms * np.sqrt(2.0 / self.lines) * total)
