"""First guess of a decay: the strongest line of the record, then amplitude and phase cycle by cycle."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sloshpy.damping.decay_record import DecayRecord
from sloshpy.units import Array, ComplexArray

_WINDOWS = 60  # at most; a record of more cycles takes several in each
_NEAR = 0.3  # of the hint: how far from it the line is looked for


@dataclass(frozen=True, kw_only=True)
class Line:
    """The record's main line: frequency, rad/s, and mean damping ratio; `envelope` holds its complex amplitudes at the
    middles of windows of `period` s, nan where a window has too few samples."""

    frequency: float
    ratio: float
    envelope: ComplexArray
    period: float


def strongest_line(record: DecayRecord, hint: float | None) -> float:
    """Return the frequency, rad/s, of the strongest line, near the hint where one is given.

    Raises:
        InputError: the record's strongest line is far from the hint.
    """
    f, power = spectrum(record.time, record.value)
    allowed = f * (record.time[-1] - record.time[0]) > 0.8  # below stands what is left of a drift
    if not np.any(allowed):
        raise record.refused(f"{len(f)} samples", "are too few to hold an oscillation", "give at least five cycles")
    power = np.where(allowed, power, 0.0)
    strongest = 2.0 * np.pi * float(f[np.argmax(power)])
    if hint is None:
        return strongest
    near = np.abs(2.0 * np.pi * f - hint) < _NEAR * hint
    found = np.where(near, power, 0.0)
    if not np.any(near) or np.max(found) < 0.25 * np.max(power):
        value = f"strongest line at {strongest / 2.0 / np.pi:.4g} Hz"
        rule = f"contradicts the frequency hint of {hint / 2.0 / np.pi:.4g} Hz"
        raise record.refused(value, rule, "mend the hint, or check sampling, units of time and filters of the record")
    return 2.0 * np.pi * float(f[np.argmax(found)])


def spectrum(time: Array, value: Array) -> tuple[Array, Array]:
    """Return frequencies in Hz and the power of a record without its straight line, on an even grid of its mean step.

    A guess only: samples between unevenly spaced ones are interpolated.
    """
    count = len(time)
    even = np.linspace(time[0], time[-1], count)
    level = np.interp(even, time, value)
    x = np.linspace(-1.0, 1.0, count)
    level = level - np.mean(level) - x * np.sum(x * level) / np.sum(x * x)
    padded = 4 * count
    step = (time[-1] - time[0]) / (count - 1)
    return np.fft.rfftfreq(padded, step), np.abs(np.fft.rfft(level, padded)) ** 2 / count


def main_line(record: DecayRecord, frequency: float) -> Line:
    """Refine a frequency by the phase of the windows' amplitudes, and guess the damping by their decay."""
    time = record.time - record.time[0]
    w, ratio = frequency, 0.0
    for _ in range(2):
        cycles = w * time[-1] / (2.0 * np.pi)
        period = max(1, int(np.ceil(cycles / _WINDOWS))) * 2.0 * np.pi / w
        middle, z = _demodulate(time, record.value, w, period)
        good = np.isfinite(z)
        if np.count_nonzero(good) < 3:
            break
        size = np.abs(z[good])
        weight = size / np.max(size)
        phase = np.unwrap(np.angle(z[good]))
        # an even weight would let the noise of the last cycles turn the phase
        w = w + float(np.polyfit(middle[good], phase, 1, w=weight)[0])
        ratio = -float(np.polyfit(middle[good], np.log(np.maximum(size, 1e-300)), 1, w=weight)[0]) / w
    return Line(frequency=w, ratio=float(np.clip(ratio, -0.1, 0.3)), envelope=z, period=period)


def _demodulate(time: Array, value: Array, w: float, period: float) -> tuple[Array, ComplexArray]:
    count = max(int(time[-1] / period), 1)
    middle = (np.arange(count) + 0.5) * period
    edges = np.searchsorted(time, np.arange(count + 1) * period)
    z: ComplexArray = np.full(count, np.nan + 0j)
    for j, (low, high) in enumerate(pairwise(edges)):
        t = time[low:high]
        if len(t) < 6:
            continue
        columns = np.stack([np.cos(w * t), np.sin(w * t), np.ones_like(t), t - middle[j]], axis=1)
        cosine, sine = np.linalg.lstsq(columns, value[low:high], rcond=None)[0][:2]
        z[j] = cosine - 1j * sine
    return np.asarray(middle, dtype=float), z


def two_lines_of(line: Line) -> list[tuple[float, float]] | None:
    """Return frequency and ratio of the two lines that make the amplitudes, by the shift of their Hankel matrix.

    The rank-2 form of Kung's method; None where the envelope has gaps or is too short.
    """
    z = line.envelope
    if len(z) < 8 or not np.all(np.isfinite(z)):
        return None
    rows = len(z) // 2
    hankel = np.lib.stride_tricks.sliding_window_view(z, len(z) - rows + 1)
    basis = np.linalg.svd(hankel, full_matrices=False)[0][:, :2]
    shift = np.linalg.lstsq(basis[:-1], basis[1:], rcond=None)[0]
    poles = np.log(np.linalg.eigvals(shift) + 1e-300) / line.period
    found = [(line.frequency + float(s.imag), -float(s.real) / line.frequency) for s in poles]
    return found if all(w > 0.0 and abs(xi) < 0.3 for w, xi in found) else None
