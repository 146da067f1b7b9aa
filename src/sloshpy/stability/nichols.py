"""Distance from the critical point in the margin-normalised Nichols plane, eq 24, and curves sampled to find it."""

from dataclasses import dataclass

import numpy as np

from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.plant import state_space
from sloshpy.dynamics.poles import system_matrix
from sloshpy.dynamics.response import transfer
from sloshpy.units import Array, ComplexArray, IntArray, Real


def nichols_disc_margin(loop: ComplexArray, gain_margin: Real, phase_margin: Real) -> Array:
    """Return DM = hypot(20 log10|L| / GM_d, dphi / PM_d), eq 24.

    dphi is the distance of the phase to the nearest odd multiple of 180 deg, taken as the angle of -L, which needs no
    modulus. DM is a distance: it does not know on which side of the critical point the curve passes.

    Args:
        loop: L(j omega), any shape.
        gain_margin: wanted gain margin as an amplitude ratio (6 dB is 1.995).
        phase_margin: wanted phase margin in rad.
    """
    # written out: abs and hypot of numpy guard against overflow that no loop comes near, at three times the cost
    gain = np.log(loop.real**2 + loop.imag**2) * (0.5 / np.log(gain_margin))
    phase = np.arctan2(-loop.imag, -loop.real) / phase_margin
    return np.asarray(np.sqrt(gain * gain + phase * phase))


@dataclass(frozen=True, kw_only=True)
class Curves:
    """Loop responses of a flattened batch, sorted by loop and then by frequency.

    index: which loop of the flattened batch each point belongs to. omega: rad/s. loop: L(j omega).
    """

    index: IntArray
    omega: Array
    loop: ComplexArray

    def pairs(self) -> IntArray:
        """Return the positions k for which k and k+1 are neighbours on one curve."""
        return np.flatnonzero(self.index[1:] == self.index[:-1])


def sampled(loop: Loop, gain_margin: float, phase_margin: float) -> Curves:
    """Sample every loop of a batch so densely that no feature of eq 24 is missed.

    Frequencies start from the poles and zeros of the loop, open and closed, in steps of their own half-width. Then
    every piece whose ends lie farther apart in the normalised Nichols plane than a fraction of their distance to the
    critical point is halved, until none is left.
    """
    index, omega = _placed(loop)
    response = transfer(loop.take(index), 1j * omega).loop
    finite = np.isfinite(response) & (response != 0.0)
    index, omega, response = index[finite], omega[finite], response[finite]
    for _ in range(40):
        near = index[1:] == index[:-1]
        step = np.log(response[1:] / response[:-1])
        chord = np.hypot(step.real / np.log(gain_margin), step.imag / phase_margin)
        distance = nichols_disc_margin(response, gain_margin, phase_margin)
        allowed = 0.15 + 0.4 * np.minimum(distance[1:], distance[:-1])
        wide = near & (chord > allowed) & (omega[1:] > omega[:-1] * (1.0 + 1e-9))
        k = np.flatnonzero(wide)
        if len(k) == 0:
            break
        middle, owner = np.sqrt(omega[k] * omega[k + 1]), index[k]
        added = transfer(loop.take(owner), 1j * middle).loop
        index, omega = np.insert(index, k + 1, owner), np.insert(omega, k + 1, middle)
        response = np.insert(response, k + 1, added)
    return Curves(index=index, omega=omega, loop=response)


def _placed(loop: Loop) -> tuple[IntArray, Array]:
    """Return first frequencies of each loop of the flattened batch: clusters about its poles and zeros."""
    batch = loop.batch
    broken, _ = system_matrix(loop, closed=False)
    closed, _ = system_matrix(loop)
    features = [np.linalg.eigvals(broken), np.linalg.eigvals(closed), _zeros(loop)]
    p = np.concatenate([np.broadcast_to(f, (*batch, f.shape[-1])).reshape(-1, f.shape[-1]) for f in features], axis=-1)
    size = np.abs(p)
    own = np.where(size > 1e-5 * np.max(size, axis=-1, keepdims=True), size, np.nan)  # rigid-body zeros place nothing
    low, high = np.nanmin(own, axis=-1), np.nanmax(own, axis=-1)
    low, high = low * 1e-2, _rolled_off(loop, high * 10.0)
    width = np.maximum(np.abs(p.real), 1e-9 * size)
    steps = 0.7 * 3.0 ** np.arange(20)
    offsets = np.concatenate([-steps, steps])  # never on an undamped pole itself, where L is infinite
    centre = np.where(np.abs(p.imag) > 0.0, np.abs(p.imag), size)
    cluster = centre[..., None] + width[..., None] * offsets
    # a cluster reaches as far as its neighbourhood of half an octave; the background takes over there
    useful = np.abs(cluster - centre[..., None]) < 0.5 * size[..., None]
    cluster = np.where(useful & np.isfinite(own)[..., None] & (p.imag >= 0.0)[..., None], cluster, np.nan)
    background = np.exp(np.linspace(np.log(low), np.log(high), 41, axis=-1))
    omega = np.sort(np.concatenate([cluster.reshape(len(p), -1), background], axis=-1), axis=-1)
    keep = np.isfinite(omega) & (omega >= low[:, None]) & (omega <= high[:, None])
    keep[:, 1:] &= ~(omega[:, 1:] < omega[:, :-1] * (1.0 + 1e-12))
    index = np.broadcast_to(np.arange(len(p))[:, None], omega.shape)
    return index[keep], omega[keep]


def _zeros(loop: Loop) -> ComplexArray:
    """Return the zeros of the plant from engine to sensed attitude, with some spurious ones at the origin.

    A - b c A^r / (c A^(r-1) b) has the zeros and r eigenvalues at the origin; r is 1 with a rate gain, else 2.
    """
    A, b, _, C = state_space(loop.plant, loop.damping)
    a0, a1 = np.asarray(loop.autopilot.attitude_gain)[..., None], np.asarray(loop.autopilot.rate_gain)[..., None]
    batch = loop.batch
    attitude = np.einsum("...j,...jk->...k", C[..., 0, :], A)
    c = np.broadcast_to(
        np.where(a1 != 0.0, a0 * C[..., 0, :] + a1 * C[..., 1, :], a0 * attitude), (*batch, A.shape[-1])
    )
    cA, cb = np.einsum("...j,...jk->...k", c, A), np.sum(c * b, axis=-1)[..., None, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        moved = A - b[..., :, None] * cA[..., None, :] / cb
    return np.linalg.eigvals(np.where(np.isfinite(moved), moved, 0.0)).astype(
        complex
    )  # no zero is placed where c b vanishes


def loop_zeros(loop: Loop) -> ComplexArray:
    """Return the finite zeros of one loop: those of the plant from engine to sensed attitude, and of the filters."""
    zeros = _zeros(loop)
    order = 1 if np.all(np.asarray(loop.autopilot.rate_gain) != 0.0) else 2
    own = zeros[np.argsort(np.abs(zeros))[order:]]
    return np.concatenate([own, *(np.roots(f.numerator) for f in loop.autopilot.filter)]).astype(complex)


def _rolled_off(loop: Loop, omega: Array) -> Array:
    """Return frequencies from `omega` on, doubled until the loop gain is below -40 dB."""
    index = np.arange(len(omega))
    for _ in range(20):
        loud = np.abs(transfer(loop.take(index), 1j * omega).loop) > 0.01
        if not np.any(loud):
            break
        omega = np.where(loud, 2.0 * omega, omega)
    return omega
