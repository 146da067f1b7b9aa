"""How the record would change if the damping were a little other than the fitted law, in whatever way.

The fitted law is one of a few. What the record says of xi(A) without it is linear about the fit: with
d xi = sum over j of c_j f_j(A), ln a obeys (ln a)' = -w xi(a), so that its change d obeys

    d' = -w (d xi/d ln a) d - w f_j,   solved by   d_j = xi(a) int_0^(ln a) f_j / xi^2 d ln a,

and the phase, which turns at w (1 - xi^2/2), changes by int xi d(d_j). Three shapes f_j are those in which the widest
law that is tried, a sum with a free exponent, can leave the fitted one: 1, a^p and a^p ln a; beside a constant, whose
exponent is anyone's, 1, a^(1/2) and a. So the estimate has no bias from the choice among the laws, and its scatter is
that of the widest one, whichever was chosen.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sloshpy.damping.decay_fit import DecayFit
from sloshpy.damping.decay_model import (
    FLATTEST,
    STEEPEST,
    DecayLaw,
    log_envelope_and_phase,
    ratio_at,
    wave,
    wave_slopes,
)
from sloshpy.units import Array

_SHAPES = 3
_SINGULAR = 1e-10  # of the greatest singular value of columns of length one


@dataclass(frozen=True, kw_only=True)
class Tangent:
    """The changes of the record about a fit.

    columns: (n, c), by the frequency and its move with the amplitude, by the three shapes (at `first`), then by the
    second line and the coefficients.
    """

    fit: DecayFit
    columns: Array
    first: int

    @cached_property
    def step(self) -> Array:
        """From a residual to the least-squares change of each column, (c, n)."""
        size = np.linalg.norm(self.columns, axis=0)
        size = np.where(size > 0.0, size, 1.0)
        return np.asarray(np.linalg.pinv(self.columns / size, rcond=_SINGULAR) / size[:, None])

    @cached_property
    def basis(self) -> Array:
        """Orthonormal columns that span the changes, (n, c)."""
        size = np.linalg.norm(self.columns, axis=0)
        return np.asarray(np.linalg.qr(self.columns / np.where(size > 0.0, size, 1.0))[0])

    @cached_property
    def residual(self) -> Array:
        """What is left of the record, (n,)."""
        return np.asarray(self.fit.residual - self.columns @ (self.step @ self.fit.residual))

    def rows(self, amplitude: Array) -> Array:
        """Return what turns a residual into the change of xi at amplitudes in the record's unit, (amplitudes, n).

        An amplitude is fixed, and the first one, to which shapes refer, changes too.
        """
        fit = self.fit
        relative = amplitude / fit.start_amplitude[0]
        main = self.columns.shape[1] - len(fit.coefficient)
        unit = fit.coefficient[:2] / fit.start_amplitude[0] ** 2
        _, _, q, p, _ = fit.values[0]
        slope = q * p * relative**p
        changes = _shapes(fit, relative) @ self.step[self.first : self.first + _SHAPES]
        return np.asarray(changes - slope[:, None] * (unit @ self.step[main : main + 2]))

    def ratio(self, amplitude: Array) -> Array:
        """Return xi without a law at amplitudes in the record's unit."""
        law = ratio_at(self.fit.values[0], amplitude / self.fit.start_amplitude[0])
        return np.asarray(law + self.rows(amplitude) @ self.fit.residual)


def tangent(fit: DecayFit) -> Tangent:
    """Return how the record changes about a fit: the law's numbers give way to the three shapes.

    The frequency may move with the amplitude, whether the fit has it move or not: no jump is to be seen in that.
    """
    turning = DecayLaw(name="turning", free=("w", "k"))
    mode = wave(fit.values[0], fit.time) * (fit.coefficient[0] - 1j * fit.coefficient[1])
    slopes = np.stack(wave_slopes(turning, fit.values[0], fit.time), axis=1)
    changes = np.real(mode[:, None] * np.concatenate([slopes, shape_slopes(fit)], axis=1))
    columns = np.concatenate([changes, fit.jacobian[:, len(fit.laws[0].free) :]], axis=1)
    return Tangent(fit=fit, columns=columns, first=len(turning.free))


def shape_slopes(fit: DecayFit) -> Array:
    """Return the change of ln a + i theta by each shape, (n, shapes), by the trapezoidal rule over the samples."""
    values = fit.values[0]
    log_a, _ = log_envelope_and_phase(values, fit.time)
    a = np.exp(log_a)
    xi = np.maximum(ratio_at(values, a), 1e-12)[:, None]
    d_log = -values[0] * np.diff(fit.time)[:, None] * xi[:-1]
    d_log = 0.5 * (d_log - values[0] * np.diff(fit.time)[:, None] * xi[1:])
    force = _shapes(fit, a) / xi**2
    change = xi * _summed(0.5 * (force[1:] + force[:-1]) * d_log)
    phase = _summed(0.5 * (xi[1:] + xi[:-1]) * np.diff(change, axis=0))
    return np.asarray(change + 1j * phase)


def _shapes(fit: DecayFit, relative: Array) -> Array:
    p = min(max(float(fit.values[0, 3]), FLATTEST), STEEPEST)
    one = np.ones_like(relative)
    if "q" not in fit.laws[0].free:
        return np.stack([one, np.sqrt(relative), relative], axis=1)
    power = relative**p
    return np.stack([one, power, power * np.log(relative)], axis=1)


def _summed(parts: Array) -> Array:
    return np.concatenate([np.zeros((1, parts.shape[1])), np.cumsum(parts, axis=0)])
