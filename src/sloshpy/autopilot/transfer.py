"""The forward path of the autopilot as an exact function of s: gain, filters, delay, actuator."""

import numpy as np

from sloshpy.autopilot.autopilot import Autopilot
from sloshpy.units import ComplexArray


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
    factors = [(np.array(f.numerator), np.array(f.denominator)) for f in autopilot.filter]
    if autopilot.actuator is not None:
        factors.append(autopilot.actuator.fraction)
    for top, bottom in factors:
        # scaled by the denominator's largest coefficient, which leaves the fraction alone
        size = np.max(np.abs(bottom))
        nf, dnf = np.polyval(top / size, s), np.polyval(np.polyder(top / size), s)
        df, ddf = np.polyval(bottom / size, s), np.polyval(np.polyder(bottom / size), s)
        n, dn = n * nf, dn * nf + n * dnf
        d, dd = d * df, dd * df + d * ddf
    return n, d, dn, dd


def forward_transfer(autopilot: Autopilot, s: ComplexArray) -> ComplexArray:
    """Return beta over (a0 phi + a1 phi') at complex frequencies s, exact delay included."""
    n, d, _, _ = forward_fraction(autopilot, s)
    return n / d
