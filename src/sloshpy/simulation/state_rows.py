"""Where slosh and engine stand in the state of `system_matrix`: rows that pick them, and what a damping force moves."""

from dataclasses import dataclass

import numpy as np

from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.sensed import fed
from sloshpy.dynamics.states import controller
from sloshpy.units import Array


@dataclass(frozen=True, kw_only=True)
class SloshRows:
    """Where slosh stands in the state of `system_matrix`: rows that pick it, and what a unit acceleration moves.

    displacement, velocity: (n_tanks, N). push: (..., n_tanks, N), rate of change of the state.
    """

    displacement: Array
    velocity: Array
    push: Array


def slosh_rows(loop: Loop, size: int) -> SloshRows:
    """Return the rows of a loop, or of a batch, whose state has so many entries."""
    p = loop.plant
    n, half = len(p.tanks), p.mass.shape[-1]
    states = 2 * half - int(p.velocity_only)
    displacement, velocity = np.zeros((n, size)), np.zeros((n, size))
    for j in range(n):
        displacement[j, p.slosh_states.start + j] = 1.0
        velocity[j, states - half + p.slosh.start + j] = 1.0
    moved = np.swapaxes(np.linalg.inv(p.mass)[..., p.slosh], -1, -2) * p.tank_mass[..., None]
    push = _pushed(loop, moved, size)
    return SloshRows(displacement=displacement, velocity=velocity, push=push)


def wind_push(loop: Loop, size: int) -> Array:
    """Return the rate of change of the state by a lateral wind of 1 m/s, (..., size): it pushes where Z' resists."""
    p = loop.plant
    moved = np.asarray(np.linalg.solve(p.mass, p.damping[..., :1]), dtype=float)
    return _pushed(loop, np.swapaxes(moved, -1, -2), size)[..., 0, :]


def _pushed(loop: Loop, moved: Array, size: int) -> Array:
    """Return states' rates of change by accelerations of the coordinates, (..., k, n), as (..., k, size)."""
    p = loop.plant
    half = p.mass.shape[-1]
    states, count = 2 * half - int(p.velocity_only), moved.shape[-2]
    push = np.zeros((*moved.shape[:-1], size))
    push[..., states - half : states] = moved
    felt = fed(loop).acceleration
    if felt is not None:  # an accelerometer feels it at once
        B = controller(loop)[1]
        direct = np.einsum("...i,...ji->...j", felt, moved)
        shape = np.broadcast_shapes(push.shape[:-2], direct.shape[:-1], B.shape[:-1])
        push = np.broadcast_to(push, (*shape, count, size)).copy()
        push[..., states:] = direct[..., None] * B[..., None, :]
    return push


def engine_row(loop: Loop, size: int) -> Array:
    """Return the row that picks the engine angle from the state of `system_matrix`, (..., size)."""
    c = fed(loop).c
    states = c.shape[-1]
    _, _, C, D, _ = controller(loop)
    row = np.zeros((*loop.batch, size))
    row[..., :states] = np.asarray(D)[..., None] * c  # an accelerometer is fed back through a lag alone: then D is 0
    row[..., states : states + C.shape[-1]] = C
    return row
