"""Exact frequency response of the loop with the slosh damping pulled out of the plant.

With every tank at a reference damping the plant is solved once at each frequency, for the engine angle and for a unit
acceleration on each slosh mass:

    z = z_b beta + Z_a u ,   y = y_b beta + Y_a u ,   y = a0 phi + a1 phi'

The true damping is the feedback u_j = -s 2 (xi_j - xi_ref) w_j z_j, so any damping costs an n_tanks-sized solve:

    z = (1 + s Z_a d)^-1 z_b beta ,   y = (y_b - Y_a s d z_b ...) beta ,   d = 2 (xi - xi_ref) w

The reference is far from zero, so that the solve at a resonance does not cancel digits.
"""

from dataclasses import dataclass

import numpy as np

from sloshpy.autopilot import forward_transfer
from sloshpy.dynamics.loop import Loop
from sloshpy.units import Array, ComplexArray

REFERENCE_DAMPING = 0.5  # any ratio well above zero; exact algebra, so no result depends on it


@dataclass(frozen=True, kw_only=True)
class Transfer:
    """Loop transfer and its parts at complex frequencies; shapes follow the loop's batch broadcast with s.

    loop: L(s). slosh: z_j/beta, (..., n_tanks), m/rad. sensitivity: dL/d(ln w_j), (..., n_tanks).
    """

    loop: ComplexArray
    slosh: ComplexArray
    sensitivity: ComplexArray


def transfer(loop: Loop, s: ComplexArray) -> Transfer:
    """Return L(s), z_j/beta and dL/d(ln w_j) at complex frequencies that broadcast with the loop's batch."""
    p, a = loop.plant, loop.autopilot
    n, n_tanks, slosh = p.mass.shape[-1], len(p.tanks), p.slosh
    s = np.asarray(s, dtype=complex)
    S = s[..., None, None]
    D = S * S * p.mass + S * p.damping + p.stiffness
    diagonal = np.arange(n)[slosh]
    D[..., diagonal, diagonal] += s[..., None] * (2.0 * REFERENCE_DAMPING * p.tank_frequency * p.tank_mass)
    right = np.zeros((*D.shape[:-1], 1 + n_tanks), dtype=complex)
    right[..., 0] = p.force
    right[..., diagonal, np.arange(n_tanks) + 1] = p.tank_mass
    q = np.linalg.solve(D, right)
    sensed = np.asarray(a.attitude_gain) + np.asarray(a.rate_gain) * s
    y = sensed[..., None] * np.einsum("i,...ij->...j", p.attitude, q)
    y_b, Y_a = y[..., 0], y[..., 1:]
    z_b, Z_a = q[..., slosh, 0], q[..., slosh, 1:]
    sd = s[..., None] * (2.0 * (loop.damping - REFERENCE_DAMPING) * p.tank_frequency)
    if n_tanks == 1:
        closure = 1.0 + sd * Z_a[..., 0]
        with np.errstate(divide="ignore", invalid="ignore"):  # infinite on an undamped pole, as it must be
            z = z_b / closure
            y_a = Y_a / closure
            y_all = y_b - (Y_a * sd * z)[..., 0]
    else:
        matrix = np.eye(n_tanks) + Z_a * sd[..., None, :]
        z = np.linalg.solve(matrix, z_b[..., None])[..., 0]
        y_a = np.linalg.solve(np.swapaxes(np.eye(n_tanks) + sd[..., :, None] * Z_a, -1, -2), Y_a[..., None])[..., 0]
        y_all = y_b - np.sum(Y_a * sd * z, axis=-1)
    K = forward_transfer(a, s)
    stiffness_change = 2.0 * p.tank_frequency * (p.tank_frequency + loop.damping * s[..., None])
    with np.errstate(invalid="ignore"):  # likewise
        return Transfer(loop=-K * y_all, slosh=z, sensitivity=K[..., None] * y_a * stiffness_change * z)


@dataclass(frozen=True, kw_only=True)
class FrequencyResponse:
    """Loop and slosh response on frequencies, batch axes first, frequency last.

    omega: (..., F), rad/s. loop: L(j omega), (..., F). slosh: z_j/beta, (..., F, n_tanks), m/rad.
    """

    omega: Array
    loop: ComplexArray
    slosh: ComplexArray
    tanks: tuple[str, ...]
    damping: Array

    @property
    def f_hz(self) -> Array:
        """Frequencies in Hz."""
        return self.omega / (2.0 * np.pi)

    @property
    def gain_db(self) -> Array:
        """20 log10 |L|."""
        return np.asarray(20.0 * np.log10(np.abs(self.loop)))

    @property
    def phase_deg(self) -> Array:
        """Phase of L in degrees, continuous along frequency, on the branch whose mean is nearest -180 deg."""
        phase = np.unwrap(np.angle(self.loop), axis=-1)
        turns = np.round((np.mean(phase, axis=-1, keepdims=True) + np.pi) / (2.0 * np.pi))
        return np.degrees(phase - 2.0 * np.pi * turns)


def frequency_response(loop: Loop, omega: Array) -> FrequencyResponse:
    """Return the response of a loop, or of a batch, at angular frequencies (..., F) in rad/s."""
    omega = np.asarray(omega, dtype=float)
    if np.any(omega <= 0.0) or not np.all(np.isfinite(omega)):
        raise ValueError("frequencies must be finite and > 0 rad/s")
    parts = transfer(loop.along(), 1j * omega)
    return FrequencyResponse(
        omega=omega, loop=parts.loop, slosh=parts.slosh, tanks=loop.plant.tanks, damping=loop.damping
    )
