"""Time history of a flight by compiled code: the equations, steps and delay line of `simulate_flight`, and a gust.

The march itself is some fifty times as fast, a whole flight with its equations set up some twenty-five; for
campaigns, where numba's start is paid once. `simulate_flight` needs no compiled code.
"""

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.flight.equations import DIVERGED, Equations, Part
from sloshpy.flight.flight_history import FlightHistory
from sloshpy.flight.simulate_flight import begun, carried_or_refused, joined_parts
from sloshpy.flight.switched import switched
from sloshpy.flight.trajectory import Phase
from sloshpy.simulation.ensemble import GUST_STEPS
from sloshpy.simulation.law_terms import LawTerms, law_terms
from sloshpy.simulation.signals import OneMinusCosine
from sloshpy.units import Array, Real

if TYPE_CHECKING:
    from sloshpy.simulation.varying_kernel import Tables

CALM = np.array([0.0, 0.0, 1.0])  # peak, start, duration of no gust


def fly_fast(
    phases: Phase | Sequence[Phase],
    initial: Array,
    gust: OneMinusCosine | None = None,
    damping_factor: Real = 1.0,
    step: float | None = None,
) -> FlightHistory:
    """Simulate the loop along whole phases, nonlinear damping, actuator limits and a true delay line included.

    Args:
        phases: one, or several that follow each other without a gap; without a sampler.
        initial: the state at the start, or (n_tanks,), slosh displacements in m.
        gust: of the lateral wind, its start in the time of the flight; it acts where a phase has aerodynamics.
        damping_factor: multiplies the laws of damping, broadcasts with (n_tanks,).
        step: s, at most; default: as in `simulate_flight`, and a hundredth of the gust.

    Raises:
        OutsideValidity: as in `simulate_flight`.
    """
    own = (phases,) if isinstance(phases, Phase) else tuple(phases)
    for one, two in itertools.pairwise(own):
        carried_or_refused(one, two)
    most, blow = np.inf if step is None else step, CALM
    if gust is not None and float(gust.size) != 0.0:
        blow = np.array([gust.size, gust.start, gust.duration], dtype=float)
        most = min(most, float(gust.duration) / GUST_STEPS)
    if not most > 0.0:
        raise ValueError(f"step must be > 0 s, is {most:g} s")
    factor = np.broadcast_to(np.asarray(damping_factor, dtype=float), len(own[0].tanks))
    x, parts = begun(own[0], initial), list[Part]()
    told: list[tuple[Array, Array, Array]] = []  # what went into the delay line: times, commands, their slopes
    for k, phase in enumerate(own):
        if k:
            x = switched(own[: k + 1], [(part.time, part.state) for part in parts])
        part, line = _marched(Equations.of(phase), x, most, factor, blow, told)
        parts.append(part)
        told.append(line)
        x = part.state[-1]
        if part.stopped:
            break
    return joined_parts(own, parts)


def _marched(
    equations: Equations,
    x: Array,
    most: float,
    factor: Array,
    gust: Array,
    told: list[tuple[Array, Array, Array]],
) -> tuple[Part, tuple[Array, Array, Array]]:
    """Return one phase, and what it told the delay line."""
    from sloshpy.simulation.varying_kernel import BEYOND, Line, march_varying  # numba, 0.5 s: only for campaigns

    time = equations.phase.time
    steps, emptied = equations.steps(float(time[0]), float(time[-1]), most)
    count, n = len(steps), len(equations.velocity)
    state, (angle, value, slope) = np.zeros((count, len(x))), np.zeros((3, count))
    whole = [np.concatenate([np.zeros(0), *(line[i] for line in told)]) for i in range(3)]
    start = np.cumsum([0, *(len(line[0]) for line in told)])
    before = Line(time=whole[0], value=whole[1], slope=whole[2], start=start.astype(np.int64))
    first = int(equations.velocity[0])
    if not np.array_equal(equations.velocity, first + np.arange(n)):
        raise TypeError("the slosh velocities do not stand side by side")
    results = state, angle, value, slope
    reached, end = march_varying(
        x, steps, emptied, tables_of(equations), _laws(equations.phase, factor), first, gust, before, DIVERGED, *results
    )
    stopped = ""
    if end:
        why = "beyond the damping data" if end == BEYOND else "diverged"
        stopped = f"{why} at {steps[reached]:.1f} s"
    part = Part(
        time=steps[:reached],
        state=state[:reached],
        slosh=state[:reached][:, equations.displacement],
        tvc=angle[:reached],
        step=float(np.max(np.diff(steps))),
        stopped=stopped,
    )
    return part, (steps[:reached], value[:reached], slope[:reached])


def tables_of(equations: Equations) -> "Tables":
    """Return the equations of a phase as the kernel takes them."""
    from sloshpy.simulation.varying_kernel import Tables  # as above

    each = [model.matrices for model in equations.models]
    return Tables(
        time=np.ascontiguousarray(equations.phase.time),
        delay=np.array(equations.delay),
        loss=equations.loss,
        by_state=np.stack([np.ascontiguousarray(m.by_state.T) for m in each]),
        by_input=np.stack([np.ascontiguousarray(m.by_input.T) for m in each]),
        command=np.stack([m.command for m in each]),
        engine=np.stack([m.engine for m in each]),
        limits=np.stack([m.limits for m in each]),
    )


def _laws(phase: Phase, factor: Array) -> LawTerms:
    laws = [[tank.damping for tank in case.vehicle.tanks] for case in phase.cases]
    frequency = np.array([[float(tank.frequency) for tank in case.vehicle.tanks] for case in phase.cases])
    return law_terms(laws, frequency, factor)
