"""What the autopilot is fed, a0 phi + a1 phi' + a2 acc + b0 Z + b1 Z', written once for all who need it.

    y = (r_0 + s r_1 + s^2 r_2) [q, beta]                   as rows of the equations of motion
    x' = A x + B beta + B2 beta'' ,   y = c x + d beta + d2 beta''        as an output of their states

beta enters y where the accelerometer feels it at once: Z'' holds the thrust and the inertia of the engine.
"""

from dataclasses import dataclass

import numpy as np

from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.plant import inertial_input, state_space
from sloshpy.units import Array, ComplexArray


def sensed(loop: Loop) -> Array:
    """Return the coefficients of s^0, s^1 and, with an accelerometer fed back, s^2 on [q, beta], (..., k, n + 1)."""
    p, a = loop.plant, loop.autopilot
    position = np.asarray(a.attitude_gain)[..., None] * p.attitude
    velocity = np.asarray(a.rate_gain)[..., None] * p.rate
    if np.any(a.drift_gain) or np.any(a.drift_rate_gain):
        if not p.guided:
            raise ValueError("the drift is fed back, but the plant has lost it; make the loop with open_loop")
        lateral = np.eye(p.mass.shape[-1])[0]
        position = position + np.asarray(a.drift_gain)[..., None] * lateral
        velocity = velocity + np.asarray(a.drift_rate_gain)[..., None] * lateral
    parts = [position.shape[:-1], velocity.shape[:-1]]
    felt = None
    if p.accelerometer is not None and np.any(a.accelerometer_gain):
        felt = np.asarray(a.accelerometer_gain)[..., None, None] * p.accelerometer
        parts.append(felt.shape[:-2])
    rows = np.zeros((*np.broadcast_shapes(*parts), 2 if felt is None else 3, p.mass.shape[-1] + 1))
    rows[..., 0, :-1], rows[..., 1, :-1] = position, velocity
    return rows if felt is None else rows + felt


def sensed_row(loop: Loop, s: ComplexArray) -> tuple[ComplexArray, ComplexArray | float]:
    """Return the row of y on q at s, (..., n), and y per engine angle at rest of q, (...)."""
    rows, S = sensed(loop), s[..., None]
    if rows.shape[-2] == 2:  # beta is not felt: the surveys of one tank rest on this being little work
        return np.asarray(rows[..., 0, :-1] + S * rows[..., 1, :-1]), 0.0
    row = rows[..., 0, :] + S * (rows[..., 1, :] + S * rows[..., 2, :])
    return np.asarray(row[..., :-1]), np.asarray(row[..., -1])


def bordering_row(loop: Loop, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return the row of y on [q, beta] at s and its derivative by s, (..., n + 1).

    Where Z enters by its velocity alone, Z' is the unknown in its place.
    """
    rows, S = sensed(loop), s[..., None]
    r0, r1 = rows[..., 0, :], rows[..., 1, :]
    r2 = rows[..., 2, :] if rows.shape[-2] == 3 else np.zeros_like(r1)
    row, by_s = r0 + S * (r1 + S * r2), r1 + 2.0 * S * r2
    if loop.plant.velocity_only:
        row[..., 0], by_s[..., 0] = r1[..., 0] + s * r2[..., 0], r2[..., 0]
    return row, np.asarray(by_s, dtype=complex)


@dataclass(frozen=True, kw_only=True)
class Fed:
    """States of the plant and what the autopilot is fed of them, (..., N, N), (..., N) and (...).

    x' = A x + B beta + B2 beta'', y = c x + d beta + d2 beta''; x = [q, q'] as in `state_space`.
    acceleration: (..., n), the part of y that is a row on q'', already in c, d and d2; None without an accelerometer.
    """

    A: Array
    B: Array
    B2: Array
    c: Array
    d: Array
    d2: Array
    acceleration: Array | None


def fed(loop: Loop, damping: Array | None = None) -> Fed:
    """Return the plant of a loop as states with the output y; `damping` in place of the loop's own slosh damping."""
    A, B, _ = state_space(loop.plant, loop.damping if damping is None else damping)
    B2, rows, n = inertial_input(loop.plant), sensed(loop), loop.plant.mass.shape[-1]
    first = int(loop.plant.velocity_only)
    c = np.concatenate([rows[..., 0, first:-1], rows[..., 1, :-1]], axis=-1)
    d, d2 = rows[..., 0, -1], np.zeros(rows.shape[:-2])
    acceleration = None
    if rows.shape[-2] == 3:
        acceleration = rows[..., 2, :-1]
        c = c + np.einsum("...i,...ij->...j", acceleration, A[..., -n:, :])
        d = d + np.sum(acceleration * B[..., -n:], axis=-1)
        d2 = rows[..., 2, -1] + np.sum(acceleration * B2[..., -n:], axis=-1)
    return Fed(A=A, B=B, B2=B2, c=c, d=d, d2=d2, acceleration=acceleration)
