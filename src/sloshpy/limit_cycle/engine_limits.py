"""Limit cycles with an actuator that has limits or a dead band: its describing function in the same balance.

The actuator's answer to a sinusoidal command of amplitude B and frequency W is marched until it repeats; the
fundamental over that of the linear actuator is the factor kappa(B, W), complex, that the loop gain gets. For each slosh
amplitude the mode, its command amplitude and kappa are made to agree; a zero of the growth is a limit cycle. Small
stable cycles and large unstable ones both show, the large ones where a saturated engine no longer holds the vehicle.
"""

from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from sloshpy.autopilot import Actuator, forward_transfer
from sloshpy.case import Case
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import closed_loop_poles
from sloshpy.limit_cycle.branch import Follower, Mode
from sloshpy.limit_cycle.growth import slosh_pole
from sloshpy.units import Array

STEPS = 400  # of one period at least
PERIODS = 40  # after which an answer that has not repeated is taken as it is
SETTLED = 1e-9
LEAST = 1e-9  # of kappa: a loop that a dead band opens keeps a trace of gain, so that its command can be read
GAP = 4  # amplitudes in turn without a mode after which the branch is over: each costs many trials
POINTS = 140  # amplitudes followed, evenly in their logarithm
SCANNED = 1e-7  # of kappa along the branch: it shows changes of sign, and each zero is solved anew


def actuator_factor(actuator: Actuator, amplitude: float, omega: float) -> tuple[complex, float]:
    """Return the fundamental of the actuator's answer to a sinusoidal command over that of the linear actuator.

    Args:
        actuator: frequency, damping and at least one limit.
        amplitude: of the command, rad.
        omega: rad/s.

    Returns:
        The factor, and the greatest engine angle in rad.
    """
    from sloshpy.limit_cycle.engine_kernel import steady_answer  # numba, 0.5 s: only where an actuator has limits

    w, zeta = float(actuator.frequency or 0.0), float(actuator.damping or 0.0)
    linear = w**2 / complex(w**2 - omega**2, 2.0 * zeta * w * omega)
    stop, fastest = (np.inf if x is None else float(x) for x in (actuator.deflection_limit, actuator.rate_limit))
    dead = 0.0 if actuator.deadband is None else float(actuator.deadband)
    engine = amplitude * abs(linear)
    if dead == 0.0 and max(amplitude, engine) <= stop and engine * omega <= fastest:
        return 1.0 + 0.0j, engine
    if amplitude <= dead:
        return complex(LEAST), 0.0
    steps = max(STEPS, 2 * int(np.ceil(5.0 * w / omega)))
    given: list[Any] = [amplitude, omega, w, zeta, stop, fastest, dead, amplitude * linear, steps, PERIODS, SETTLED]
    answer, peak = cast(tuple[complex, float], steady_answer(*given))
    return complex(answer / (amplitude * linear)), float(peak)


@dataclass(frozen=True, kw_only=True)
class LimitedMode:
    """A mode with the engine at its limits, amplitude of the command and greatest engine angle, rad."""

    mode: Mode
    command: float
    peak: float
    kappa: complex


def limited_modes(case: Case, tank: int, amplitude: Array) -> list[LimitedMode | None]:
    """Return a tank's mode at each amplitude in m, increasing, with the engine's limits; None where none is found."""
    loop = open_loop(case)
    laws = [t.damping for t in case.vehicle.tanks]
    start = LEAST if case.autopilot.actuator is not None and case.autopilot.actuator.deadband else 1.0
    first = _scaled(loop, complex(start))
    poles = closed_loop_poles(loop if start == 1.0 else _without_gain(loop))
    pole = slosh_pole(poles, loop.plant.tanks[tank])
    follower = Follower(loop=first, laws=laws, tank=tank)
    near = follower.small(pole, float(amplitude[0]))
    found: list[LimitedMode | None] = []
    kappa = complex(start)
    lost = 0
    for a in amplitude:
        one = None if lost == GAP else limited_mode(case, loop, tank, float(a), near, kappa, SCANNED)
        found.append(one)
        lost = min(lost + 1, GAP)
        if one is not None:
            near, kappa, lost = one.mode, one.kappa, 0
    return found


def limited_mode(
    case: Case, loop: Loop, tank: int, a: float, near: Mode, kappa: complex, tolerance: float = 1e-11
) -> LimitedMode | None:
    """Return a mode at one amplitude in m with command and engine factor in agreement; None where none is found.

    near, kappa: mode and factor at an amplitude beside it. tolerance: of the factor.
    """
    from scipy.optimize import root  # 0.3 s: only where an actuator has limits

    laws = [t.damping for t in case.vehicle.tanks]
    actuator = case.autopilot.actuator
    assert actuator is not None
    bare = case.autopilot.actuator_alone

    latest = [near]  # each answer starts the next, most differ little
    from_near: dict[tuple[float, float], tuple[complex, Mode | None, float]] = {}

    def read(y: Array) -> tuple[complex, Mode | None, float]:
        """Return an engine factor within its least, the mode with it and the command amplitude that it asks for."""
        k = complex(y[0], y[1])
        k = k if abs(k) > LEAST else complex(LEAST)
        follower, start = Follower(loop=_scaled(loop, k), laws=laws, tank=tank), latest[0]
        mode = follower.at(a, start)
        if mode is None and start is not near:
            mode = follower.at(a, near)
        if mode is None:
            return k, None, np.nan
        latest[0] = mode
        linear = abs(complex(forward_transfer(bare, np.array(1j * mode.pole.imag))))
        found = k, mode, mode.tvc / (abs(k) * linear)
        if start is near:
            from_near[float(y[0]), float(y[1])] = found
        return found

    asked: dict[tuple[float, float], tuple[float, float]] = {}  # the solver asks again where it begins and ends

    def lacking(y: Array) -> Array:
        key = float(y[0]), float(y[1])
        if key not in asked:
            _, mode, command = read(y)
            if mode is None:
                asked[key] = 1e3, 1e3
            else:
                wanted, _ = actuator_factor(actuator, command, mode.pole.imag)
                asked[key] = wanted.real - key[0], wanted.imag - key[1]
        return np.array(asked[key])

    for begin in (kappa, complex(1.0), complex(0.5), complex(LEAST)):
        solution = np.array([begin.real, begin.imag])
        if np.max(np.abs(lacking(solution))) >= 1e-12:
            result = root(lacking, solution, tol=tolerance)
            if np.max(np.abs(lacking(result.x))) > 1e-6:
                continue
            solution = result.x
        latest[0] = near  # the answer must be that of the mode before, not of another branch met on the way
        known = from_near.get((float(solution[0]), float(solution[1])))
        k, mode, command = read(solution) if known is None else known
        if mode is not None:
            peak = actuator_factor(actuator, command, mode.pole.imag)[1]
            return LimitedMode(mode=mode, command=command, peak=peak, kappa=k)
    return None


def _without_gain(loop: Loop) -> Loop:
    return replace(loop, autopilot=loop.autopilot.model_copy(update={"gain": loop.autopilot.gain * LEAST}))


def _scaled(loop: Loop, kappa: complex) -> Loop:
    """Return the loop with a complex factor on its gain."""
    return replace(loop, autopilot=loop.autopilot.model_copy(update={"gain": loop.autopilot.gain * kappa}))
