"""Exact frequency response of the loop with the slosh damping pulled out of the plant.

With every tank at a reference damping the plant is solved once at each frequency, for the engine angle and for a unit
acceleration u on each slosh mass; K is the forward path and y what it is fed (see `sensed`):

    z = z_b beta + Z_a u ,   K y = Y_b beta + Y_a u

The true damping is the feedback u_j = -s d_j z_j with d_j = 2 (xi_j - xi_ref) w_j, so that any damping costs a solve of
the size of the number of tanks:

    z/beta = (1 + Z_a s d)^-1 z_b ,   L = -K y/beta = Y_a s d z/beta - Y_b

The reference is far from zero, so that the solve at a resonance does not cancel digits.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sloshpy.autopilot import forward_transfer
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.plant import slosh_damping
from sloshpy.dynamics.sensed import sensed_row
from sloshpy.units import Array, ComplexArray, Real

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
    if len(loop.plant.tanks) != 1 and np.broadcast_shapes(loop.damping.shape[:-1], s.shape) == _plants(loop, s):
        return _direct(loop, s)
    y, z = closed_by_damping(s[..., None] * excess_damping(loop), at_reference(loop, s))
    return Transfer(loop=-y, slosh=z)


def closed_by_damping(sd: ComplexArray, parts: tuple[ComplexArray, ...]) -> tuple[ComplexArray, ComplexArray]:
    """Return what the autopilot is fed, and each z, of beta with the damping fed back that the reference lacks.

    sd: s d_j, (..., n_tanks). parts: those of `at_reference` or of `unfed`; their shapes broadcast.
    """
    y_b, Y_a, z_b, Z_a = parts
    with np.errstate(divide="ignore", invalid="ignore"):  # infinite on an undamped pole, as it must be
        if sd.shape[-1] == 1:
            # one tank: a ratio of first-degree polynomials in the damping, kept to few operations on the full batch
            only = z_b[..., 0] / (1.0 + sd[..., 0] * Z_a[..., 0, 0])
            return y_b - Y_a[..., 0] * sd[..., 0] * only, only[..., None]
        z = _closed(np.asarray(np.eye(sd.shape[-1]) + Z_a * sd[..., None, :], dtype=complex), z_b)
        return np.asarray(y_b - np.sum(Y_a * sd * z, axis=-1)), z


def _plants(loop: Loop, s: ComplexArray) -> tuple[int, ...]:
    """Return the shape of the plants that differ but for the slosh damping, each at its own frequencies."""
    p = loop.plant
    return np.broadcast_shapes(p.mass.shape[:-2], p.stiffness.shape[:-2], s.shape)


def _direct(loop: Loop, s: ComplexArray) -> Transfer:
    """Return the same where no two dampings share a plant and a frequency: one solve at the damping itself."""
    p = loop.plant
    D, right = _stiffness(loop, s, loop.damping), p.engine_force(s)
    with np.errstate(invalid="ignore"):  # infinite on an undamped pole, as it must be
        q = _closed(D, np.broadcast_to(right, (*D.shape[:-2], right.shape[-1])))
        row, at_once = sensed_row(loop, s)
        L = -forward_transfer(loop.autopilot, s) * (np.sum(row * q, axis=-1) + at_once)
    return Transfer(loop=np.asarray(L), slosh=q[..., p.slosh])


def _closed(closure: ComplexArray, right: ComplexArray) -> ComplexArray:
    """Solve closure z = right at every point; infinite where a point lies exactly on an undamped pole."""
    try:
        return np.asarray(np.linalg.solve(closure, right[..., None])[..., 0])
    except np.linalg.LinAlgError:
        on = (np.linalg.det(closure) == 0.0)[..., None]
        z = np.linalg.solve(np.where(on[..., None], np.eye(closure.shape[-1]), closure), right[..., None])[..., 0]
        return np.where(on, np.inf, z)


def frequency_sensitivity(loop: Loop, s: ComplexArray) -> ComplexArray:
    """Return dL/d(ln w) at complex frequencies for each tank's slosh and then each bending mode, (..., n_groups).

    Raising w_g adds dD to one diagonal entry of the dynamic stiffness, and L changes by
    K (row D^-1 e_g) dD (q_g/beta). What y feels of beta at once does not depend on it.
    """
    s = np.asarray(s, dtype=complex)
    p = loop.plant
    n, first = p.mass.shape[-1], p.first_tank
    D = _stiffness(loop, s, loop.damping)
    right = np.zeros((*D.shape[:-1], 1 + n - first), dtype=complex)
    right[..., 0] = p.engine_force(s)
    right[..., np.arange(first, n), np.arange(1, 1 + n - first)] = 1.0
    q = np.linalg.solve(D, right)
    y = np.sum(sensed_row(loop, s)[0][..., None] * q[..., 1:], axis=-2)
    own = np.arange(first, n)
    diagonal = 2.0 * p.stiffness[..., own, own] + s[..., None] * p.damping[..., own, own]
    tanks = np.arange(len(p.tanks))
    diagonal = np.broadcast_to(diagonal, y.shape).astype(complex)
    diagonal[..., tanks] += s[..., None] * slosh_damping(p, loop.damping)
    return np.asarray(forward_transfer(loop.autopilot, s)[..., None] * y * diagonal * q[..., first:, 0])


def excess_damping(loop: Loop) -> Array:
    """Return d_j = 2 (xi_j - xi_ref) w_j, 1/s."""
    return np.asarray(2.0 * (loop.damping - REFERENCE_DAMPING) * loop.plant.tank_frequency)


def at_reference(loop: Loop, s: ComplexArray, ratio: Real = REFERENCE_DAMPING) -> tuple[ComplexArray, ...]:
    """Return K y_b, K Y_a, z_b and Z_a with every tank at a reference damping; the batch's damping plays no part.

    ratio: damping ratios, one for all tanks or (..., n_tanks).
    """
    y_b, Y_a, z_b, Z_a = unfed(loop, s, ratio)
    K = forward_transfer(loop.autopilot, s)
    return K * y_b, K[..., None] * Y_a, z_b, Z_a


def unfed(loop: Loop, s: ComplexArray, ratio: Real) -> tuple[ComplexArray, ...]:
    """Return y_b, Y_a, z_b and Z_a: `at_reference` before the forward path."""
    p = loop.plant
    row, at_once = sensed_row(loop, s)
    if p.mass.shape[-1] == 2 and len(p.tanks) == 1:
        (phi_b, z_b), (phi_a, z_a) = _two_coordinates(loop, s, ratio)
        y_b, y_a = (row[..., 0] * phi + row[..., 1] * z for phi, z in ((phi_b, z_b), (phi_a, z_a)))
        if not isinstance(at_once, float):
            y_b = y_b + at_once
        return y_b, y_a[..., None], z_b[..., None], z_a[..., None, None]
    q = _coordinates(loop, s, ratio)
    y = np.sum(row[..., None] * q, axis=-2)
    return y[..., 0] + at_once, y[..., 1:], q[..., p.slosh, 0], q[..., p.slosh, 1:]


def of_one_damping(loop: Loop, tank: int, s: ComplexArray) -> tuple[ComplexArray, ...]:
    """Return K y_b, K y_a, z_b and z_a of one tank at the reference damping, the other tanks at the loop's own.

    For any damping of that tank, d as in `excess_damping`: z/beta = z_b / (1 + s d z_a), L = K y_a s d z/beta - K y_b.
    """
    s = np.asarray(s, dtype=complex)
    p = loop.plant
    ratio = loop.damping.copy()
    ratio[..., tank] = REFERENCE_DAMPING
    D = _stiffness(loop, s, ratio)
    right = np.zeros((*D.shape[:-1], 2), dtype=complex)
    right[..., 0] = p.engine_force(s)
    right[..., p.first_tank + tank, 1] = p.tank_mass[..., tank]
    q = np.linalg.solve(D, right)
    row, at_once = sensed_row(loop, s)
    K = forward_transfer(loop.autopilot, s)
    y, z = np.sum(row[..., None] * q, axis=-2), q[..., p.first_tank + tank, :]
    return K * (y[..., 0] + at_once), K * y[..., 1], z[..., 0], z[..., 1]


def _stiffness(loop: Loop, s: ComplexArray, ratio: Real) -> ComplexArray:
    """Return the dynamic stiffness of the plant with slosh damping ratios, (..., n, n)."""
    p, S = loop.plant, s[..., None, None]
    D = np.asarray(S * S * p.mass + S * p.damping + p.stiffness, dtype=complex)
    damping = slosh_damping(p, np.asarray(ratio))
    shape = np.broadcast_shapes(D.shape[:-2], damping.shape[:-1])
    D = np.broadcast_to(D, (*shape, *D.shape[-2:])).copy() if shape != D.shape[:-2] else D
    diagonal = np.arange(D.shape[-1])[p.slosh]
    D[..., diagonal, diagonal] = D[..., diagonal, diagonal] + s[..., None] * damping
    return D


def _coordinates(loop: Loop, s: ComplexArray, ratio: Real) -> ComplexArray:
    """Return q for a unit engine angle and for unit accelerations on the slosh masses, (..., n, 1 + n_tanks)."""
    p = loop.plant
    n_tanks = len(p.tanks)
    D = _stiffness(loop, s, ratio)
    right = np.zeros((*D.shape[:-1], 1 + n_tanks), dtype=complex)
    right[..., 0] = p.engine_force(s)
    right[..., np.arange(p.first_tank, p.first_tank + n_tanks), np.arange(n_tanks) + 1] = p.tank_mass
    return np.asarray(np.linalg.solve(D, right))


def _two_coordinates(loop: Loop, s: ComplexArray, ratio: Real) -> tuple[tuple[ComplexArray, ComplexArray], ...]:
    """Return (phi, z) for each of the two, one tank on a rigid vehicle, by Cramer's rule: ten times as fast."""
    p = loop.plant
    squared: Any = s * s if np.any(s.real) else -(s.imag**2)  # real on the axis, which halves the work
    damping = p.damping + np.diag([0.0, 1.0]) * slosh_damping(p, np.asarray(ratio))[..., None]

    def entry(i: int, j: int) -> Any:
        plain = squared * p.mass[..., i, j] + p.stiffness[..., i, j]
        return plain + s * damping[..., i, j] if np.any(damping[..., i, j]) else plain

    d00, d01, d10, d11 = entry(0, 0), entry(0, 1), entry(1, 0), entry(1, 1)
    inverse = 1.0 / (d00 * d11 - d01 * d10)
    b0, b1 = (p.force[..., i] + squared * p.inertial_force[..., i] for i in (0, 1))
    m = p.tank_mass[..., 0] * inverse
    return ((d11 * b0 - d01 * b1) * inverse, (d00 * b1 - d10 * b0) * inverse), (-d01 * m, d00 * m)


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
