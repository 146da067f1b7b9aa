"""The exact characteristic function of the loop, delay included, and its roots by Newton's method."""

import numpy as np

from sloshpy.autopilot.transfer import forward_fraction
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.plant import slosh_damping
from sloshpy.dynamics.sensed import bordering_row
from sloshpy.units import ComplexArray


def characteristic_matrix(loop: Loop, s: ComplexArray, closed: bool = True) -> tuple[ComplexArray, ComplexArray]:
    """Return T(s) with det T(s) = 0 at the loop's exact poles, delay included, and dT/ds.

    T is the dynamic stiffness of the plant bordered by the forward path n(s)/d(s):

        [ D(s)          -b - s^2 b2          ] [q   ]
        [ -n(s) row(s)   d(s) - n(s) felt(s) ] [beta] = 0

    with what the autopilot is fed, row(s) q + felt(s) beta, from `sensed`.

    It is entire in s, so that no pole of the broken loop needs care. Where Z enters by its velocity alone, Z' is the
    unknown in its place. `s` broadcasts with the loop's batch.
    """
    p = loop.plant
    n = p.mass.shape[-1]
    s = np.asarray(s, dtype=complex)
    S = s[..., None, None]
    diagonal = np.arange(n)[p.slosh]
    slosh = slosh_damping(p, loop.damping)
    top, bottom, dtop, dbottom = forward_fraction(loop.autopilot, s)
    shape = np.broadcast_shapes(s.shape, loop.batch)
    T, dT = np.zeros((*shape, n + 1, n + 1), dtype=complex), np.zeros((*shape, n + 1, n + 1), dtype=complex)
    T[..., :n, :n] = S * S * p.mass + S * p.damping + p.stiffness
    dT[..., :n, :n] = 2.0 * S * p.mass + p.damping
    if p.velocity_only:
        T[..., :n, 0], dT[..., :n, 0] = s[..., None] * p.mass[..., :, 0] + p.damping[..., :, 0], p.mass[..., :, 0]
    T[..., diagonal, diagonal] += s[..., None] * slosh
    dT[..., diagonal, diagonal] += slosh
    T[..., n, n], dT[..., n, n] = bottom, dbottom
    if closed:
        row, by_s = bordering_row(loop, s)
        T[..., :n, n], dT[..., :n, n] = -p.engine_force(s), -2.0 * s[..., None] * p.inertial_force
        T[..., n, :] -= top[..., None] * row
        dT[..., n, :] -= dtop[..., None] * row + top[..., None] * by_s
    return T, dT


def polish(loop: Loop, s: ComplexArray, closed: bool = True) -> ComplexArray:
    """Return roots of det T(s) = 0 near the given ones by Newton's method; nan where it does not converge.

    The Newton step of a determinant is 1 / trace(T^-1 dT/ds).
    """
    s = np.array(s, dtype=complex)
    converged = np.zeros(s.shape, dtype=bool)
    scale = np.maximum(np.abs(s), 1e-3)  # rad/s: a pole closer to the origin than this is judged absolutely
    for _ in range(30):
        with np.errstate(all="ignore"):  # far left exp(-s tau) overflows: no root there is ours, and nan says so
            T, dT = characteristic_matrix(loop, s, closed)
            try:
                trace = np.trace(np.linalg.solve(T, dT), axis1=-2, axis2=-1)
            except np.linalg.LinAlgError:  # some stand exactly on a root: they are done, the rest goes on
                on = np.linalg.det(T) == 0.0
                converged |= on
                trace = np.trace(
                    np.linalg.solve(np.where(on[..., None, None], np.eye(T.shape[-1]), T), dT), axis1=-2, axis2=-1
                )
            step = np.where(converged, 0.0, 1.0 / trace)
        step = np.where(np.isfinite(step), step, np.nan)
        size = np.abs(step) / scale
        s = s - step * np.minimum(1.0, 0.3 / np.maximum(size, 1e-300))
        converged |= size < 1e-13
        if np.all(converged | np.isnan(s)):
            break
        converged |= size < 1e-12
    return np.where(converged | (size < 1e-9), s, np.nan)
