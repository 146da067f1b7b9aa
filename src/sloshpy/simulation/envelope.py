"""Amplitude and frequency of a settled oscillation, or the reason why there is none."""

import itertools
from dataclasses import dataclass

import numpy as np

from sloshpy.units import Array

CYCLES = 20  # over which the envelope must be level
LEVEL = 1e-3  # relative change of the envelope allowed over ten cycles
SPREAD = 5e-3  # relative spread of the cycles' amplitudes allowed: more is beating of several frequencies
HYSTERESIS = 0.1  # of half the peak-to-peak: ripple on a flat top starts no new swing
REMAINING = 2e-3  # of the amplitude that a slow approach may still be away from its end
REST = 1e-9  # m or rad: an oscillation below this is rest


@dataclass(frozen=True, kw_only=True)
class Envelope:
    """What the last cycles of a signal show.

    amplitude: half the peak-to-peak of the last cycles, in the signal's unit; nan where it has not settled.
    omega: rad/s, likewise. reason: "" where settled, else why not.
    """

    amplitude: float
    omega: float
    reason: str

    @property
    def settled(self) -> bool:
        """Whether the numbers may be read."""
        return not self.reason


def settled_envelope(time: Array, signal: Array) -> Envelope:
    """Measure amplitude and frequency of the last twenty cycles; nan and "unconverged" unless their envelope is level.

    Args:
        time: (T,), s, evenly spaced. signal: (T,), one oscillation about any mean.
    """
    if np.max(np.abs(signal[-len(signal) // 10 :])) < REST:
        return Envelope(amplitude=0.0, omega=np.nan, reason="")
    t_high, high = _peaks(time, signal)
    _, low = _peaks(time, -signal)
    return level_envelope(t_high, high, -low)


def level_envelope(t_high: Array, high: Array, low: Array) -> Envelope:
    """Return the envelope of the last twenty cycles from the times in s and values of maxima and the minima."""
    n = min(len(high), len(low))
    if n < CYCLES + 1:
        return _unconverged(f"only {n} cycles, needs more than {CYCLES}")
    t_high, high, low = t_high[-n:], high[-n:], low[-n:]
    if np.max(np.abs([high, low])) < REST:
        return Envelope(amplitude=0.0, omega=np.nan, reason="")
    half = 0.5 * (high - low)[-CYCLES:]
    if np.any(half <= 0.0):
        return _unconverged("no single oscillation")
    slope = np.polyfit(np.arange(CYCLES), np.log(half), 1)[0]
    if abs(10.0 * slope) > LEVEL:
        return _unconverged(
            f"the envelope changes by {100.0 * np.expm1(10.0 * slope):+.3g} % in ten cycles; run longer"
        )
    if np.ptp(half) > SPREAD * np.mean(half):
        return _unconverged(f"the cycles differ by {100.0 * np.ptp(half) / np.mean(half):.2g} %: several frequencies")
    away = _remaining(half)
    if not away <= REMAINING:
        how = "drifts without slowing down" if np.isinf(away) else f"is still some {100.0 * away:.2g} % from its end"
        return _unconverged(f"the envelope {how}; run longer")
    return Envelope(
        amplitude=float(np.mean(half)),
        omega=float(2.0 * np.pi * CYCLES / (t_high[-1] - t_high[-1 - CYCLES])),
        reason="",
    )


def _remaining(half: Array) -> float:
    """Return how far a geometric approach is from its end, relative; inf where it does not slow down."""
    third = len(half) // 3
    first, second = (np.mean(half[k + third : k + 2 * third]) - np.mean(half[k : k + third]) for k in (0, third))
    size = float(np.mean(half))
    if abs(second) < 5e-5 * size:  # nothing moves but sampling
        return 0.0
    return float(second**2 / abs(first - second) / size) if abs(second) < abs(first) else np.inf


def _unconverged(why: str) -> Envelope:
    return Envelope(amplitude=np.nan, omega=np.nan, reason=f"unconverged: {why}")


def _peaks(time: Array, signal: Array) -> tuple[Array, Array]:
    """Return times and values of one maximum for each swing, through the parabola of three samples.

    A swing runs from one crossing of a band about the middle to the next, so that the flat or rippled top of a limited
    engine counts once.
    """
    tail = signal[len(signal) // 2 :]
    middle, reach = 0.5 * (np.max(tail) + np.min(tail)), 0.5 * np.ptp(tail)
    side = np.where(signal > middle + HYSTERESIS * reach, 1, np.where(signal < middle - HYSTERESIS * reach, -1, 0))
    known = np.flatnonzero(side)
    if len(known) == 0:
        return np.zeros(0), np.zeros(0)
    turns = known[1:][side[known[1:]] != side[known[:-1]]]  # where a swing to the other side begins
    bounds = [*turns, len(signal)]
    tops = [k + int(np.argmax(signal[k:end])) for k, end in itertools.pairwise(bounds) if side[k] > 0]
    tops = [k for k in tops if 0 < k < len(signal) - 1]
    if not tops:
        return np.zeros(0), np.zeros(0)
    k = np.array(tops)
    before, here, after = signal[k - 1], signal[k], signal[k + 1]
    a, b = 0.5 * (before - 2.0 * here + after), 0.5 * (after - before)
    curved = a < 0.0
    safe = np.where(curved, a, -1.0)
    shift = np.where(curved, -b / (2.0 * safe), 0.0)
    return time[k] + shift * (time[1] - time[0]), here - np.where(curved, b**2 / (4.0 * safe), 0.0)
