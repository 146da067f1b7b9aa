"""Confidence bands of a fitted decay by bootstrap of its residuals."""

from dataclasses import dataclass

import numpy as np

from sloshpy.damping.decay_model import ratio_at
from sloshpy.damping.decay_noise import Noise
from sloshpy.damping.decay_record import DecayRecord
from sloshpy.damping.decay_tangent import Tangent
from sloshpy.units import Array

KNOWN = 0.08  # of xi: where the half band is wider, nothing is said; the choice among laws then biases by 2 % at most
_OUTSIDE = 1.0  # half bands: a band of 95 % at each amplitude leaves out a law somewhere more often, but not so far
_LOOKED_AT = 73  # amplitudes between the record's ends
_AT_ONCE = 500_000  # numbers of resampled residuals held at once: they stay in the cache


@dataclass(frozen=True, kw_only=True)
class Draws:
    """Resampled answers, each one Gauss-Newton step from the fit.

    ratio: xi at the amplitudes asked for, whichever the law, (draws, amplitudes). values: w, xi0, q, p, k of the law
    chosen, (draws, 5). start_amplitude: its first, in the record's unit, (draws,).
    """

    ratio: Array
    values: Array
    start_amplitude: Array


def bootstrap(tangent: Tangent, noise: Noise, amplitude: Array, draws: int, seed: int) -> Draws:
    """Resample the residual and refit, both the law chosen and, for xi(A), none.

    What the averaging leaves out, measured against integrated decays, is a scatter of its own: xi^2 of the greatest xi
    and 0.05 %, 1e-4 xi^2 of the frequency. It decides where there is hardly any noise.

    One step is enough where bands are narrow against the damping, and the caller refuses those that are not.

    Args:
        tangent: of the fit.
        noise: of its residual.
        amplitude: in the record's unit, (amplitudes,).
        draws, seed: of the bootstrap.
    """
    fit = tangent.fit
    size = np.linalg.norm(fit.jacobian, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    law = np.linalg.pinv(fit.jacobian / size, rcond=1e-9) / size[:, None]
    free = tangent.rows(amplitude)
    generator = np.random.default_rng(seed)
    moves = _moves(np.concatenate([free, law]), noise, draws, generator)
    most = float(ratio_at(fit.values[0], np.ones(1))[0])
    theory = generator.standard_normal(draws) / 1.96
    count = len(amplitude)
    values = np.tile(fit.values[0], (draws, 1))
    by_law = moves[:, count:]
    values[:, fit.laws[0].at] += by_law[:, : len(fit.laws[0].free)]
    values[:, 0] *= 1.0 + 1e-4 * most**2 * theory
    first = sum(len(one.free) for one in fit.laws)
    return Draws(
        ratio=(tangent.ratio(amplitude) + moves[:, :count]) * (1.0 + (5e-4 + most**2) * theory[:, None]),
        values=values,
        start_amplitude=np.hypot(*(fit.coefficient[j] + by_law[:, first + j] for j in (0, 1))),
    )


def known_range(record: DecayRecord, tangent: Tangent, noise: Noise, floor: float) -> tuple[float, float]:
    """Return the amplitudes in the record's unit between which xi is known to 8 %, from `floor` upwards.

    A law through a record tells the damping at its ends by what it is in the middle; these bands do not.

    Raises:
        InputError: it is known nowhere, or hardly anywhere.
    """
    start = float(tangent.fit.start_amplitude[0])
    amplitude = np.geomspace(floor, start, _LOOKED_AT)
    error = np.linalg.norm(noise.adjoint(tangent.rows(amplitude)), axis=1) * np.std(noise.shocks)
    ratio = ratio_at(tangent.fit.values[0], amplitude / start)
    wide = 1.96 * error / ratio
    best = int(np.argmin(wide))
    known = np.concatenate([[False], wide <= KNOWN, [False]])
    low = best - int(np.argmin(known[best + 1 :: -1])) + 1
    high = best + int(np.argmin(known[best + 1 :])) - 1
    if not known[best + 1] or high - low < _LOOKED_AT // 8:
        xi = 100.0 * ratio[best]
        where = f"{amplitude[best]:.3g} {record.unit}"
        value = f"damping {xi:.3g} % +- {xi * wide[best]:.2g} % at best, at an amplitude of {where}"
        rule = f"is not known to {100.0 * KNOWN:g} % over any range of amplitudes"
        raise record.refused(value, rule, "record for longer, with less noise or with more samples a second")
    return float(amplitude[low]), float(amplitude[high])


def _moves(rows: Array, noise: Noise, draws: int, generator: np.random.Generator) -> Array:
    """Return rows @ noise for many draws of the noise, (draws, rows)."""
    answer = noise.adjoint(rows).T
    count = len(answer)
    parts = []
    for first in range(0, draws, max(_AT_ONCE // count, 32)):
        now = min(max(_AT_ONCE // count, 32), draws - first)
        drawn = generator.integers(
            0, len(noise.shocks), size=(now, count), dtype=np.uint32
        )  # thrice as fast as 64 bits
        parts.append(noise.shocks[drawn] @ answer)
    return np.concatenate(parts)


def check_law(record: DecayRecord, amplitude: Array, ratio: Array, low: Array, high: Array) -> None:
    """Refuse a law that is farther outside the band, which holds without one, than chance lets it be.

    Args:
        record: that was fitted.
        amplitude: in the record's unit, (amplitudes,).
        ratio: of the law, (amplitudes,).
        low, high: of the band, (amplitudes,).

    Raises:
        InputError: law and band contradict each other.
    """
    outside = np.maximum(low - ratio, ratio - high) / (0.5 * (high - low))
    k = int(np.argmax(outside))
    if outside[k] > _OUTSIDE:
        value = (
            f"damping {100.0 * ratio[k]:.4g} % by the best law, {100.0 * low[k]:.4g} to {100.0 * high[k]:.4g} % "
            f"without one, at an amplitude of {amplitude[k]:.3g} {record.unit}"
        )
        cure = "look for a beat of two close lines, or for a disturbance; record for longer"
        raise record.refused(value, "no law of damping agrees with its own record", cure)


def interval(samples: Array, level: float) -> tuple[Array, Array]:
    """Return the bounds of the central `level` of samples along their first axis.

    By Weibull's positions k/(draws + 1), between which another sample lies as often as named, however few draws.
    """
    low, high = np.quantile(samples, [0.5 - 0.5 * level, 0.5 + 0.5 * level], axis=0, method="weibull")
    return np.asarray(low), np.asarray(high)
