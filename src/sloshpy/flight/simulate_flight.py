"""Time history of a flight: the nonlinear loop of `simulation`, its coefficients linear in time within a phase.

    x' = f(x; vehicle and autopilot at t)   and   z_j'' gains -(m_j'/m_j) z_j'

M, I, c.g., thrust, stations, slosh masses and frequencies, gains, damping laws change with time. Of the terms that the
change itself brings the slosh mass's own momentum (m_j z_j')' is kept, in every row where m_j z_j'' stands. Z'' is the
lateral acceleration of the material at the c.g., and what leaves the vehicle takes its lateral velocity along: no M'
term. Left out: the jet damping of the engine (it damps attitude), the flow in the feed lines, and the travel of the
c.g. through the structure where Z' itself is a state (aerodynamics), of the order of its speed times phi'.
"""

from dataclasses import dataclass, replace

import numpy as np

from sloshpy.dynamics import Loop, open_loop
from sloshpy.dynamics.poles import controller, system_matrix
from sloshpy.errors import OutsideValidity
from sloshpy.flight.growth_along import FlightGrowth, slosh_rows
from sloshpy.flight.trajectory import Phase
from sloshpy.simulation.model import Model
from sloshpy.units import Array

DIVERGED = 1e3  # m or rad: far beyond any model of this package
MOST_STEPS = 5e6  # some minutes


@dataclass(frozen=True, kw_only=True)
class FlightHistory:
    """Slosh and engine angle along a phase.

    time: (S,), s. slosh: (S, n_tanks), m. tvc: (S,), rad. step: s. stopped: why it ended early, "" where it did not.
    """

    phase: Phase
    time: Array
    slosh: Array
    tvc: Array
    step: float
    stopped: str

    def peaks(self, tank: int) -> tuple[Array, Array]:
        """Return times in s and sizes in m of the extremes of a tank's slosh, each by the parabola through three."""
        z = np.abs(self.slosh[:, tank])
        k = np.flatnonzero((z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])) + 1
        slope, bend = 0.5 * (z[k + 1] - z[k - 1]), z[k + 1] - 2.0 * z[k] + z[k - 1]
        return self.time[k] - slope / bend * self.step, z[k] - 0.5 * slope**2 / bend


def simulate_flight(
    phase: Phase,
    initial: Array,
    start: float | None = None,
    end: float | None = None,
    step: float | None = None,
) -> FlightHistory:
    """Simulate the loop along a phase, nonlinear damping, actuator limits and a true delay line included.

    Args:
        phase: with a delay that does not change in it; without a sampler.
        initial: the state at the start, as of `mode_state`, or (n_tanks,), slosh displacements in m.
        start, end: s, within the phase; default: its ends.
        step: s, at most; default: 0.6 of the fastest pole's radian and a tenth of the fastest slosh radian.

    Raises:
        OutsideValidity: a delay that changes, a sampler, a time outside the phase.
    """
    t0 = float(phase.time[0]) if start is None else start
    t1 = float(phase.time[-1]) if end is None else end
    for time in (t0, t1):
        phase.place(time)
    if np.ptp(np.asarray(phase.case.autopilot.delay)) > 0.0 or phase.case.autopilot.sample_time is not None:
        raise OutsideValidity("a flight is simulated with a constant delay in each phase and without a sampler")
    loops = [open_loop(case) for case in phase.cases]
    choices = [_step_and_lag(loop, step) for loop in loops]
    h, lag = min(choices)
    if (t1 - t0) / h > MOST_STEPS:
        raise ValueError(f"{t1 - t0:g} s in steps of {h:.3g} s are more than {MOST_STEPS:.0e} steps")
    models = [Model(loop, case, None) for loop, case in zip(loops, phase.cases, strict=True)]
    displacement, velocity = slosh_rows(loops[0])
    masses = np.array([loop.plant.tank_mass for loop in loops])
    loss = np.diff(np.log(masses), axis=0) / np.diff(phase.time)[:, None]  # d ln m / dt in each interval
    x = np.zeros(models[0].size)
    given = np.asarray(initial, dtype=float)
    if given.shape == x.shape:
        x[:] = given
    else:
        x[displacement] = given
    steps = int(np.ceil((t1 - t0) / h))
    states, angle = np.zeros((steps + 1, len(x))), np.zeros(steps + 1)
    line, slopes = np.zeros(steps + 1 + lag), np.zeros(steps + 1 + lag)

    def slope(t: float, x: Array, delayed: float) -> Array:
        k, part = phase.place(min(t, float(phase.time[-1])))
        command = delayed if lag else None
        found = (1.0 - part) * models[k].slope(x, command, 0.0, 0.0)
        found += part * models[k + 1].slope(x, command, 0.0, 0.0)
        found[velocity] -= loss[k] * x[velocity]
        return found

    count, stopped = steps + 1, ""
    for n in range(steps + 1):
        states[n] = x
        t = t0 + n * h
        k, part = phase.place(min(t, float(phase.time[-1])))
        old = line[n], slopes[n], line[n + 1] if lag else 0.0, slopes[n + 1] if lag else 0.0
        delayed = (old[0], 0.5 * (old[0] + old[2]) + h / 8.0 * (old[1] - old[3]), old[2])
        if n < lag:
            delayed = (0.0, 0.0, 0.0)
        k1 = slope(t, x, delayed[0])
        here = _command(models, k, part, x)
        at = np.array([delayed[0] if lag else here])
        angle[n] = float((1.0 - part) * models[k].engine(x[None], at)[0] + part * models[k + 1].engine(x[None], at)[0])
        if lag:
            small = 1e-3 * h * k1
            after, before = (_command(models, k, part, x + sign * small) for sign in (1.0, -1.0))
            line[n + lag], slopes[n + lag] = here, (after - before) / (2e-3 * h)
            if lag == 1 and n > 0:
                delayed = (old[0], 0.5 * (old[0] + line[n + 1]) + h / 8.0 * (old[1] - slopes[n + 1]), line[n + 1])
        if n == steps:
            break
        k2 = slope(t + 0.5 * h, x + 0.5 * h * k1, delayed[1])
        k3 = slope(t + 0.5 * h, x + 0.5 * h * k2, delayed[1])
        k4 = slope(t + h, x + h * k3, delayed[2])
        x = models[k].held(x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4))
        if not float(np.max(np.abs(x))) < DIVERGED:
            stopped = f"{'beyond the damping data' if np.any(np.isnan(x)) else 'diverged'} at {t + h:.1f} s"
            count = n + 1
            break
    return FlightHistory(
        phase=phase,
        time=t0 + h * np.arange(count, dtype=float),
        slosh=states[:count][:, displacement],
        tvc=angle[:count],
        step=h,
        stopped=stopped,
    )


