"""The state equations of one loop in the time domain: plant, filters, actuator; nonlinear damping and engine limits.

plant x --> sensed --> gain, filters --> command --> delay --> actuator --> beta, beta'' --> plant
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sloshpy.autopilot import Actuator
from sloshpy.autopilot.blocks import actuator_block, filter_block
from sloshpy.autopilot.motion import actuator_motion
from sloshpy.case import Case
from sloshpy.damping import DampingLaw
from sloshpy.damping.laws import Force
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.sensed import fed
from sloshpy.units import Array, IntArray


@dataclass(frozen=True, kw_only=True)
class Matrices:
    """The numbers of a `Model` of N states and n tanks; damping accelerations are what its laws give.

    by_state: (N, N), by_input: (N, 2 + n), x' on x and on command, wind and damping accelerations; with limits the
    first input is the engine's acceleration, and the last two states, angle and rate, are left to `actuator_motion`.
    command: (N + 1 + n,), on x, wind and damping accelerations. engine: (N + 1,), its angle on x and on the command
    that reaches the actuator. limits: of an actuator with limits frequency, damping, stop, fastest rate and dead band;
    else ().
    """

    by_state: Array
    by_input: Array
    command: Array
    engine: Array
    limits: Array


class Model:
    """One loop; the state holds the plant's, then the filters', then the actuator's."""

    def __init__(self, loop: Loop, case: Case, fixed: Array | None) -> None:
        """Assemble a loop; `fixed` are damping ratios in place of the tanks' laws."""
        p = fed(loop, np.zeros(len(loop.plant.tanks)) if fixed is None else fixed)
        pilot = case.autopilot
        n = self._plant = p.A.shape[0]
        blocks = [filter_block(f) for f in pilot.filter]
        self._actuator = pilot.actuator
        A_a, self._drive, self._angle, self._through = _engine(pilot.actuator)
        k = sum(len(b.B) for b in blocks)
        self.size = n + k + len(A_a)
        self._filters, self._engine = slice(n, n + k), slice(n + k, self.size)
        self._b, self._b2, self._d, self._d2 = p.B, p.B2, float(p.d), float(p.d2)
        self._A = np.zeros((self.size, self.size))
        self._A[:n, :n], self._A[self._engine, self._engine] = p.A, A_a
        # beta'' = C A^2 x + C A B u, of an actuator two orders or more below; else the engine has no inertia
        self._jerk = self._angle @ A_a @ A_a
        self._jerk_through = float(self._angle @ A_a @ self._drive)
        self.attitude = np.zeros(self.size)  # row of the measured attitude
        first = int(loop.plant.velocity_only)
        self.attitude[: loop.plant.mass.shape[-1] - first] = loop.plant.attitude[first:]
        sensed = np.append(p.c, np.zeros(self.size - n))  # y without what the engine and the damping force add
        # filters: x' = A x + into y, command = read x + direct (y - sensed x)
        self._into, self._read, self._direct = np.zeros(self.size), float(pilot.gain) * sensed, float(pilot.gain)
        at = n
        for b in blocks:
            rows = slice(at, at + len(b.B))
            self._A[rows] += np.outer(b.B, self._read)
            self._A[rows, rows] += b.A
            self._into[rows] = b.B * self._direct
            self._read, self._direct = float(b.D) * self._read, float(b.D) * self._direct
            self._read[rows] = b.C
            at += len(b.B)
        self._wind, self._wind_felt = np.zeros(n), 0.0
        if case.vehicle.aerodynamics is not None:  # the wind pushes where Z' resists
            moved = np.linalg.solve(loop.plant.mass, loop.plant.damping[:, 0])
            self._wind[-len(moved) :] = moved
            self._wind_felt = 0.0 if p.acceleration is None else float(p.acceleration @ moved)
        self._felt = p.acceleration is not None
        self._forces: list[Force] = []
        self._pushed = np.zeros(len(case.vehicle.tanks))  # y per unit of each damping acceleration
        self._moved = np.zeros((self.size, len(case.vehicle.tanks)))  # x' likewise
        half = n - loop.plant.mass.shape[-1]  # where the velocities start
        first_tank = half + loop.plant.first_tank
        self.velocities = slice(first_tank, first_tank + len(case.vehicle.tanks))  # of the slosh masses
        if fixed is None:
            inverse = np.linalg.inv(loop.plant.mass)
            for j, tank in enumerate(case.vehicle.tanks):
                self._forces.append(tank.damping.force(float(tank.frequency)))
                self._moved[half:n, j] = inverse[:, loop.plant.first_tank + j] * float(tank.slosh_mass)
                if p.acceleration is not None:
                    self._pushed[j] = p.acceleration @ self._moved[half:n, j]
        a = pilot.actuator
        self._limited = a is not None and a.limited
        limits = (None, None) if a is None else (a.deflection_limit, a.rate_limit)
        self._limits = (
            np.inf if limits[0] is None else float(limits[0]),
            np.inf if limits[1] is None else float(limits[1]),
        )
        self._laws = [] if fixed is not None else [tank.damping for tank in case.vehicle.tanks]
        self._by_state, self._by_input = self._probed()

    @functools.cached_property
    def _kinked(self) -> IntArray:
        """States at whose sign change a damping force has a kink; asked of single runs alone."""
        return np.asarray(self.velocities.start + np.flatnonzero([not constant(law) for law in self._laws]))

    def _probed(self) -> tuple[Array, Array]:
        """Return the matrices of x' on x and on the inputs: command, wind, damping accelerations.

        x' is linear in all of them but for an actuator's limits, so that two products do the work of `_assembled`. With
        limits the first input is the engine's acceleration, and its two states are left to `slope`.
        """
        n = len(self._pushed)
        zero, still = np.zeros(self.size), np.zeros(n)
        rest, unit = ((0.0, 0.0), (0.0, 1.0)) if self._limited else (None, None)
        by_state = [self._assembled(x, still, 0.0, 0.0, rest) for x in np.eye(self.size)]
        first = self._assembled(zero, still, 0.0 if self._limited else 1.0, 0.0, unit)
        wind = self._assembled(zero, still, 0.0, 1.0, rest)
        by_force = [self._assembled(zero, one, 0.0, 0.0, rest) for one in np.eye(n)]
        return np.stack(by_state, axis=-1), np.stack([first, wind, *by_force], axis=-1)

    def commands(self, states: Array, wind: Array) -> Array:
        """Return the engine commands before the delay, rad, of states (K, size) in wind (K,)."""
        if self._felt and self._direct:
            return np.array([self._command(x, self._damping(x), u) for x, u in zip(states, wind, strict=True)])
        return states @ self._read

    def engine(self, states: Array, command: Array) -> Array:
        """Return the engine angles, rad, of states (K, size) and commands (K,) as they reach the actuator."""
        return states[:, self._engine] @ self._angle + self._through * command

    def slope(self, x: Array, delayed: float | None, push: float, wind: float) -> Array:
        """Return x' with the delayed command in rad, or where that is None with the command of this moment.

        push, wind: disturbances of the command in rad and of the lateral wind in m/s.
        """
        forces = self._damping(x)
        command = (self._command(x, forces, wind) if delayed is None else delayed) + push
        if not self._limited:
            return np.asarray(self._by_state.dot(x) + self._by_input.dot([command, wind, *forces]))
        rate, acceleration = self._actuate(float(x[-2]), float(x[-1]), command)
        slope = self._by_state.dot(x) + self._by_input.dot([acceleration, wind, *forces])
        slope[-2], slope[-1] = rate, acceleration
        return np.asarray(slope)

    def _assembled(
        self, x: Array, forces: Array, command: float, wind: float, motion: tuple[float, float] | None
    ) -> Array:
        """Return x' piece by piece; motion: rate and acceleration of an engine with limits, None without."""
        slope = self._A @ x
        beta, acceleration = self._through * command, 0.0
        if self._actuator is not None:
            states = x[self._engine]
            beta += float(self._angle @ states)
            if motion is not None:
                acceleration = motion[1]
            else:
                slope[self._engine] += self._drive * command
                acceleration = float(self._jerk @ states) + self._jerk_through * command
        slope[: self._plant] += self._b * beta + self._b2 * acceleration + self._wind * wind
        slope += self._moved @ forces
        if self._felt:
            slope += self._into * (self._at_once(forces, beta, acceleration) + self._wind_felt * wind)
        return slope

    def _damping(self, x: Array) -> list[float]:
        """Return the acceleration of each slosh mass by its law of damping; none with fixed ratios."""
        if not self._forces:
            return [0.0] * len(self._pushed)
        velocities = x[self.velocities].tolist()
        return [force(v) for force, v in zip(self._forces, velocities, strict=True)]

    def _at_once(self, forces: Sequence[float] | Array, beta: float, acceleration: float) -> float:
        """Return what an accelerometer feels of the engine and of the damping forces, times its gain."""
        return self._d * beta + self._d2 * acceleration + float(self._pushed @ forces)

    def _command(self, x: Array, forces: Sequence[float], wind: float) -> float:
        command = float(self._read.dot(x))
        if self._felt and self._direct:  # then the actuator lags by itself: its states give beta and beta''
            states = x[self._engine]
            felt = self._at_once(forces, float(self._angle @ states), float(self._jerk @ states))
            command += self._direct * (felt + self._wind_felt * wind)
        return command

    @property
    def matrices(self) -> "Matrices":
        """The same equations as numbers, for a kernel."""
        felt = self._direct if self._felt else 0.0  # then the actuator lags by itself: its states give beta and beta''
        command, engine = np.zeros(self.size + 1 + len(self._pushed)), np.zeros(self.size + 1)
        command[: self.size] = self._read
        command[self._engine] += felt * (self._d * self._angle + self._d2 * self._jerk)
        command[self.size], command[self.size + 1 :] = felt * self._wind_felt, felt * self._pushed
        engine[self._engine], engine[self.size] = self._angle, self._through
        a = self._actuator
        limits = np.zeros(0)
        if self._limited and a is not None and a.frequency is not None and a.damping is not None:
            limits = np.array([a.frequency, a.damping, *self._limits, a.deadband or 0.0])
        return Matrices(by_state=self._by_state, by_input=self._by_input, command=command, engine=engine, limits=limits)

    def outside(self, x: Array) -> bool:
        """Whether a slosh velocity lies beyond the data of its law."""
        return bool(np.any(np.isnan(self._damping(x))))

    def kinks(self, x: Array) -> list[float]:
        """Return what changes sign where x' has a kink or a jump: slosh velocities, engine beyond its rate and stop."""
        at_rest: list[float] = x[self._kinked].tolist()
        if not self._limited:
            return at_rest
        stop, fastest = self._limits
        angle, rate = float(x[-2]), float(x[-1])
        return [*at_rest, angle - stop, -angle - stop, rate - fastest, -rate - fastest]

    def held(self, x: Array) -> Array:
        """Return states (..., size) with the engine at its limits where they are beyond; themselves where none is."""
        if not self._limited:
            return x
        most = np.array(self._limits)
        if not np.any(np.abs(x[..., -2:]) > most):
            return x
        within = x.copy()
        within[..., -2:] = np.clip(x[..., -2:], -most, most)
        return within

    def _actuate(self, angle: float, rate: float, command: float) -> tuple[float, float]:
        """Return rate and acceleration of the engine; at a limit it does not move outward."""
        a = self._actuator
        assert a is not None
        assert a.frequency is not None
        assert a.damping is not None
        stop, fastest = self._limits
        w, zeta = float(a.frequency), float(a.damping)
        return actuator_motion(angle, rate, command, w, zeta, stop, fastest, a.deadband or 0.0)


def constant(law: DampingLaw) -> bool:
    """Whether a law damps alike at every amplitude: 30 %, more than any slosh has, is reached at once or never."""
    return float(law.amplitude(0.3)) in (0.0, np.inf)


def _engine(actuator: Actuator | None) -> tuple[Array, Array, Array, float]:
    """Return A, B, C, D from the command to the engine angle; a second-order actuator has angle and rate for states."""
    if actuator is None:
        return np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0
    block = actuator_block(actuator)
    return block.A, block.B, block.C, float(block.D)
