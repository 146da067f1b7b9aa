"""Modal form of a batch of closed loops, and its trajectories packed side by side for the kernel."""

from dataclasses import dataclass, replace

import numpy as np

from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.states import system_matrix
from sloshpy.simulation.state_rows import engine_row, slosh_rows, wind_push
from sloshpy.units import Array, ComplexArray, Real

FOUR = 4  # modes that the kernel takes at a time


@dataclass(frozen=True, kw_only=True)
class Modal:
    """Modes of a flattened batch of N loops with n tanks; of a conjugate pair one is kept, its rows doubled.

    rate, start: (N, m). push: (N, n, m), by a unit acceleration of the damping, behind the tanks by a wind of 1 m/s.
    rows: (N, R, m), R = 2 n + 2: velocity and displacement of each slosh mass, engine angle, its rate. jump: (N, R, n):
    of these by a unit kick.
    m is a multiple of four: modes at rest fill up.
    """

    rate: ComplexArray
    start: ComplexArray
    push: ComplexArray
    rows: ComplexArray
    jump: Array


def modal_form(loop: Loop, initial_slosh: Real, gusts: bool = False) -> Modal:
    """Return the modes of a batch of loops, their start at displaced slosh in m, (..., n_tanks), and what is read.

    gusts: with a lateral wind as the last of what pushes.
    """
    A, _ = system_matrix(loop)
    batch, N, n = loop.batch, A.shape[-1], len(loop.plant.tanks)
    size = int(np.prod(batch))
    A = A.reshape(size, N, N)
    of = slosh_rows(loop, N)
    push = np.broadcast_to(of.push, (*batch, n, N)).reshape(size, n, N)
    if gusts:
        wind = np.broadcast_to(wind_push(loop, N), (*batch, N)).reshape(size, 1, N)
        push = np.concatenate([push, wind], axis=1)
    # without an actuator the engine is taken before the delay, which moves it in time alone: its approximation passes
    # the kicks of the damping straight on
    prompt = replace(loop, autopilot=loop.autopilot.model_copy(update={"delay": 0.0}))
    shown = loop if loop.autopilot.actuator is not None else prompt
    beta = np.broadcast_to(engine_row(shown, N), (*batch, N)).reshape(size, 1, N)
    slosh = np.broadcast_to(np.concatenate([of.velocity, of.displacement]), (size, 2 * n, N))
    read = np.concatenate([slosh, beta, beta @ A], axis=1)
    given = np.zeros((size, N, 1 + push.shape[1]))
    first = np.broadcast_to(np.asarray(initial_slosh, dtype=float), (*batch, n))
    given[:, loop.plant.slosh_states, 0] = first.reshape(size, n)
    given[:, :, 1:] = np.swapaxes(push, -1, -2)
    rate, V = (x.astype(complex) for x in np.linalg.eig(A))  # real where no mode of the whole batch oscillates
    moved = np.linalg.solve(V, given.astype(complex))
    order = np.argsort(rate.imag < 0.0, axis=-1, kind="stable")  # the upper ones first
    upper = np.take_along_axis(rate.imag >= 0.0, order, axis=-1)
    kept = int(np.max(np.sum(upper, axis=-1)))
    order, upper = order[:, :kept], upper[:, :kept]
    rate = np.take_along_axis(rate, order, axis=-1)
    weight = np.where(upper, np.where(rate.imag > 0.0, 2.0, 1.0), 0.0)
    rows = np.take_along_axis(read @ V, order[:, None, :], axis=2) * weight[:, None, :]
    moved = np.take_along_axis(moved, order[:, :, None], axis=1)
    return Modal(
        rate=_in_fours(np.where(upper, rate, -1.0)),
        start=_in_fours(moved[..., 0]),
        push=_in_fours(np.swapaxes(moved[..., 1:], -1, -2)),
        rows=_in_fours(rows),
        jump=np.einsum("kri,kji->krj", read, push),
    )


def _in_fours(x: ComplexArray) -> ComplexArray:
    """Fill up the last axis, of modes, to a multiple of four with nothing."""
    lacking = -x.shape[-1] % FOUR
    return np.concatenate([x, np.zeros((*x.shape[:-1], lacking), dtype=complex)], axis=-1) if lacking else x


def parted(x: ComplexArray) -> Array:
    """Return real and imaginary part of each mode in turn, in fours: (..., m) becomes (..., m / 4, 8)."""
    return np.asarray(np.stack([x.real, x.imag], axis=-1).reshape(*x.shape[:-1], -1, 2 * FOUR), dtype=float)


def paired(rows: ComplexArray) -> Array:
    """Return rows (N, R, m) in pairs, whose products with `parted` modes are real parts, as (N, R/2, m/4, 16)."""
    N, R, m = rows.shape
    both = np.stack([rows.real, -rows.imag], axis=-1).reshape(N, R // 2, 2, m, 2)
    return np.asarray(np.moveaxis(both, 2, 3).reshape(N, R // 2, m // FOUR, 4 * FOUR), dtype=float)


def packed(x: Array, lanes: int) -> Array:
    """Put trajectories, first axis, into groups of lanes; the last one repeats to fill up: (N, ...) to (G, ..., L)."""
    size = len(x)
    groups = -(-size // lanes)
    filled = np.concatenate([x, np.repeat(x[-1:], groups * lanes - size, axis=0)])
    return np.ascontiguousarray(np.moveaxis(filled.reshape(groups, lanes, *x.shape[1:]), 1, -1))


def unpacked(x: Array, size: int) -> Array:
    """Return what lies in groups of lanes, (G, ..., L), by trajectory: (N, ...)."""
    whole = np.moveaxis(x, -1, 1)
    return np.ascontiguousarray(whole.reshape(-1, *whole.shape[2:])[:size])
