"""The equations of motion along one phase, those of two neighbouring times mixed, and their march in equal steps."""

from dataclasses import dataclass, replace

import numpy as np

from sloshpy.dynamics import Loop, open_loop
from sloshpy.dynamics.states import system_matrix
from sloshpy.flight.command_record import CommandRecord, delays, emptied_after
from sloshpy.flight.growth_along import slosh_rows
from sloshpy.flight.trajectory import Phase
from sloshpy.simulation.model import Model
from sloshpy.units import Array

DIVERGED = 1e3  # m or rad: far beyond any model of this package
MOST_STEPS = 5e6  # some minutes
SMALL = 1e-3  # of a step, over which the slope of the command is taken
CALM = np.zeros(1)  # m/s of wind


@dataclass(frozen=True, kw_only=True)
class Part:
    """What one phase of a simulation shows.

    time: (S,), s. state: (S, N). slosh: (S, n_tanks), m. tvc: (S,), rad. step: s. stopped: why it ended early, else "".
    """

    time: Array
    state: Array
    slosh: Array
    tvc: Array
    step: float
    stopped: str


@dataclass(frozen=True, kw_only=True)
class Equations:
    """The loop along a phase.

    models: (T,). loss: (T-1, n_tanks), d ln m / dt in each interval, 1/s. displacement, velocity: rows of the slosh in
    the state. delay: (T,), s. longest: step, s.
    """

    phase: Phase
    models: tuple[Model, ...]
    loss: Array
    displacement: Array
    velocity: Array
    delay: Array
    longest: float

    @classmethod
    def of(cls, phase: Phase) -> "Equations":
        """Assemble the equations of a phase.

        Raises:
            OutsideValidity: a sampler, or a delay that no line can have.
        """
        delay = delays(phase)
        loops = [open_loop(case) for case in phase.cases]
        displacement, velocity = slosh_rows(loops[0])
        masses = np.array([loop.plant.tank_mass for loop in loops])
        return cls(
            phase=phase,
            models=tuple(Model(loop, case, None) for loop, case in zip(loops, phase.cases, strict=True)),
            loss=np.diff(np.log(masses), axis=0) / np.diff(phase.time)[:, None],
            displacement=displacement,
            velocity=velocity,
            delay=delay,
            longest=min(_longest_step(loop) for loop in loops),
        )

    def march(self, x: Array, begin: float, end: float, most: float, record: CommandRecord) -> Part:
        """Integrate from a state, begin to end in s, by Runge-Kutta steps of order four of at most so many s."""
        times, empty = self.steps(begin, end, most)
        record.begin()
        states, angle, stopped = [], [], ""
        for n, t in enumerate(times.tolist()):
            h = float(times[n + 1]) - t if n + 1 < len(times) else times[n] - float(times[n - 1])
            old = n < empty  # in this step the line still holds what went in before
            delayed = self._delayed(t, old, record)
            k1, here = self.slope(t, x, delayed), self.command(t, x)
            states.append(x)
            angle.append(self._engine(t, x, here if delayed is None else delayed))
            nudge = SMALL * h * k1
            record.add(t, here, (self.command(t, x + nudge) - self.command(t, x - nudge)) / (2.0 * SMALL * h))
            if n + 1 == len(times):
                break
            half, whole = (self._delayed(t + part * h, old, record) for part in (0.5, 1.0))
            k2 = self.slope(t + 0.5 * h, x + 0.5 * h * k1, half)
            k3 = self.slope(t + 0.5 * h, x + 0.5 * h * k2, half)
            k4 = self.slope(t + h, x + h * k3, whole)
            x = self.models[self._place(t)[0]].held(x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4))
            if not float(np.max(np.abs(x))) < DIVERGED:
                stopped = f"{'beyond the damping data' if np.any(np.isnan(x)) else 'diverged'} at {t + h:.1f} s"
                break
        state = np.array(states)
        return Part(
            time=times[: len(state)],
            state=state,
            slosh=state[:, self.displacement],
            tvc=np.array(angle),
            step=float(np.max(np.diff(times))),
            stopped=stopped,
        )

    def slope(self, t: float, x: Array, delayed: float | None) -> Array:
        """Return x' at a time in s, with the command that comes out of the line, rad; None where there is no line."""
        k, part = self._place(t)
        found = (1.0 - part) * self.models[k].slope(x, delayed, 0.0, 0.0)
        found += part * self.models[k + 1].slope(x, delayed, 0.0, 0.0)
        found[self.velocity] -= self.loss[k] * x[self.velocity]
        return np.asarray(found)

    def command(self, t: float, x: Array) -> float:
        """Return the engine command before the delay, rad."""
        k, part = self._place(t)
        one, other = (float(self.models[i].commands(x[None], CALM)[0]) for i in (k, k + 1))
        return (1.0 - part) * one + part * other

    def _engine(self, t: float, x: Array, command: float) -> float:
        k, part = self._place(t)
        one, other = (float(self.models[i].engine(x[None], np.array([command]))[0]) for i in (k, k + 1))
        return (1.0 - part) * one + part * other

    def _place(self, t: float) -> tuple[int, float]:
        return self.phase.place(min(t, float(self.phase.time[-1])))

    def steps(self, begin: float, end: float, most: float) -> tuple[Array, int]:
        """Return the times of the steps, s, and how many steps it takes until the line holds nothing from before.

        The line is empty of it at the end of a step, so that no step crosses the jump. The last step may be short.
        """
        longest = min(self.longest, most)
        empty, h = 0, longest
        if np.any(self.delay > 0.0):
            waits = emptied_after(self.phase, self.delay, begin)
            empty = int(np.ceil(waits / min(longest, float(np.min(self.delay))) * (1.0 - 1e-12)))
            h = waits / empty
        if (end - begin) / h > MOST_STEPS:
            raise ValueError(f"{end - begin:g} s in steps of {h:.3g} s are more than {MOST_STEPS:.0e} steps")
        times = begin + h * np.arange(np.floor((end - begin) / h) + 1.0)
        if end - times[-1] > 1e-6 * h:
            return np.append(times, end), empty
        return np.append(times[:-1], end), empty

    def _delayed(self, t: float, old: bool, record: CommandRecord) -> float | None:
        """Return the command that comes out of the line at a time in s, rad; None without a delay."""
        if not np.any(self.delay > 0.0):
            return None
        then = t - float(np.interp(t, self.phase.time, self.delay))
        return record.before(then) if old else record.within(then)


def _longest_step(loop: Loop) -> float:
    """Return the step in s for the fastest pole and the slosh."""
    prompt = replace(loop, autopilot=loop.autopilot.prompt)
    fastest = float(np.max(np.abs(np.linalg.eigvals(system_matrix(prompt)[0]))))
    return min(0.6 / fastest, 0.1 / float(np.max(loop.plant.tank_frequency)))
