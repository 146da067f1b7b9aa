"""Confidence bands of a fitted decay by bootstrap of its residuals."""

from dataclasses import dataclass

import numpy as np

from sloshpy.damping.decay_choice import Choice
from sloshpy.damping.decay_fit import DecayFit
from sloshpy.units import Array

_LEAST_WEIGHT = 0.07  # a law of less belief is left out of the band
_AT_ONCE = 4_000_000  # numbers of resampled residuals held in memory


@dataclass(frozen=True, kw_only=True)
class Draws:
    """Resampled answers, of which the first `of_best` are of the law chosen.

    values: w, xi0, q, p, k, (draws, 5). start_amplitude: in the record's unit, (draws,).
    """

    of_best: int
    values: Array
    start_amplitude: Array

    def ratio(self, amplitude: Array) -> Array:
        """Return xi at amplitudes in the record's unit, (draws, amplitudes); none is negative."""
        relative = amplitude / self.start_amplitude[:, None]
        values = self.values
        p = np.clip(values[:, 3:4], 0.05, 4.0)
        return np.asarray(np.maximum(values[:, 1:2] + values[:, 2:3] * relative**p, 0.0))


def bootstrap(choice: Choice, draws: int, seed: int) -> Draws:
    """Resample the residuals and refit: each law by its weight, each refit one Gauss-Newton step from the fit.

    White residuals are drawn one by one, others in blocks of one or two cycles. One step is enough where bands are
    narrow against the damping, and the caller refuses those that are not.
    """
    generator = np.random.default_rng(seed)
    weights = np.where(choice.weights < _LEAST_WEIGHT, 0.0, choice.weights)
    counts = np.round(draws * weights / np.sum(weights)).astype(int)
    parts = [
        _resampled(fit, int(count), choice.excess, generator)
        for fit, count in zip(choice.fits, counts, strict=True)
        if count > 0
    ]
    return Draws(
        of_best=parts[0].of_best,
        values=np.concatenate([part.values for part in parts]),
        start_amplitude=np.concatenate([part.start_amplitude for part in parts]),
    )


def _resampled(fit: DecayFit, count: int, excess: float, generator: np.random.Generator) -> Draws:
    n = len(fit.residual)
    size = np.linalg.norm(fit.jacobian, axis=0)
    step = np.linalg.pinv(fit.jacobian / np.where(size > 0.0, size, 1.0), rcond=1e-9)
    spread = (fit.residual - np.mean(fit.residual)) * np.sqrt(n / max(n - fit.count, 1))
    per_cycle = 2.0 * np.pi / fit.values[0, 0] * (n - 1) / fit.time[-1]
    block = 1 if excess == 1.0 else int(per_cycle * (2.0 if n > 20.0 * per_cycle else 1.0))
    moves = []
    for first in range(0, count, max(_AT_ONCE // n, 1)):
        now = min(max(_AT_ONCE // n, 1), count - first)
        starts = generator.integers(0, n, size=(now, -(-n // block)))
        if block > 1:
            starts = ((starts[:, :, None] + np.arange(block)) % n).reshape(now, -1)[:, :n]
        moves.append(spread[starts] @ step.T)
    move = np.concatenate(moves) / np.where(size > 0.0, size, 1.0)
    values = np.tile(fit.values[0], (count, 1))
    values[:, fit.laws[0].at] += move[:, : len(fit.laws[0].free)]
    first = sum(len(law.free) for law in fit.laws)
    start = np.hypot(*(fit.coefficient[j] + move[:, first + j] for j in (0, 1)))
    return Draws(of_best=count, values=values, start_amplitude=start)


def interval(samples: Array, level: float) -> tuple[Array, Array]:
    """Return the bounds of the central `level` of samples along their first axis."""
    low, high = np.quantile(samples, [0.5 - 0.5 * level, 0.5 + 0.5 * level], axis=0)
    return np.asarray(low), np.asarray(high)
