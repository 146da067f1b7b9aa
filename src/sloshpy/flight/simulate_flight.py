"""Time history of a flight: the nonlinear loop of `simulation`, its coefficients linear in time within a phase.

    x' = f(x; vehicle and autopilot at t)   and   z_j'' gains -(m_j'/m_j) z_j'

M, I, c.g., thrust, stations, slosh masses and frequencies, gains, delay, filters, actuator, damping laws change with
time. A moving filter is realised as `autopilot.blocks` says: integrators at its own frequency. Of the terms
that the change itself brings the slosh mass's own momentum (m_j z_j')' is kept, in every row where m_j z_j'' stands.
Z'' is the lateral acceleration of the material at the c.g., and what leaves the vehicle takes its lateral velocity
along: no M' term. Left out: the jet damping of the engine (it damps attitude), the flow in the feed lines, and the
travel of the c.g. through the structure where Z' itself is a state (aerodynamics), of the order of its speed times
phi'.

Across an event the motion of vehicle, liquid and engine goes on, and so does what is under way in the delay line. A
filter that stays goes on too; others begin as if they had heard the same signal since the simulation began.
"""

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from sloshpy.dynamics import open_loop
from sloshpy.errors import OutsideValidity
from sloshpy.flight.command_record import CommandRecord
from sloshpy.flight.equations import Equations, Part
from sloshpy.flight.events import event_between
from sloshpy.flight.flight_history import FlightHistory
from sloshpy.flight.growth_along import slosh_rows
from sloshpy.flight.switched import switched
from sloshpy.flight.trajectory import Phase
from sloshpy.simulation.model import Model
from sloshpy.units import Array


def simulate_flight(
    phases: Phase | Sequence[Phase],
    initial: Array,
    start: float | None = None,
    end: float | None = None,
    step: float | None = None,
    past: Callable[[float], float] | None = None,
) -> FlightHistory:
    """Simulate the loop along phases, nonlinear damping, actuator limits and a true delay line included.

    Args:
        phases: one, or several that follow each other without a gap; without a sampler.
        initial: the state at the start, as of `mode_state`, or (n_tanks,), slosh displacements in m.
        start, end: s, within the first and the last phase; default: where these begin and end.
        step: s, at most; default: 0.6 of the fastest pole's radian and a tenth of the fastest slosh radian.
        past: the engine command in rad at times before the start, which is in the delay line then; default: none was.

    Raises:
        OutsideValidity: a sampler, a delay that overtakes time, a time outside the phases, an event across which
            nothing is carried.
    """
    own = (phases,) if isinstance(phases, Phase) else tuple(phases)
    t0 = float(own[0].time[0]) if start is None else start
    t1 = float(own[-1].time[-1]) if end is None else end
    own[0].place(t0)
    own[-1].place(t1)
    if step is not None and not step > 0.0:
        raise ValueError(f"step must be > 0 s, is {step:g} s")
    for one, two in itertools.pairwise(own):
        carried_or_refused(one, two)
    equations = [Equations.of(phase) for phase in own]
    record, x = CommandRecord(past), begun(own[0], initial)
    parts: list[Part] = []
    for k, (phase, motion) in enumerate(zip(own, equations, strict=True)):
        if k:
            x = switched(own[: k + 1], [(part.time, part.state) for part in parts])
        ends = max(t0, float(phase.time[0])), min(t1, float(phase.time[-1]))
        parts.append(motion.march(x, *ends, np.inf if step is None else step, record))
        x = parts[-1].state[-1]
        if parts[-1].stopped:
            break
    return joined_parts(own, parts)


def carried_or_refused(one: Phase, two: Phase) -> None:
    """Refuse two phases between which no oscillation is carried.

    Raises:
        OutsideValidity: with every reason.
    """
    last, first = (float(one.time[-1]), one.cases[-1]), (float(two.time[0]), two.cases[0])
    event = event_between(one.name, last, two.name, first)
    if not event.carries:
        raise OutsideValidity(str(event))


def begun(phase: Phase, initial: Array) -> Array:
    """Return the first state, given itself or by slosh displacements."""
    loop, given = open_loop(phase.cases[0]), np.asarray(initial, dtype=float)
    x = np.zeros(Model(loop, phase.cases[0], None).size)
    if given.shape == x.shape:
        return given.copy()
    x[slosh_rows(loop)[0]] = given
    return x


def joined_parts(phases: tuple[Phase, ...], parts: list[Part]) -> FlightHistory:
    """Return the parts as one history; an event stands once, since the motion is the same on both its sides."""

    def joined(name: str) -> Array:
        return np.concatenate([getattr(part, name)[min(k, 1) :] for k, part in enumerate(parts)])

    return FlightHistory(
        phases=phases,
        time=joined("time"),
        slosh=joined("slosh"),
        tvc=joined("tvc"),
        step=max(part.step for part in parts),
        stopped=parts[-1].stopped,
    )
