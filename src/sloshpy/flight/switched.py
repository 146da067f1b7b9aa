"""The state of the loop just after an event: motion and actuator as before, other filters as if they had always heard.

A filter that was not in the loop before it is switched in has a state too. It is taken for one that ran beside the loop
on the same signal, as autopilots do whose filters are switched without a jump of their own making.
"""

from collections.abc import Sequence

import numpy as np

from sloshpy.autopilot import Filter
from sloshpy.autopilot.blocks import filter_block
from sloshpy.case import Case
from sloshpy.dynamics import open_loop
from sloshpy.errors import OutsideValidity
from sloshpy.flight.trajectory import Phase
from sloshpy.simulation.model import Model
from sloshpy.units import Array

CALM = np.zeros(1)  # m/s of wind


def switched(phases: Sequence[Phase], courses: Sequence[tuple[Array, Array]]) -> Array:
    """Return the state at the begin of the last phase.

    Args:
        phases: those that have been, and the one that begins. courses: of those that have been, times in s and states.

    Raises:
        OutsideValidity: other filters where an accelerometer is fed back, whose signal holds the damping forces.
    """
    one, two = phases[-2].cases[-1], phases[-1].cases[0]
    x = courses[-1][1][-1]
    if one.autopilot.filter == two.autopilot.filter:
        return np.array(x)
    if np.any(one.autopilot.accelerometer_gain) or np.any(two.autopilot.accelerometer_gain):
        raise OutsideValidity(
            "other filters begin where an accelerometer is fed back: what they have heard is not kept"
        )
    plant, old = _sizes(one)
    A, B, _ = chain(two.autopilot.filter)
    states = np.zeros(len(B))
    for phase, (time, course) in zip(phases[:-1], courses, strict=True):
        states = _run(A, B, time, _signal(phase, time, course), states)
    return np.concatenate([x[:plant], states, x[plant + old :]])


def chain(filters: Sequence[Filter]) -> tuple[Array, Array, Array]:
    """Return A, B and what each filter's input is of the states and the signal, of filters one after another.

    The third, (n_filters + 1, N + 1), holds the signal behind so many filters as a row on states and signal.
    """
    blocks = [filter_block(one) for one in filters]
    size = sum(len(b.B) for b in blocks)
    A, B = np.zeros((size, size)), np.zeros(size)
    rows = [np.append(np.zeros(size), 1.0)]
    at = 0
    for b in blocks:
        own = slice(at, at + len(b.B))
        A[own] += np.outer(b.B, rows[-1][:-1])
        A[own, own] += b.A
        B[own] = b.B * rows[-1][-1]
        row = float(b.D) * rows[-1]
        row[own] += b.C
        rows.append(row)
        at += len(b.B)
    return A, B, np.array(rows)


def _sizes(case: Case) -> tuple[int, int]:
    """Return how many states the plant and the filters have."""
    filters = sum(len(one.denominator) - 1 for one in case.autopilot.filter)
    bare = case.model_copy(update={"autopilot": case.autopilot.model_copy(update={"filter": (), "actuator": None})})
    return Model(open_loop(bare), bare, None).size, filters


def _signal(phase: Phase, time: Array, course: Array) -> Array:
    """Return what the filters of a phase are fed, (S,), rad."""
    plant, filters = _sizes(phase.cases[0])
    motion = np.delete(course, slice(plant, plant + filters), axis=1)
    found = []
    for case in phase.cases:
        bare = case.model_copy(update={"autopilot": case.autopilot.model_copy(update={"filter": ()})})
        found.append(Model(open_loop(bare), bare, None).commands(motion, np.zeros(len(motion))))
    signals = np.array(found)
    k = np.clip(np.searchsorted(phase.time, time, side="right") - 1, 0, len(phase.time) - 2)
    part = np.clip((time - phase.time[k]) / (phase.time[k + 1] - phase.time[k]), 0.0, 1.0)
    rows = np.arange(len(time))
    return np.asarray((1.0 - part) * signals[k, rows] + part * signals[k + 1, rows])


def _run(A: Array, B: Array, time: Array, signal: Array, states: Array) -> Array:
    """Return the states of x' = A x + B u at the last time, u linear between the times: exact steps."""
    from scipy.linalg import expm  # 0.1 s: only where filters are switched

    known: dict[float, Array] = {}
    n = len(B)
    for k, h in enumerate(np.diff(time).tolist()):
        key = float(f"{h:.12g}")
        if key not in known:  # of [x, u, u'] over one step
            whole = np.zeros((n + 2, n + 2))
            whole[:n, :n], whole[:n, n], whole[n, n + 1] = A, B, 1.0
            known[key] = expm(h * whole)[:n]
        states = known[key] @ np.concatenate([states, [signal[k], (signal[k + 1] - signal[k]) / h]])
    return states
