"""How far a loop stays from -1 in the plane of L: modulus margin and disk margin, and curves fine enough to find them.

Both are other quantities than the disc margin of eq 24, which is measured in the normalised Nichols plane:

    modulus margin  min |1 + L| = 1 / max |S|
    disk margin     alpha = min 2 |1 + L| / |1 - L| = 1 / max |(S - T)/2|,  S = 1/(1 + L), T = L S,  skew 0

A disk margin alpha allows every complex factor on L inside the disk through the real points (2 - alpha)/(2 + alpha) and
(2 + alpha)/(2 - alpha), so that gain and phase may vary together and with frequency (Seiler, Packard, Gahinet, An
Introduction to Disk Margins, IEEE Control Systems 40(5), 2020).
"""

from collections.abc import Callable

import numpy as np

from sloshpy.case import Criteria
from sloshpy.dynamics.characteristic import characteristic_matrix
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.response import transfer
from sloshpy.stability.nichols import sampled, valley_samples
from sloshpy.units import Array, ComplexArray

STEP = 0.03  # of ln L between samples: a valley of |1 + L| narrower than that has no room beside -1
HEARD = 4.0  # |ln L| beyond which neither distance has a minimum of interest: 35 dB


def modulus_margin(loop: ComplexArray) -> Array:
    """Return |1 + L| at L(j omega), any shape; its least value is 1 / max |S|."""
    return np.asarray(np.abs(1.0 + loop))


def disk_margin(loop: ComplexArray) -> Array:
    """Return 2 |1 + L| / |1 - L| at L(j omega), any shape; its least value is the disk margin alpha of skew 0."""
    with np.errstate(divide="ignore"):  # L = 1 is infinitely far
        return np.asarray(2.0 * np.abs(1.0 + loop) / np.abs(1.0 - loop))


def disk_guarantee(alpha: float) -> tuple[float, float]:
    """Return the gain ratio (up; its inverse down) and the phase in rad that a disk margin guarantees, each alone."""
    gain = (2.0 + alpha) / (2.0 - alpha) if alpha < 2.0 else np.inf
    return gain, float(2.0 * np.arctan(alpha / 2.0))


def fine_curve(loop: Loop, criteria: Criteria) -> tuple[Array, ComplexArray]:
    """Return frequencies in rad/s and L of one loop in steps of at most 3 % of L or 1.7 deg, within 35 dB of 0 dB."""
    omega = sampled(loop, criteria.gain_margin, criteria.phase_margin).omega
    for _ in range(6):
        L = transfer(loop.along(), 1j * omega).loop
        finite = np.isfinite(L) & (L != 0.0)
        omega, L = omega[finite], L[finite]
        size = np.abs(np.log(np.abs(L)))
        near = np.minimum(size[1:], size[:-1]) < HEARD
        near &= omega[1:] > omega[:-1] * (1.0 + 1e-12)  # no piece shorter than rounding
        parts = np.where(near, np.ceil(np.abs(np.log(L[1:] / L[:-1])) / STEP), 1.0).astype(int)
        if np.all(parts <= 1):
            break
        parts = np.minimum(parts, 50)  # the next round goes on where L turns within a piece
        k = np.repeat(np.arange(len(parts)), parts - 1)
        j = np.arange(len(k)) - np.repeat(np.cumsum(parts - 1) - (parts - 1), parts - 1) + 1
        omega = np.sort(np.concatenate([omega, omega[k] * (omega[k + 1] / omega[k]) ** (j / parts[k])]))
    L = transfer(loop.along(), 1j * omega).loop
    finite = np.isfinite(L) & (L != 0.0)
    return omega[finite], L[finite]


def valleys(
    loop: Loop, omega: Array, curve: ComplexArray, static: float, distance: Callable[[ComplexArray], Array]
) -> tuple[Array, Array]:
    """Return frequency in rad/s and value of every local minimum of a distance along one loop's curve, refined.

    The curve's static end is one of them, at frequency 0, where it is finite and the curve runs away from -1.
    """
    from scipy.optimize import elementwise  # 0.4 s: only when margins are wanted

    def squared(w: Array) -> Array:
        return distance(transfer(loop.along(), 1j * w).loop) ** 2

    k = np.flatnonzero(valley_samples(distance(curve), np.zeros(len(omega), dtype=int)))
    bracket = omega[k - 1], omega[k], omega[k + 1]
    found = elementwise.find_minimum(squared, bracket, tolerances={"xrtol": 1e-11, "frtol": 1e-15})
    at, value = np.asarray(found.x), np.sqrt(np.maximum(np.asarray(found.f_x), 0.0))
    if np.isfinite(static):
        end = distance(np.asarray([static], dtype=complex))
        if end[0] < distance(curve[:1])[0]:
            at, value = np.append(at, 0.0), np.append(value, end)
    return at, value


def static_loop(loop: Loop) -> float:
    """Return L(0) of one loop; inf where the loop integrates. With aerodynamics it is finite, and real."""
    s = np.zeros((), dtype=complex)
    with np.errstate(all="ignore"):
        closed, broken = (np.linalg.det(characteristic_matrix(loop, s, which)[0]).real for which in (True, False))
        ratio = closed / broken - 1.0
    return float(ratio) if np.isfinite(ratio) and loop.plant.velocity_only else np.inf


def log_slope(loop: Loop, omega: Array, least: float) -> ComplexArray:
    """Return d ln L / ds of one loop at s = j omega: its real part is d phase / d omega, minus its imaginary part
    d ln |L| / d omega. `least` is a frequency well below every pole and zero, for the slope at omega = 0."""
    s = 1j * np.asarray(omega, dtype=float)
    h = np.where(omega > 0.0, 1e-7 * s, 1e-3 * least)  # relative 1e-7: far inside any resonance of 1e-5 damping
    after, before = (transfer(loop.along(), s + step).loop for step in (h, -h))
    return np.asarray(np.log(after / before) / (2.0 * h))
