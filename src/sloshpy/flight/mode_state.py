"""A closed-loop mode as a state of the loop: just before an event, just after it, and as a start of a simulation."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sloshpy.autopilot import series_blocks
from sloshpy.autopilot.blocks import Block
from sloshpy.case import Case
from sloshpy.dynamics import Loop, open_loop
from sloshpy.dynamics.sensed import fed
from sloshpy.dynamics.states import controller, system_matrix
from sloshpy.flight.growth_along import FlightGrowth, slosh_rows
from sloshpy.limit_cycle.branch import Mode
from sloshpy.units import Array, ComplexArray


@dataclass(frozen=True, kw_only=True)
class ModeVectors:
    """A mode of the loop's state matrix, per metre of its own tank's slosh.

    loop: at the mode's damping. pole: rad/s. right: (N,). left: (N,), with left . right = 1.
    """

    loop: Loop
    pole: complex
    right: ComplexArray
    left: ComplexArray


def mode_vectors(case: Case, mode: Mode, tank: int) -> ModeVectors:
    """Return the vectors of a mode of a tank, by number."""
    loop = open_loop(case, mode.damping)
    value, right = np.linalg.eig(system_matrix(loop)[0])
    n = int(np.argmin(np.abs(value - mode.pole)))
    scale = right[slosh_rows(loop)[0][tank], n]
    return ModeVectors(
        loop=loop, pole=complex(value[n]), right=right[:, n] / scale, left=np.linalg.inv(right)[n] * scale
    )


def carried_state(before: ModeVectors, after: Loop) -> ComplexArray:
    """Return the complex state of the loop after an event in which the mode of before swung up to it, (N,).

    Motion and actuator go on. What hears goes on as if it had always heard the same: filters the signal before the
    event, the delay line the command before it, whatever their length.
    """
    loop, s = before.loop, before.pole
    plant, heard = _split(before)
    signal, command = complex(loop.autopilot.gain) * heard, _commanded(before)
    states = [plant]
    for block in series_blocks(after.autopilot, _parts(after)):
        if block.kind == "filter":
            x, signal = _answer(block, s, signal)
        elif block.kind == "delay":
            x, command = _answer(block, s, command)
        else:
            x = before.right[len(before.right) - len(block.B) :]
        states.append(x)
    return np.concatenate(states)


def mode_state(growth: FlightGrowth, angle: float = 0.0) -> Array:
    """Return the state of the simulation in which the mode of a growth, and it alone, swings at its start.

    Args:
        growth: of `growth_along`. angle: by how much it has swung on, rad; at 0 its own tank is at its peak.
    """
    phase, mode, t0 = growth.phase, growth.start, float(growth.time[0])
    vectors = mode_vectors(phase.cases[phase.place(t0)[0]], mode, phase.tanks.index(growth.tank))
    groups = system_matrix(vectors.loop)[1]
    r = float(growth.amplitude[0]) * np.exp(1j * angle) * vectors.right
    kept = [i for i, group in enumerate(groups) if group != "delay"]  # the simulation has a true line
    return np.asarray(r[kept].real)


def mode_command(growth: FlightGrowth, angle: float = 0.0) -> Callable[[float], float]:
    """Return the engine command in rad over time in s of the mode that `mode_state` swings in, up to its start."""
    phase, t0 = growth.phase, float(growth.time[0])
    case = phase.cases[phase.place(t0)[0]]
    vectors = mode_vectors(case, growth.start, phase.tanks.index(growth.tank))
    size = _commanded(vectors) * float(growth.amplitude[0]) * np.exp(1j * angle)
    return lambda time: float((size * np.exp(vectors.pole * (time - t0))).real)


def _commanded(mode: ModeVectors) -> complex:
    """Return the engine command before the delay, rad per metre of slosh."""
    command = complex(mode.loop.autopilot.gain) * _split(mode)[1]
    for block in series_blocks(mode.loop.autopilot, _parts(mode.loop)):
        command = _answer(block, mode.pole, command)[1] if block.kind == "filter" else command
    return command


def _split(mode: ModeVectors) -> tuple[ComplexArray, complex]:
    """Return the motion of a mode and what its autopilot is fed."""
    p = fed(mode.loop)
    _, _, C, _, _ = controller(mode.loop)
    plant = mode.right[: len(mode.right) - len(C)]
    beta = complex(C @ mode.right[len(plant) :])
    return plant, complex(p.c @ plant) + (float(p.d) + float(p.d2) * mode.pole**2) * beta


def _parts(loop: Loop) -> int:
    """Return in how many parts the delay of a loop's state matrix is approximated."""
    groups = controller(loop)[4]
    one = sum(len(b.B) for b in series_blocks(loop.autopilot, 1) if b.kind == "delay")
    return groups.count("delay") // one if one else 1


def _answer(block: Block, s: complex, u: complex) -> tuple[ComplexArray, complex]:
    """Return states and output of a block that hears u e^{st} and always has."""
    x = np.linalg.solve(s * np.eye(len(block.B)) - block.A, block.B * u)
    return x, complex(block.C @ x + complex(block.D) * u)
