"""Amplitude and frequency of a settled oscillation, or the reason why there is none."""

from dataclasses import dataclass

import numpy as np

from sloshpy.units import Array

CYCLES = 20  # over which the envelope must be level
LEVEL = 1e-3  # relative change of the envelope allowed over ten cycles
SPREAD = 5e-3  # relative spread of the cycles' amplitudes allowed: more is beating of several frequencies
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
    return Envelope(
        amplitude=float(np.mean(half)),
        omega=float(2.0 * np.pi * CYCLES / (t_high[-1] - t_high[-1 - CYCLES])),
        reason="",
    )


def _unconverged(why: str) -> Envelope:
    return Envelope(amplitude=np.nan, omega=np.nan, reason=f"unconverged: {why}")


def _peaks(time: Array, signal: Array) -> tuple[Array, Array]:
    """Return times and values of the maxima, each through the parabola of three samples."""
    before, here, after = signal[:-2], signal[1:-1], signal[2:]
    k = np.flatnonzero((here > before) & (here >= after))
    a, b = 0.5 * (before[k] - 2.0 * here[k] + after[k]), 0.5 * (after[k] - before[k])
    shift = -b / (2.0 * a)
    return time[k + 1] + shift * (time[1] - time[0]), here[k] - b**2 / (4.0 * a)
