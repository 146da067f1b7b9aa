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
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.autopilot import forward_transfer
from sloshpy.dynamics.loop import Loop
from sloshpy.units import Array, ComplexArray

if TYPE_CHECKING:
    import xarray as xr

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
    Y_b, Y_a, z_b, Z_a = at_reference(loop, s)
    sd = s[..., None] * excess_damping(loop)
    if sd.shape[-1] == 1:
        # one tank: a ratio of first-degree polynomials in the damping, kept to few operations on the full batch
        with np.errstate(divide="ignore", invalid="ignore"):  # infinite on an undamped pole, as it must be
            z = z_b[..., 0] / (1.0 + sd[..., 0] * Z_a[..., 0, 0])
            return Transfer(loop=(s * Y_a[..., 0]) * excess_damping(loop)[..., 0] * z - Y_b, slosh=z[..., None])
    several = _closed(np.asarray(np.eye(sd.shape[-1]) + Z_a * sd[..., None, :], dtype=complex), z_b)
    with np.errstate(invalid="ignore"):  # as above
        return Transfer(loop=np.sum(Y_a * sd * several, axis=-1) - Y_b, slosh=several)


def _closed(closure: ComplexArray, right: ComplexArray) -> ComplexArray:
    """Solve closure z = right at every point; infinite where a point lies exactly on an undamped pole."""
    try:
        return np.asarray(np.linalg.solve(closure, right[..., None])[..., 0])
    except np.linalg.LinAlgError:
        on = (np.linalg.det(closure) == 0.0)[..., None]
        z = np.linalg.solve(np.where(on[..., None], np.eye(closure.shape[-1]), closure), right[..., None])[..., 0]
        return np.where(on, np.inf, z)


def tank_sensitivity(loop: Loop, s: ComplexArray) -> ComplexArray:
    """Return dL/d(ln w_j) at complex frequencies, (..., n_tanks): how L changes with each tank's frequency."""
    s = np.asarray(s, dtype=complex)
    p = loop.plant
    _, Y_a, _, Z_a = at_reference(loop, s)
    sd = s[..., None] * excess_damping(loop)
    closure = np.swapaxes(np.eye(sd.shape[-1]) + sd[..., :, None] * Z_a, -1, -2)
    y_a = np.linalg.solve(closure, Y_a[..., None])[..., 0]
    stiffness_change = 2.0 * p.tank_frequency * (p.tank_frequency + loop.damping * s[..., None])
    return np.asarray(y_a * stiffness_change * transfer(loop, s).slosh)


def excess_damping(loop: Loop) -> Array:
    """Return d_j = 2 (xi_j - xi_ref) w_j, 1/s."""
    return np.asarray(2.0 * (loop.damping - REFERENCE_DAMPING) * loop.plant.tank_frequency)


def at_reference(loop: Loop, s: ComplexArray) -> tuple[ComplexArray, ...]:
    """Return K y_b, K Y_a, z_b and Z_a with every tank at the reference damping; the batch's damping plays no part."""
    p, a = loop.plant, loop.autopilot
    K = forward_transfer(a, s) * (np.asarray(a.attitude_gain) + np.asarray(a.rate_gain) * s)
    q = _two_coordinates(loop, s) if p.mass.shape[-1] == 2 and len(p.tanks) == 1 else _coordinates(loop, s)
    Y = K[..., None] * sum(p.attitude[i] * q[..., i, :] for i in np.flatnonzero(p.attitude))
    return Y[..., 0], Y[..., 1:], q[..., p.slosh, 0], q[..., p.slosh, 1:]


def _reference_damping(loop: Loop) -> Array:
    return np.asarray(2.0 * REFERENCE_DAMPING * loop.plant.tank_frequency * loop.plant.tank_mass)


