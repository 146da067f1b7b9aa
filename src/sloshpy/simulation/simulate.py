"""Time history of the closed loop with nonlinear slosh damping, fig 9.

    x' = A x + b beta(t) + sum_j g_j acc_j(z_j')        acc_j: the damping law's own force, not its linear equivalent

Integrated by SciPy's adaptive Runge-Kutta solvers, which `march` keeps from stepping over jumps and kinks; the delay is
a true delay line.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.states import system_matrix
from sloshpy.simulation.envelope import Envelope, settled_envelope
from sloshpy.simulation.march import MOST_STEPS, STABLE, march
from sloshpy.simulation.model import Model, constant
from sloshpy.simulation.signals import Noise, Signal
from sloshpy.units import Array, Real

if TYPE_CHECKING:
    import xarray as xr

INITIAL_SLOSH = 0.01  # m
RTOL = 1e-6  # a limit cycle to 1e-5 of its amplitude, see the tests
ATOL = 1e-12  # so that what comes to rest comes below the 1e-9 that counts as rest
LONGEST_STEP = 1.0  # radian of the fastest slosh, so that no step holds two sign changes of its velocity


@dataclass(frozen=True, kw_only=True)
class TimeHistory:
    """Slosh, engine angle and attitude over time.

    time: (T,), s. slosh: (T, n_tanks), m. tvc: (T,), rad, at the engine. attitude: (T,), rad.
    step: s. stopped: why the run ended early, "" where it did not. linear: nothing in the loop depends on the
    amplitude, so that it grows or decays for ever.
    """

    case: Case
    time: Array
    slosh: Array
    tvc: Array
    attitude: Array
    step: float
    stopped: str
    linear: bool = False

    def slosh_envelope(self, tank: int = 0) -> Envelope:
        """Return amplitude in m and frequency of a tank's settled slosh, or why there is none."""
        return self._envelope(self.slosh[:, tank])

    @property
    def tvc_envelope(self) -> Envelope:
        """Amplitude in rad and frequency of the settled engine motion, or why there is none."""
        return self._envelope(self.tvc)

    @property
    def left(self) -> float:
        """Greatest motion of the last tenth of the run over that of all of it; of tanks and engine what keeps most."""
        moved = np.abs(np.column_stack([self.slosh, self.tvc]))
        greatest = np.max(moved, axis=0)
        last = np.max(moved[-(1 + len(moved) // 10) :], axis=0)
        return float(np.max(last[greatest > 0.0] / greatest[greatest > 0.0], initial=0.0))

    def _envelope(self, signal: Array) -> Envelope:
        if self.stopped:
            return Envelope(amplitude=np.nan, omega=np.nan, reason=f"stopped: {self.stopped}")
        found = settled_envelope(self.time, signal)
        if self.linear and found.settled and found.amplitude > 0.0:
            return Envelope(
                amplitude=np.nan, omega=np.nan, reason="a linear loop: it grows or decays, it has no limit cycle"
            )
        return found

    def __str__(self) -> str:
        lines = [f"{self.case.name}: {self.time[-1]:.1f} s, step {1e3 * self.step:.2f} ms"]
        for j, tank in enumerate(self.case.vehicle.tanks):
            most = np.nanmax(np.abs(self.slosh[:, j]))  # nan where the run stopped
            lines.append(f"  {tank.name} slosh at most {most:.4f} m; {_words(self.slosh_envelope(j), 'm', 1.0)}")
        most = 1e3 * np.nanmax(np.abs(self.tvc))
        lines.append(f"  engine at most {most:.4f} mrad; {_words(self.tvc_envelope, 'mrad', 1e3)}")
        return "\n".join(lines)

    def to_dataset(self) -> "xr.Dataset":
        """Return the histories as an xarray Dataset over time."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "slosh": (["time", "tank"], self.slosh, {"units": "m"}),
                "tvc": ("time", self.tvc, {"units": "rad"}),
                "attitude": ("time", self.attitude, {"units": "rad"}),
            },
            coords={
                "time": ("time", self.time, {"units": "s"}),
                "tank": [t.name for t in self.case.vehicle.tanks],
            },
            attrs={"case": self.case.name, "step_s": self.step, "stopped": self.stopped},
        )


def _words(envelope: Envelope, unit: str, scale: float) -> str:
    if not envelope.settled:
        return envelope.reason
    if envelope.amplitude == 0.0:
        return "comes to rest"
    return f"amplitude {scale * envelope.amplitude:.4f} {unit} at {envelope.omega / 2 / np.pi:.4f} Hz"


def simulate(
    case: Case,
    duration: float = 300.0,
    initial_slosh: Real = INITIAL_SLOSH,
    damping: Real | None = None,
    step: float | None = None,
    engine: Signal | None = None,
    wind: Signal | None = None,
    rtol: float = RTOL,
    atol: float = ATOL,
) -> TimeHistory:
    """Simulate a case from displaced slosh, disturbed or not; degrade its autopilot first to see a degraded loop.

    Args:
        case: one vehicle and autopilot; see `Autopilot.degraded`.
        duration: s.
        initial_slosh: displacement in m, one for all tanks or one for each; the vehicle starts at rest.
        damping: fixed damping ratios in place of the tanks' laws.
        step: s, at most, between the times of the history; default: a tenth of the fastest slosh radian and half of
            the fastest bending mode's. The integrator chooses its own steps.
        engine: disturbance of the engine command before the actuator, rad; see `signals`.
        wind: lateral wind, m/s; the case needs aerodynamics.
        rtol: error of an integrator's step, relative to each state.
        atol: likewise, absolute, in m, m/s, rad and rad/s.

    Raises:
        ValueError: more steps than a run can take: a delay of microseconds is no delay, leave it out.
        OutsideValidity: a damping table does not start at 0 m, so that its force is unknown.
    """
    _refuse(case, duration, step, engine, wind)
    loop = open_loop(case, damping)
    fastest = _fastest(loop, duration)
    slosh = float(np.max(loop.plant.tank_frequency, initial=0.0))
    longest = LONGEST_STEP / slosh if slosh else duration
    model = Model(loop, case, None if damping is None else loop.damping)
    start = np.zeros(model.size)
    start[loop.plant.slosh_states] = initial_slosh
    h = min(_spacing(slosh, case), step or duration)
    mesh: Array = h * np.arange(int(np.ceil(duration / h)) + 1, dtype=float)
    jumps = np.concatenate([np.zeros(0), *(signal.jumps for signal in (engine, wind) if signal is not None)])
    pilot = loop.autopilot
    ran = march(
        model, start, mesh, pilot, (_over(engine, mesh[-1]), _over(wind, mesh[-1])), jumps, longest, fastest, rtol, atol
    )
    count = len(ran.state)
    states, time = model.held(ran.state), mesh[:count]
    late = bool(pilot.delay) or pilot.sample_time is not None
    command = ran.command if late else model.commands(states, _at(wind, time))
    return TimeHistory(
        case=case,
        time=time,
        slosh=states[:, loop.plant.slosh_states],
        tvc=model.engine(states, command + _at(engine, time)),
        attitude=states @ model.attitude,
        step=h,
        stopped=ran.stopped,
        linear=_is_linear(case, damping) and engine is None and wind is None,
    )


def _refuse(case: Case, duration: float, step: float | None, engine: Signal | None, wind: Signal | None) -> None:
    """Refuse what cannot be simulated, before any work."""
    if not duration > 0.0:
        raise ValueError(f"duration must be > 0 s, is {duration:g} s")
    if step is not None and not step > 0.0:
        raise ValueError(f"step must be > 0 s, is {step:g} s")
    single(case, "simulate")
    if wind is not None and case.vehicle.aerodynamics is None:
        raise ValueError("wind acts by the aerodynamics, and the case has none")
    for noise in (engine, wind):
        if isinstance(noise, Noise) and duration > noise.period:
            raise ValueError(f"the noise repeats after {noise.period:.0f} s: give it more lines or run shorter")


def _fastest(loop: Loop, duration: float) -> float:
    """Return the fastest pole in rad/s, or refuse a run of too many steps."""
    prompt = replace(loop, autopilot=loop.autopilot.prompt)
    fastest = float(np.max(np.abs(np.linalg.eigvals(system_matrix(prompt)[0]))))
    period, delay = loop.autopilot.sample_time, float(loop.autopilot.delay)
    slow = (period, "the sample time") if period is not None else (delay or np.inf, "the delay")
    for h, cause in ((STABLE / fastest, "the fastest pole"), slow):
        if duration / h > MOST_STEPS:
            raise ValueError(
                f"{duration:g} s in steps of {h:.3g} s, which {cause} asks for, are more than {MOST_STEPS:.0e} steps"
            )
    return fastest


def _spacing(slosh: float, case: Case) -> float:
    """Return the spacing in s of a history in which every peak of slosh and bending shows."""
    bending = max((float(mode.frequency) for mode in case.vehicle.flexible_modes), default=0.0)
    return min(0.1 / slosh if slosh else np.inf, 0.5 / bending if bending else np.inf)


def _over(signal: Signal | None, end: float) -> Callable[[float], float]:
    if signal is None:
        return lambda t: 0.0
    return signal.until(end) if isinstance(signal, Noise) else lambda t: float(signal(t))


def _at(signal: Signal | None, time: Array) -> Array:
    return np.zeros_like(time) if signal is None else np.asarray(signal(time))


def _is_linear(case: Case, damping: Real | None) -> bool:
    actuator = case.autopilot.actuator
    limited = actuator is not None and actuator.limited
    return not limited and (damping is not None or all(constant(t.damping) for t in case.vehicle.tanks))
