"""The forward path of the autopilot as an exact function of s: gain, filters, delay, hold, actuator.

A digital filter H(z) is H(e^{sT}), the zero-order hold (1 - e^{-sT})/(sT). Both are exact; what the sampler folds from
above half the sampling frequency into the loop is not here (see `dynamics.sampled`).
"""

import numpy as np

from sloshpy.autopilot.autopilot import Autopilot
from sloshpy.autopilot.coefficients import derivative
from sloshpy.units import Array, ComplexArray


def forward_fraction(autopilot: Autopilot, s: ComplexArray) -> tuple[ComplexArray, ...]:
    """Return numerator and denominator of beta over (a0 phi + a1 phi') at s, and their derivatives by s.

    The delay is exact, exp(-s tau), and counted in the numerator, so that both are entire functions of s.
    `s` broadcasts with the autopilot's gain, delay and coefficients.

    Returns:
        n, d, dn/ds, dd/ds, each of the shape of s.
    """
    tau, T = np.asarray(autopilot.delay), autopilot.sample_time
    n = autopilot.gain * np.exp(-s * tau)
    d, dn, dd = np.ones_like(n), -tau * n, np.zeros_like(n)
    for top, bottom in _fractions(autopilot):
        nf, dnf = np.polyval(top, s), np.polyval(derivative(top), s)
        df, ddf = np.polyval(bottom, s), np.polyval(derivative(bottom), s)
        n, dn = n * nf, dn * nf + n * dnf
        d, dd = d * df, dd * df + d * ddf
    if T is not None:
        hold, by_s = hold_transfer(T, s)
        n, dn = n * hold, dn * hold + n * by_s
        q = np.exp(-s * T)
        for top, bottom in pulse_fractions(autopilot):
            nf, dnf = np.polyval(top, q), -T * q * np.polyval(np.polyder(top), q)
            df, ddf = np.polyval(bottom, q), -T * q * np.polyval(np.polyder(bottom), q)
            n, dn = n * nf, dn * nf + n * dnf
            d, dd = d * df, dd * df + d * ddf
    return n, d, dn, dd


def forward_transfer(autopilot: Autopilot, s: ComplexArray) -> ComplexArray:
    """Return beta over (a0 phi + a1 phi') at complex frequencies s, exact delay included."""
    K = autopilot.gain * np.exp(-s * np.asarray(autopilot.delay)) if np.any(autopilot.delay) else autopilot.gain
    for top, bottom in _fractions(autopilot):
        K = K * (np.polyval(top, s) / np.polyval(bottom, s))
    if autopilot.sample_time is not None:
        q = np.exp(-s * autopilot.sample_time)
        K = K * hold_transfer(autopilot.sample_time, s)[0]
        for top, bottom in pulse_fractions(autopilot):
            K = K * (np.polyval(top, q) / np.polyval(bottom, q))
    return np.broadcast_to(K, np.broadcast_shapes(np.shape(K), np.shape(s))).astype(complex, copy=False)


def hold_transfer(T: float, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return the zero-order hold (1 - e^{-sT})/(sT) at s and its derivative by s; 1 and -T/2 at s = 0."""
    x = np.asarray(s * T, dtype=complex)
    small = np.abs(x) < 1e-3  # there the series, whose next terms are x^4/120 and x^3/30
    y = np.where(small, 1.0, x)
    hold = np.where(small, 1.0 - x / 2.0 + x**2 / 6.0 - x**3 / 24.0, -np.expm1(-y) / y)
    by_x = np.where(small, -0.5 + x / 3.0 - x**2 / 8.0, (np.exp(-y) - hold) / y)
    return np.asarray(hold, dtype=complex), np.asarray(T * by_x, dtype=complex)


def pulse_fractions(autopilot: Autopilot) -> list[tuple[Array, Array]]:
    """Return the digital filters in descending powers of 1/z."""
    fractions = []
    for f in autopilot.digital_filter:
        late = np.zeros(len(f.denominator) - len(f.numerator))
        fractions.append((np.append(f.numerator[::-1], late), np.array(f.denominator[::-1])))
    return fractions


def _fractions(autopilot: Autopilot) -> list[tuple[Array, Array]]:
    """Return filters and actuator, scaled by the denominator's largest coefficient, which leaves a fraction alone.

    Each (k, ...), with the batch's axes behind.
    """
    fractions = [f.fraction for f in autopilot.filter]
    if autopilot.actuator is not None:
        fractions.append(autopilot.actuator.fraction)
    return [(top / (size := np.max(np.abs(bottom), axis=0)), bottom / size) for top, bottom in fractions]
