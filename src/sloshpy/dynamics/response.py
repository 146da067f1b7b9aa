"""Exact frequency response of the loop with the slosh damping pulled out of the plant.

With every tank at a reference damping the plant is solved once at each frequency, for the engine angle and for a unit
acceleration u on each slosh mass; K is the forward path and y = a0 phi + a1 phi' what it is given:

    z = z_b beta + Z_a u ,   K y = Y_b beta + Y_a u

The true damping is the feedback u_j = -s d_j z_j with d_j = 2 (xi_j - xi_ref) w_j, so that any damping costs a solve of
the size of the number of tanks:

    z/beta = (1 + Z_a s d)^-1 z_b ,   L = -K y/beta = Y_a s d z/beta - Y_b

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
    """Loop transfer and slosh response at complex frequencies; shapes follow the loop's batch broadcast with s.

    loop: L(s). slosh: z_j/beta, (..., n_tanks), m/rad.
    """

    loop: ComplexArray
    slosh: ComplexArray


def transfer(loop: Loop, s: ComplexArray) -> Transfer:
    """Return L(s) and z_j/beta at complex frequencies that broadcast with the loop's batch."""
    s = np.asarray(s, dtype=complex)
    Y_b, Y_a, z_b, Z_a = _at_reference(loop, s)
    sd = s[..., None] * _excess(loop)
    if sd.shape[-1] == 1:
        # one tank: a ratio of first-degree polynomials in the damping, kept to few operations on the full batch
        with np.errstate(divide="ignore", invalid="ignore"):  # infinite on an undamped pole, as it must be
            z = z_b[..., 0] / (1.0 + sd[..., 0] * Z_a[..., 0, 0])
            return Transfer(loop=(s * Y_a[..., 0]) * _excess(loop)[..., 0] * z - Y_b, slosh=z[..., None])
    z = np.linalg.solve(np.eye(sd.shape[-1]) + Z_a * sd[..., None, :], z_b[..., None])[..., 0]
    return Transfer(loop=np.sum(Y_a * sd * z, axis=-1) - Y_b, slosh=z)


def tank_sensitivity(loop: Loop, s: ComplexArray) -> ComplexArray:
    """Return dL/d(ln w_j) at complex frequencies, (..., n_tanks): how L changes with each tank's frequency."""
    s = np.asarray(s, dtype=complex)
    p = loop.plant
    _, Y_a, _, Z_a = _at_reference(loop, s)
    sd = s[..., None] * _excess(loop)
    closure = np.swapaxes(np.eye(sd.shape[-1]) + sd[..., :, None] * Z_a, -1, -2)
    y_a = np.linalg.solve(closure, Y_a[..., None])[..., 0]
    stiffness_change = 2.0 * p.tank_frequency * (p.tank_frequency + loop.damping * s[..., None])
    return np.asarray(y_a * stiffness_change * transfer(loop, s).slosh)


def _excess(loop: Loop) -> Array:
    """Return d_j = 2 (xi_j - xi_ref) w_j, 1/s."""
    return np.asarray(2.0 * (loop.damping - REFERENCE_DAMPING) * loop.plant.tank_frequency)


def _at_reference(loop: Loop, s: ComplexArray) -> tuple[ComplexArray, ...]:
    """Return K y_b, K Y_a, z_b and Z_a with every tank at the reference damping; the batch's damping plays no part."""
    p, a = loop.plant, loop.autopilot
    n, n_tanks, slosh = p.mass.shape[-1], len(p.tanks), p.slosh
    S = s[..., None, None]
    D = np.asarray(S * S * p.mass + S * p.damping + p.stiffness, dtype=complex)
    diagonal = np.arange(n)[slosh]
    reference = 2.0 * REFERENCE_DAMPING * p.tank_frequency * p.tank_mass
    D[..., diagonal, diagonal] = D[..., diagonal, diagonal] + s[..., None] * reference
    right = np.zeros((*D.shape[:-1], 1 + n_tanks), dtype=complex)
    right[..., 0] = p.force
    right[..., diagonal, np.arange(n_tanks) + 1] = p.tank_mass
    q = np.linalg.solve(D, right)
    K = forward_transfer(a, s) * (np.asarray(a.attitude_gain) + np.asarray(a.rate_gain) * s)
    Y = K[..., None] * np.einsum("i,...ij->...j", p.attitude, q)
    return Y[..., 0], Y[..., 1:], q[..., slosh, 0], q[..., slosh, 1:]


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
        return np.asarray(np.degrees(phase - 2.0 * np.pi * turns))


def frequency_response(loop: Loop, omega: Array) -> FrequencyResponse:
    """Return the response of a loop, or of a batch, at angular frequencies (..., F) in rad/s."""
    omega = np.asarray(omega, dtype=float)
    if np.any(omega <= 0.0) or not np.all(np.isfinite(omega)):
        raise ValueError("frequencies must be finite and > 0 rad/s")
    parts = transfer(loop.along(), 1j * omega)
    return FrequencyResponse(
        omega=omega, loop=parts.loop, slosh=parts.slosh, tanks=loop.plant.tanks, damping=loop.damping
    )
