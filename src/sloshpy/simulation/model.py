"""The state equations of one loop in the time domain: plant, filters, actuator; nonlinear damping and engine limits.

plant x --> sensed --> gain, filters --> command --> delay --> actuator --> beta, beta'' --> plant
"""

import numpy as np

from sloshpy.autopilot import Actuator
from sloshpy.autopilot.blocks import actuator_block, filter_block
from sloshpy.autopilot.motion import actuator_motion
from sloshpy.case import Case
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.sensed import fed
from sloshpy.units import Array


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
        self._forces: list[tuple[int, Array, object, float]] = []
        self._pushed = np.zeros(len(case.vehicle.tanks))  # y per unit of each damping acceleration
        if fixed is None:
            inverse = np.linalg.inv(loop.plant.mass)
            half = n - loop.plant.mass.shape[-1]  # where the velocities start
            for j, tank in enumerate(case.vehicle.tanks):
                i = loop.plant.first_tank + j  # a coordinate
                push = np.zeros(self.size)
                push[half:n] = inverse[:, i] * float(tank.slosh_mass)
                self._forces.append((half + i, push, tank.damping.acceleration, float(tank.frequency)))
                if p.acceleration is not None:
                    self._pushed[j] = p.acceleration @ push[half:n]

    def command(self, x: Array) -> float:
        """Return the engine command before the delay, rad."""
        return self._command(x, self._damping(x), 0.0)

    def command_slope(self, x: Array, slope: Array, h: float) -> float:
        """Return the command's time derivative over a step h, rad/s."""
        if self._felt and self._direct:  # not linear in the state where the damping force is felt at once
            small = 1e-3 * h * slope
            return (self.command(x + small) - self.command(x - small)) / (2e-3 * h)
        return float(self._read @ slope)

    def engine(self, x: Array, delayed: float, lag: int, push: Array) -> float:
        """Return the engine angle, rad; `push` as in `slope`."""
        command = (delayed if lag else self.command(x)) + float(push[0])
        return float(self._angle @ x[self._engine]) + self._through * command

    def slope(self, x: Array, delayed: float, lag: int, push: Array) -> Array:
        """Return x' with the delayed command, or without a delay that of this moment.

        push: (2,), disturbances of the command in rad and of the lateral wind in m/s.
        """
        forces, wind = self._damping(x), float(push[1])
        command = (delayed if lag else self._command(x, forces, wind)) + float(push[0])
        slope = self._A @ x
        beta, acceleration = self._through * command, 0.0
        if self._actuator is not None:
            states = x[self._engine]
            beta += float(self._angle @ states)
            if self._actuator.frequency is not None:
                slope[-2:] = self._actuate(float(x[-2]), float(x[-1]), command)
                acceleration = float(slope[-1])
            else:
                slope[self._engine] += self._drive * command
                acceleration = float(self._jerk @ states) + self._jerk_through * command
        slope[: self._plant] += self._b * beta + self._b2 * acceleration + self._wind * wind
        for force, (_, moved, _, _) in zip(forces, self._forces, strict=True):
            slope += moved * force
        if self._felt:
            slope += self._into * (self._at_once(forces, beta, acceleration) + self._wind_felt * wind)
        return slope

    def _damping(self, x: Array) -> list[float]:
        """Return the acceleration of each slosh mass by its law of damping."""
        return [law(x[i], w) for i, _, law, w in self._forces]  # type: ignore[operator]

    def _at_once(self, forces: list[float], beta: float, acceleration: float) -> float:
        """Return what an accelerometer feels of the engine and of the damping forces, times its gain."""
        return self._d * beta + self._d2 * acceleration + float(self._pushed[: len(forces)] @ forces)

    def _command(self, x: Array, forces: list[float], wind: float) -> float:
        command = float(self._read @ x)
        if self._felt and self._direct:  # then the actuator lags by itself: its states give beta and beta''
            states = x[self._engine]
            felt = self._at_once(forces, float(self._angle @ states), float(self._jerk @ states))
            command += self._direct * (felt + self._wind_felt * wind)
        return command

    def stopped(self, x: Array) -> Array:
        """Return the state with the engine at its stop where a step has carried it beyond."""
        stop = None if self._actuator is None else self._actuator.deflection_limit
        if stop is not None and abs(x[-2]) > stop:
            x[-2] = np.sign(x[-2]) * stop
        return x

    def _actuate(self, angle: float, rate: float, command: float) -> tuple[float, float]:
        """Return rate and acceleration of the engine; at a limit it does not move outward."""
        a = self._actuator
        assert a is not None
        assert a.frequency is not None
        assert a.damping is not None
        stop, fastest = (np.inf if x is None else x for x in (a.deflection_limit, a.rate_limit))
        return actuator_motion(angle, rate, command, a.frequency, a.damping, stop, fastest, a.deadband or 0.0)


def _engine(actuator: Actuator | None) -> tuple[Array, Array, Array, float]:
    """Return A, B, C, D from the command to the engine angle; a second-order actuator has angle and rate for states."""
    if actuator is None:
        return np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0
    if actuator.frequency is None:
        block = actuator_block(actuator)
        return block.A, block.B, block.C, float(block.D)
    square, lag = actuator.fraction[0][0], actuator.fraction[1][1]
    return np.array([[0.0, 1.0], [-square, -lag]]), np.array([0.0, square]), np.array([1.0, 0.0]), 0.0