def _command(models: list[Model], k: int, part: float, x: Array) -> float:
    """Return the engine command before the delay, rad, between two times of the phase."""
    none = np.zeros(1)
    one, other = (float(models[i].commands(x[None], none)[0]) for i in (k, k + 1))
    return (1.0 - part) * one + part * other


def _step_and_lag(loop: Loop, most: float | None) -> tuple[float, int]:
    """Return the step in s, for the fastest pole and the slosh, and the delay in whole steps."""
    if most is not None and not most > 0.0:
        raise ValueError(f"step must be > 0 s, is {most:g} s")
    prompt = replace(loop, autopilot=loop.autopilot.prompt)
    fastest = float(np.max(np.abs(np.linalg.eigvals(system_matrix(prompt)[0]))))
    h = min(0.6 / fastest, 0.1 / float(np.max(loop.plant.tank_frequency)), most or np.inf)
    delay = float(loop.autopilot.delay)
    lag = int(np.ceil(delay / h))
    return (delay / lag, lag) if lag else (h, 0)


def mode_state(growth: FlightGrowth) -> Array:
    """Return the state of the simulation in which the mode of a growth, and it alone, swings at its start."""
    case, mode, t0 = growth.phase.at(float(growth.time[0])), growth.start, float(growth.time[0])
    k, _ = growth.phase.place(t0)
    loop = open_loop(growth.phase.cases[k], mode.damping)
    A, groups = system_matrix(loop)
    value, right = np.linalg.eig(A)
    r = right[:, int(np.argmin(np.abs(value - mode.pole)))]
    own = slosh_rows(loop)[0][growth.phase.tanks.index(growth.tank)]
    r = float(growth.amplitude[0]) * r / r[own]
    plant = len(groups) - sum(g.startswith(("filter", "delay", "actuator")) for g in groups)
    filters = [k for k, g in enumerate(groups) if g.startswith("filter")]
    parts = [r[:plant], r[filters]]
    actuator = case.autopilot.actuator
    if actuator is not None and actuator.frequency is not None:
        _, _, C, _, _ = controller(loop)
        beta = C @ r[plant:]
        parts.append(np.array([beta, mode.pole * beta]))
    elif actuator is not None:
        parts.append(r[[k for k, g in enumerate(groups) if g == "actuator"]])
    return np.asarray(np.concatenate(parts).real)


@dataclass(frozen=True, kw_only=True)
class GrowthCheck:
    """A growth along a phase against its simulation; difference: (P,), simulated over predicted amplitude less 1.

    time: (P,), s, of the peaks of the simulated slosh. simulated, predicted: (P,), m.
    """

    growth: FlightGrowth
    history: FlightHistory
    time: Array
    simulated: Array
    predicted: Array

    @property
    def difference(self) -> Array:
        return np.asarray(self.simulated / self.predicted - 1.0)

    @property
    def worst(self) -> float:
        """Greatest difference by size."""
        return float(np.max(np.abs(self.difference)))

    def __str__(self) -> str:
        end = f", {self.history.stopped}" if self.history.stopped else ""
        return (
            f"{self.growth}\n  simulated {self.simulated[-1]:.4g} m at {self.time[-1]:.2f} s, predicted "
            f"{self.predicted[-1]:.4g} m there; they differ by {100.0 * self.worst:.3g} % at most{end}"
        )


def check_growth(growth: FlightGrowth, step: float | None = None) -> GrowthCheck:
    """Simulate a growth from its own mode and return how far the amplitudes differ.

    Args:
        growth: of `growth_along`. step: s, at most, of the simulation.
    """
    history = simulate_flight(growth.phase, mode_state(growth), float(growth.time[0]), float(growth.time[-1]), step)
    time, simulated = history.peaks(growth.phase.tanks.index(growth.tank))
    kept = (time >= growth.time[0]) & (time <= growth.time[-1])
    if not np.any(kept):
        raise OutsideValidity("the simulation has no whole swing to compare")
    predicted = np.exp(np.interp(time[kept], growth.time, np.log(growth.amplitude)))
    return GrowthCheck(growth=growth, history=history, time=time[kept], simulated=simulated[kept], predicted=predicted)
