"""The state equations of one loop in the time domain: plant, filters, actuator; nonlinear damping and engine limits.

plant x --> sensed --> gain, filters --> command --> delay --> actuator --> beta, beta'' --> plant
"""

import numpy as np

from sloshpy.autopilot import Actuator
from sloshpy.autopilot.blocks import actuator_block, filter_block
from sloshpy.case import Case
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.plant import inertial_input, state_space
from sloshpy.units import Array


class Model:
    """One loop; the state holds the plant's, then the filters', then the actuator's."""

    def __init__(self, loop: Loop, case: Case, fixed: Array | None) -> None:
        """Assemble a loop; `fixed` are damping ratios in place of the tanks' laws."""
        A, self._b, C = state_space(loop.plant, np.zeros(len(loop.plant.tanks)) if fixed is None else fixed)
        self._b2 = inertial_input(loop.plant)
        pilot = case.autopilot
        n = self._plant = A.shape[0]
        sensed = float(pilot.gain) * (float(pilot.attitude_gain) * C[0] + float(pilot.rate_gain) * C[1])
        blocks = [filter_block(f) for f in pilot.filter]
        engine = _engine(pilot.actuator)
        k = sum(len(b.B) for b in blocks)
        self.size = n + k + len(engine[1])
        self._A = np.zeros((self.size, self.size))
        self._A[:n, :n] = A
        self.attitude = np.append(C[0], np.zeros(self.size - n))  # row of the measured attitude
        self._read = np.zeros(self.size)  # the command, before the delay
        self._read[:n] = sensed
        at = n
        for b in blocks:
            rows = slice(at, at + len(b.B))
            self._A[rows] += np.outer(b.B, self._read)
            self._A[rows, rows] += b.A
            self._read = float(b.D) * self._read
            self._read[rows] = b.C
            at += len(b.B)
        self._actuator = pilot.actuator
        self._engine, A_a = slice(at, self.size), engine[0]
        self._A[self._engine, self._engine] = A_a
        self._drive, self._angle, self._through = engine[1:]
        # beta'' = C A^2 x + C A B u, of an actuator two orders or more below; else the engine has no inertia
        self._jerk = self._angle @ A_a @ A_a
        self._jerk_through = float(self._angle @ A_a @ self._drive)
        self._forces: list[tuple[int, Array, object, float]] = []
        if fixed is None:
            inverse = np.linalg.inv(loop.plant.mass)
            half = n - loop.plant.mass.shape[-1]  # where the velocities start
            for j, tank in enumerate(case.vehicle.tanks):
                i = loop.plant.first_tank + j  # a coordinate
                push = np.zeros(self.size)
                push[half:n] = inverse[:, i] * float(tank.slosh_mass)
                self._forces.append((half + i, push, tank.damping.acceleration, float(tank.frequency)))

    def command(self, x: Array) -> float:
        """Return the engine command before the delay, rad."""
        return float(self._read @ x)

    def command_slope(self, x: Array, slope: Array) -> float:
        """Return the command's time derivative, rad/s."""
        return float(self._read @ slope)

    def engine(self, x: Array, delayed: float, lag: int) -> float:
        """Return the engine angle, rad."""
        return float(self._angle @ x[self._engine]) + self._through * (delayed if lag else self.command(x))

    def slope(self, x: Array, delayed: float, lag: int) -> Array:
        """Return x' with the delayed command; without a delay the command of this moment."""
        command = delayed if lag else self.command(x)
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
        slope[: self._plant] += self._b * beta + self._b2 * acceleration
        for i, push, law, w in self._forces:
            slope += push * law(x[i], w)  # type: ignore[operator]
        return slope

    def _actuate(self, angle: float, rate: float, command: float) -> tuple[float, float]:
        """Return rate and acceleration of the engine; at a limit it does not move outward."""
        a = self._actuator
        assert a is not None
        assert a.frequency is not None
        assert a.damping is not None
        stop, fastest = a.deflection_limit, a.rate_limit
        if stop is not None:
            command = min(max(command, -stop), stop)
        acceleration = a.frequency**2 * (command - angle) - 2.0 * a.damping * a.frequency * rate
        if fastest is not None and abs(rate) >= fastest:
            rate = fastest if rate > 0.0 else -fastest
            acceleration = min(acceleration, 0.0) if rate > 0.0 else max(acceleration, 0.0)
        if stop is not None and abs(angle) >= stop and rate * angle > 0.0:
            rate = 0.0
        return rate, acceleration


def _engine(actuator: Actuator | None) -> tuple[Array, Array, Array, float]:
    """Return A, B, C, D from the command to the engine angle; a second-order actuator has angle and rate for states."""
    if actuator is None:
        return np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0
    if actuator.frequency is None:
        block = actuator_block(actuator)
        return block.A, block.B, block.C, float(block.D)
    square, lag = actuator.fraction[0][0], actuator.fraction[1][1]
    return np.array([[0.0, 1.0], [-square, -lag]]), np.array([0.0, square]), np.array([1.0, 0.0]), 0.0
