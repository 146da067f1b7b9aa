"""The loop in states, its delay approximated: for eigenvalues, from which the exact poles are polished."""

from dataclasses import replace

import numpy as np

from sloshpy.autopilot import PADE_ORDER, series_blocks
from sloshpy.autopilot.coefficients import axes
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.response import transfer
from sloshpy.dynamics.sensed import fed
from sloshpy.units import Array, BoolArray, IntArray

PART = 8.0  # rad of phase lag that one Pade approximation of order 8 carries with a phase error below 1e-3 rad
MOST_PARTS = 12  # 96 states; a delay longer still, at a gain that no loop survives, is left to the encirclement count
HEARD = 0.5  # loop gain below which 1 + L does not come near zero, whatever the delay

DelayModel = tuple[int, int]  # parts, and the order of the Pade approximation of each


def controller(loop: Loop, delay: DelayModel | None = None) -> tuple[Array, Array, Array, Array, list[str]]:
    """Return A, B, C, D of the forward path from what it is fed to beta, and the group of each state.

    They have the batch axes of the autopilot alone, which broadcast with the loop's.
    """
    parts, order = delay or (int(np.max(delay_parts(loop))), PADE_ORDER)
    batch = np.broadcast_shapes(*axes(loop.autopilot))
    A, B, C = np.zeros((*batch, 0, 0)), np.zeros((*batch, 0)), np.zeros((*batch, 0))
    D = np.broadcast_to(np.asarray(loop.autopilot.gain, dtype=float), batch)
    groups: list[str] = []
    for i, block in enumerate(series_blocks(loop.autopilot, parts, order)):
        k, old = block.B.shape[-1], A.shape[-1]
        grown = np.zeros((*batch, old + k, old + k))
        grown[..., :old, :old] = A
        grown[..., old:, :old] = block.B[..., :, None] * C[..., None, :]
        grown[..., old:, old:] = block.A
        B = np.concatenate([B, block.B * D[..., None]], axis=-1)
        C = np.concatenate([block.D[..., None] * C, np.broadcast_to(block.C, (*batch, k))], axis=-1)
        A, D = grown, block.D * D
        groups += [f"{block.kind} {i + 1}" if block.kind == "filter" else block.kind] * k
    return A, B, C, D, groups


def system_matrix(loop: Loop, closed: bool = True, delay: DelayModel | None = None) -> tuple[Array, list[str]]:
    """Return the state matrix of the loop, shape (..., N, N), closed or broken at the engine, and its state groups.

    delay: how it is approximated; left out, as well as the worst of the batch needs.
    """
    p = fed(loop)
    A_c, B_c, C_c, D_c, groups = controller(loop, delay)
    batch, n, k = loop.batch, p.A.shape[-1], A_c.shape[-1]
    sensed = np.broadcast_to(p.c, (*batch, n))
    A = np.zeros((*batch, n + k, n + k))
    A[..., :n, :n] = p.A
    A[..., n:, n:] = A_c
    A[..., n:, :n] = B_c[..., :, None] * sensed[..., None, :]
    if closed:
        direct, through = p.B * D_c[..., None], p.B[..., :, None] * C_c[..., None, :]
        felt = p.d[..., None] * C_c
        if np.any(p.B2) or np.any(p.d2):  # beta'' = C A^2 x + C A B u: the actuator lets beta and beta' see no u
            CA = np.einsum("...i,...ij->...j", C_c, A_c)
            CAA = np.einsum("...i,...ij->...j", CA, A_c)
            direct = direct + p.B2 * np.sum(CA * B_c, axis=-1)[..., None]
            through = through + p.B2[..., :, None] * CAA[..., None, :]
            felt = felt + p.d2[..., None] * CAA
        A[..., :n, :n] += direct[..., :, None] * sensed[..., None, :]
        A[..., :n, n:] = through
        if p.acceleration is not None:  # with the lag that it asks for nothing of u comes back to u at once
            A[..., n:, n:] += B_c[..., :, None] * felt[..., None, :]
    own = list(loop.plant.groups)
    return A, own[1 if loop.plant.velocity_only else 0 :] + own + groups


def without_delay(loop: Loop) -> Loop:
    """Return the loop with every delay left out."""
    return replace(loop, autopilot=loop.autopilot.prompt)


def reach(loop: Loop) -> Array:
    """Return the highest frequency at which the loop gain is above `HEARD`, rad/s, shape of the batch.

    On a grid that holds the natural frequencies of the broken loop, where a resonance is near its peak. In the right
    half-plane a delay only lessens the gain, so that no unstable pole lies beyond.
    """
    prompt = without_delay(loop)
    own = np.abs(np.linalg.eigvals(system_matrix(prompt, closed=False)[0]))
    top, bottom = np.max(own, axis=-1, keepdims=True), np.min(np.where(own > 0.0, own, np.inf), axis=-1, keepdims=True)
    wide = bottom * (1e3 * top / bottom) ** np.linspace(0.0, 1.0, 60)
    omega = np.concatenate([np.where(own > 0.0, own, top), wide], axis=-1)
    gain = np.abs(transfer(prompt.along(), 1j * omega).loop)
    return np.asarray(np.max(np.where(gain < HEARD, 0.0, omega), axis=-1))


def delay_parts(loop: Loop) -> IntArray:
    """Return how many parts the delay of each loop by itself is approximated in, shape of the batch."""
    if np.all(quiet_within(loop, PART)):
        return np.ones(loop.batch, dtype=int)
    return np.clip(np.ceil(reach(loop) * loop.autopilot.dead_time / PART), 1, MOST_PARTS).astype(int)


def quiet_within(loop: Loop, lag: float) -> BoolArray:
    """Return whether each loop's gain is below `HEARD` where its delay turns by more than `lag` rad, as in `reach`.

    By vehicle and autopilot alone, every tank undamped, where peaks are highest: many dampings of a plant cost nothing,
    and the answer for a loop does not depend on its neighbours.
    """
    tau = np.asarray(loop.autopilot.dead_time, dtype=float)
    late = tau > 0.0
    if not np.any(late):
        return np.ones(loop.batch, dtype=bool)
    bare = replace(without_delay(loop), damping=np.zeros(loop.damping.shape[-1]))
    own = np.abs(np.linalg.eigvals(system_matrix(bare, closed=False)[0]))
    top = np.max(own, axis=-1, keepdims=True)
    limit = np.where(late, lag / np.where(late, tau, 1.0), np.inf)[..., None]
    limit = np.where(np.isfinite(limit), limit, 1e3 * top)
    wide = limit * np.maximum(1e3 * top / limit, 10.0) ** np.linspace(0.0, 1.0, 30)
    omega = np.concatenate([np.broadcast_to(np.maximum(own, limit), (*wide.shape[:-1], own.shape[-1])), wide], axis=-1)
    gain = np.abs(transfer(bare.along(), 1j * omega).loop)
    return np.broadcast_to(np.all(gain < HEARD, axis=-1) | ~late, loop.batch)
