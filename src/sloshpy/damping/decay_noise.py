"""The noise of a record, of which its residual is a sample: white, or shocks through an autoregressive filter."""

from dataclasses import dataclass

import numpy as np

from sloshpy.damping.decay_checks import white
from sloshpy.damping.decay_tangent import Tangent
from sloshpy.units import Array

_MOST_LAGS = 24
_REPEATS = 40  # the mean of so many powers is good to 3 %


@dataclass(frozen=True, kw_only=True)
class Noise:
    """e_t = sum over k of filter_k e_(t-k) + shock_t; a white noise has no filter.

    shocks: of mean zero and of the noise's own spread, to be drawn from, (n,).
    """

    shocks: Array
    filter: Array

    def power(self, turn: float) -> float:
        """Return the variance of a white noise as strong as this one at a frequency, in rad per sample."""
        lags = np.arange(1, len(self.filter) + 1)
        gain = 1.0 / np.abs(1.0 - np.sum(self.filter * np.exp(-1j * turn * lags)))
        return float(np.var(self.shocks) * gain**2)

    def adjoint(self, rows: Array) -> Array:
        """Return what rows, (r, n), ask of the shocks: rows @ noise = adjoint(rows) @ shocks, (r, n + lead).

        The filter starts `lead` samples early, so that its noise is steady when the record begins.
        """
        if not len(self.filter):
            return rows
        from scipy.signal import lfilter  # 0.2 s: only where the noise is coloured

        lead = 10 * _MOST_LAGS
        ahead = np.concatenate([np.zeros((len(rows), lead)), rows], axis=1)
        denominator = np.concatenate([[1.0], -self.filter])
        return np.asarray(lfilter([1.0], denominator, ahead[:, ::-1], axis=1)[:, ::-1])


def noise_of(tangent: Tangent) -> Noise:
    """Return the noise of a fit, which has swallowed a part of it and leaves a residual that is smaller.

    A white residual is widened by its lost degrees of freedom and by Student's quantile over the normal one. Another
    one is whitened by Burg's method, of the order of least Schwarz criterion; what the fit swallows of it, and mostly
    at the line, is told by fits of noise made the same way.
    """
    from scipy.special import ndtri, stdtrit  # 0.1 s: only when a record is fitted

    n, count = tangent.columns.shape
    r = tangent.residual - np.mean(tangent.residual)
    tails = float(stdtrit(max(n - count, 1), 0.975) / ndtri(0.975))
    if white(tangent.fit):
        return Noise(shocks=np.asarray(r * np.sqrt(n / max(n - count, 1)) * tails), filter=np.zeros(0))
    left = _burg_noise(r)
    turn = float(tangent.fit.values[0, 0] * tangent.fit.time[-1] / (n - 1))
    swallowed = np.mean([left.power(turn) / one.power(turn) for one in _again(tangent, left)])
    return Noise(shocks=np.asarray(left.shocks * np.sqrt(swallowed) * tails), filter=left.filter)


def _again(tangent: Tangent, noise: Noise) -> list[Noise]:
    """Return what fits of such noise would take it for."""
    from scipy.signal import lfilter

    generator = np.random.default_rng(0)
    n, lead = len(tangent.residual), 10 * _MOST_LAGS
    answers = []
    for _ in range(_REPEATS):
        shocks = noise.shocks[generator.integers(0, len(noise.shocks), n + lead)]
        made = lfilter([1.0], np.concatenate([[1.0], -noise.filter]), shocks)[lead:]
        left = made - tangent.columns @ (tangent.step @ made)
        answers.append(_burg_noise(left - np.mean(left)))
    return answers


def _burg_noise(r: Array) -> Noise:
    filter_ = _burg(r)
    shocks = _whitened(r, filter_)
    return Noise(shocks=shocks - np.mean(shocks), filter=filter_)


def _whitened(r: Array, filter_: Array) -> Array:
    return np.convolve(r, np.concatenate([[1.0], -filter_]))[len(filter_) : len(r)]


def _burg(r: Array) -> Array:
    """Return the autoregressive coefficients of a series, of the order of least Schwarz criterion."""
    n = len(r)
    ahead, behind = r[1:].copy(), r[:-1].copy()
    power = float(r @ r) / n
    a = np.zeros(0)
    best, least = a, n * np.log(max(power, 1e-300))
    for order in range(1, min(_MOST_LAGS, n // 10) + 1):
        size = float(ahead @ ahead + behind @ behind)
        if size <= 0.0:
            break
        k = 2.0 * float(ahead @ behind) / size
        a = np.concatenate([a - k * a[::-1], [k]])
        ahead, behind = (ahead - k * behind)[1:], (behind - k * ahead)[:-1]
        power *= 1.0 - k * k
        criterion = n * np.log(max(power, 1e-300)) + np.log(n) * order
        if criterion < least:
            best, least = a, criterion
    return np.asarray(best)
