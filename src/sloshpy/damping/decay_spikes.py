"""A search for single samples that stand apart from their neighbours: spikes of a sensor, not of the wave."""

from dataclasses import replace

import numpy as np

from sloshpy.damping.decay_record import DecayRecord
from sloshpy.units import Array

_MOST = 5  # spikes: more are noise
_BEYOND = 10.0  # robust standard deviations of the distance from the neighbours
_APART = 2.5  # times what any other sample does
_REACH = np.array([-2, -1, 1, 2])


def without_spikes(record: DecayRecord) -> tuple[DecayRecord, tuple[int, ...]]:
    """Return the record with its spikes drawn onto a cubic through their neighbours, and which samples they are.

    A smooth wave lies near that cubic and noise spreads about it alike everywhere; a spike is far beyond every other
    sample, by a scale (the median distance) that it does not itself move. A jump of the wave may look so too: whether
    the rest is a free decay is for the caller to see.
    """
    value, spikes = record.value.copy(), []
    apart = _from_neighbours(record.time, value)
    scale = 1.4826 * float(np.median(np.abs(apart)))
    sizes = []
    for _ in range(_MOST):
        k = int(np.argmax(np.abs(apart)))
        size = float(abs(apart[k]))
        left = value.copy()
        left[k] -= apart[k]
        spikes.append(k)
        sizes.append(size)
        value, apart = left, _from_neighbours(record.time, left)
        if size > max(_BEYOND * scale, 1e-9 * float(np.ptp(record.value))) and min(sizes) > _APART * float(
            np.max(np.abs(apart))
        ):
            return replace(record, value=value), tuple(sorted(spikes))
    return record, ()


def _from_neighbours(time: Array, value: Array) -> Array:
    """Return how far each sample is from the cubic through two on each side, (n,); 0 for the two at each end."""
    n = len(time)
    middle = np.arange(2, n - 2)
    at = middle[:, None] + _REACH
    t = time[at] - time[middle][:, None]
    weight = np.ones_like(t)
    for i in range(4):
        for j in range(4):
            if i != j:
                weight[:, i] *= -t[:, j] / (t[:, i] - t[:, j])
    apart = np.zeros(n)
    apart[middle] = value[middle] - np.sum(weight * value[at], axis=1)
    return apart