def _coordinates(loop: Loop, s: ComplexArray) -> ComplexArray:
    """Return q for a unit engine angle and for unit accelerations on the slosh masses, (..., n, 1 + n_tanks)."""
    p, S = loop.plant, s[..., None, None]
    n, n_tanks = p.mass.shape[-1], len(p.tanks)
    D = np.asarray(S * S * p.mass + S * p.damping + p.stiffness, dtype=complex)
    diagonal = np.arange(n)[p.slosh]
    D[..., diagonal, diagonal] = D[..., diagonal, diagonal] + s[..., None] * _reference_damping(loop)
    right = np.zeros((*D.shape[:-1], 1 + n_tanks), dtype=complex)
    right[..., 0] = p.force
    right[..., diagonal, np.arange(n_tanks) + 1] = p.tank_mass
    return np.asarray(np.linalg.solve(D, right))


def _two_coordinates(loop: Loop, s: ComplexArray) -> ComplexArray:
    """Return the same for one tank on a rigid vehicle, by Cramer's rule: ten times as fast on a long batch."""
    p, squared = loop.plant, s * s
    damping = p.damping + np.diag([0.0, 1.0]) * _reference_damping(loop)[..., None]
    (d00, d01), (d10, d11) = (
        [squared * p.mass[..., i, j] + s * damping[..., i, j] + p.stiffness[..., i, j] for j in (0, 1)] for i in (0, 1)
    )
    inverse = 1.0 / (d00 * d11 - d01 * d10)
    b0, b1, m = p.force[..., 0], p.force[..., 1], p.tank_mass[..., 0]
    q = np.empty((*inverse.shape, 2, 2), dtype=complex)
    q[..., 0, 0], q[..., 1, 0] = (d11 * b0 - d01 * b1) * inverse, (d00 * b1 - d10 * b0) * inverse
    q[..., 0, 1], q[..., 1, 1] = -d01 * (m * inverse), d00 * (m * inverse)
    return q


@dataclass(frozen=True, kw_only=True)
class FrequencyResponse:
    """Loop and slosh response on frequencies, batch axes first, frequency last.

    omega: (..., F), rad/s. loop: L(j omega), (..., F). slosh: z_j/beta, (..., F, n_tanks), m/rad.
    source: the loop it was made from.
    """

    omega: Array
    loop: ComplexArray
    slosh: ComplexArray
    source: Loop

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

    def __str__(self) -> str:
        low, high = np.min(self.f_hz), np.max(self.f_hz)
        count, size = self.loop.shape[-1], int(np.prod(self.loop.shape[:-1]))
        return (
            f"Frequency response of {size} loop{'s' if size > 1 else ''} at {count} frequencies, "
            f"{low:.4g} to {high:.4g} Hz; gain {np.min(self.gain_db):.2f} to {np.max(self.gain_db):.2f} dB"
        )

    def to_dataset(self) -> "xr.Dataset":
        """Return the response as an xarray Dataset; real and imaginary parts apart, as NetCDF wants them."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        axes = [*(f"batch_{i}" for i in range(self.loop.ndim - 1)), "frequency"]
        return xr.Dataset(
            {
                "omega": (axes[-self.omega.ndim :], self.omega, {"units": "rad/s"}),
                "loop_real": (axes, self.loop.real, {"units": "1"}),
                "loop_imag": (axes, self.loop.imag, {"units": "1"}),
                "slosh_real": ([*axes, "tank"], self.slosh.real, {"units": "m/rad"}),
                "slosh_imag": ([*axes, "tank"], self.slosh.imag, {"units": "m/rad"}),
            },
            coords={"tank": list(self.source.plant.tanks)},
        )


def frequency_response(loop: Loop, omega: Array) -> FrequencyResponse:
    """Return the response of a loop, or of a batch, at angular frequencies (..., F) in rad/s."""
    omega = np.asarray(omega, dtype=float)
    if np.any(omega <= 0.0) or not np.all(np.isfinite(omega)):
        raise ValueError("frequencies must be finite and > 0 rad/s")
    parts = transfer(loop.along(), 1j * omega)
    return FrequencyResponse(omega=omega, loop=parts.loop, slosh=parts.slosh, source=loop)
