"""Amplitude and frequency of a settled oscillation, or the reason why there is none."""

import itertools
from dataclasses import dataclass

import numpy as np

from sloshpy.units import Array, IntArray

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


@dataclass(frozen=True, kw_only=True)
class Envelopes:
    """The envelopes of many signals, (N,) each; see `Envelope`."""

    amplitude: Array
    omega: Array
    reason: tuple[str, ...]


def level_envelope(t_high: Array, high: Array, low: Array) -> Envelope:
    """Return the envelope of the last twenty cycles from the times in s and values of maxima and the minima."""
    n = min(len(high), len(low))
    found = level_envelopes(_filled(t_high, n), _filled(high, n), _filled(low, n), np.array([n]))
    return Envelope(amplitude=float(found.amplitude[0]), omega=float(found.omega[0]), reason=found.reason[0])


def _filled(x: Array, n: int) -> Array:
    """Return the last of n values as one row of twenty-one, zeros before where there are fewer."""
    last = x[len(x) - min(n, CYCLES + 1) :]
    return np.concatenate([np.zeros(CYCLES + 1 - len(last)), last])[None]


def level_envelopes(t_high: Array, high: Array, low: Array, count: IntArray) -> Envelopes:
    """Return the envelopes of many signals from their last twenty-one maxima and minima, the oldest first.

    Args:
        t_high, high, low: (N, 21), times in s and values of the maxima, values of the minima.
        count: (N,), how many of both there have been.
    """
    half = 0.5 * (high - low)[:, 1:]
    least = np.min(half, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):  # what is no oscillation is sorted out by its reason
        middle = np.arange(CYCLES) - 0.5 * (CYCLES - 1)
        slope = _total(np.log(half) * (middle / np.sum(middle**2)))  # of the straight line through the logarithms
        mean = _total(half) / CYCLES
        spread = (np.max(half, axis=1) - least) / mean
        away = _remaining(half, mean)
        omega = 2.0 * np.pi * CYCLES / (t_high[:, -1] - t_high[:, 0])
    few = count < CYCLES + 1
    rest = ~few & (np.max(np.abs(high), axis=1) < REST) & (np.max(np.abs(low), axis=1) < REST)
    moving = ~few & ~rest
    faults = (
        (few, lambda k: f"only {count[k]} cycles, needs more than {CYCLES}"),
        (moving & ~(least > 0.0), lambda k: "no single oscillation"),
        (
            moving & ~(np.abs(10.0 * slope) <= LEVEL),
            lambda k: f"the envelope {_how_fast(10.0 * float(slope[k]))} in ten cycles; run longer",
        ),
        (
            moving & ~(spread <= SPREAD),
            lambda k: f"the cycles differ by {100.0 * spread[k]:.2g} %: several frequencies",
        ),
        (moving & ~(away <= REMAINING), lambda k: f"the envelope {_how_far(float(away[k]))}; run longer"),
    )
    reason = np.full(len(high), "", dtype=object)
    for fault, text in reversed(faults):  # the first that holds stays
        for k in np.flatnonzero(fault).tolist():
            reason[k] = f"unconverged: {text(k)}"
    known = moving & (reason == "")
    return Envelopes(
        amplitude=np.where(known, mean, np.where(rest, 0.0, np.nan)),
        omega=np.where(known, omega, np.nan),
        reason=tuple(reason.tolist()),
    )


def in_turn(ring: Array, count: IntArray) -> Array:
    """Return rings of last values, (N, K), with the oldest first; count: (N,), values that were put in."""
    kept = ring.shape[1]
    place = (count[:, None] + np.arange(kept)) % kept
    return np.take_along_axis(ring, np.where(count[:, None] >= kept, place, np.arange(kept)), axis=1)


def _total(x: Array) -> Array:
    """Return sums over the last axis, one after another: their bits do not depend on how many rows there are."""
    total = x[..., 0].copy()
    for k in range(1, x.shape[-1]):
        total += x[..., k]
    return total


def _remaining(half: Array, size: Array) -> Array:
    """Return how far a geometric approach is from its end, relative; inf where it does not slow down."""
    third = CYCLES // 3
    means = [_total(half[:, k * third : (k + 1) * third]) / third for k in range(3)]
    first, second = means[1] - means[0], means[2] - means[1]
    away = np.where(np.abs(second) < np.abs(first), second**2 / np.abs(first - second) / size, np.inf)
    return np.where(np.abs(second) < 5e-5 * size, 0.0, away)  # nothing moves but sampling


def _how_fast(logarithm: float) -> str:
    """Return a change of size in words, in percent or, where it more than doubles, as how many times it is after."""
    if logarithm > np.log(2.0):
        return f"grows to {np.exp(logarithm):.3g} times its size"
    return f"changes by {100.0 * np.expm1(logarithm):+.3g} %"


def _how_far(away: float) -> str:
    return "drifts without slowing down" if np.isinf(away) else f"is still some {100.0 * away:.2g} % from its end"


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
