"""The forward path of the autopilot as an exact function of s: gain, filters, delay, actuator."""

import numpy as np

from sloshpy.autopilot.autopilot import Autopilot
from sloshpy.units import Array, ComplexArray


def forward_fraction(autopilot: Autopilot, s: ComplexArray) -> tuple[ComplexArray, ...]:
    """Return numerator and denominator of beta over (a0 phi + a1 phi') at s, and their derivatives by s.

    The delay is exact, exp(-s tau), and counted in the numerator, so that both are entire functions of s.
    `s` broadcasts with the autopilot's gain and delay.

    Returns:
        n, d, dn/ds, dd/ds, each of the shape of s.
    """
    tau = np.asarray(autopilot.delay)
    n = autopilot.gain * np.exp(-s * tau)
    d, dn, dd = np.ones_like(n), -tau * n, np.zeros_like(n)
    for top, bottom in _fractions(autopilot):
        nf, dnf = np.polyval(top, s), np.polyval(np.polyder(top), s)
        df, ddf = np.polyval(bottom, s), np.polyval(np.polyder(bottom), s)
        n, dn = n * nf, dn * nf + n * dnf
        d, dd = d * df, dd * df + d * ddf
    return n, d, dn, dd


def forward_transfer(autopilot: Autopilot, s: ComplexArray) -> ComplexArray:
    """Return beta over (a0 phi + a1 phi') at complex frequencies s, exact delay included."""
    K = autopilot.gain * np.exp(-s * np.asarray(autopilot.delay)) if np.any(autopilot.delay) else autopilot.gain
    for top, bottom in _fractions(autopilot):
        K = K * (np.polyval(top, s) / np.polyval(bottom, s))
    return np.broadcast_to(K, np.broadcast_shapes(np.shape(K), np.shape(s))).astype(complex, copy=False)


def _fractions(autopilot: Autopilot) -> list[tuple[Array, Array]]:
    """Return filters and actuator, scaled by the denominator's largest coefficient, which leaves a fraction alone."""
    fractions = [(np.array(f.numerator), np.array(f.denominator)) for f in autopilot.filter]
    if autopilot.actuator is not None:
        fractions.append(autopilot.actuator.fraction)
    return [(top / (size := np.max(np.abs(bottom))), bottom / size) for top, bottom in fractions]
