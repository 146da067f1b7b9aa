"""Time history of the closed loop with nonlinear slosh damping, fig 9.

    x' = A x + b beta(t) + sum_j g_j acc_j(z_j')        acc_j: the damping law's own force, not its linear equivalent

Fixed-step Runge-Kutta of fourth order. The delay is a true delay line: the step divides it, and values between
steps come from the cubic through values and slopes, which keeps the order.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import system_matrix
from sloshpy.simulation.envelope import Envelope, settled_envelope
from sloshpy.simulation.model import Model
from sloshpy.simulation.signals import Noise, Signal
from sloshpy.units import Array, Real

if TYPE_CHECKING:
    import xarray as xr

DIVERGED = 1e3  # m or rad: far beyond any model of this package
INITIAL_SLOSH = 0.01  # m
MOST_STEPS = 5e6  # some minutes


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
            most = np.max(np.abs(self.slosh[:, j]))
            lines.append(f"  {tank.name} slosh at most {most:.4f} m; {_words(self.slosh_envelope(j), 'm', 1.0)}")
        most = 1e3 * np.max(np.abs(self.tvc))
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
) -> TimeHistory:
    """Simulate a case from displaced slosh, disturbed or not; degrade its autopilot first to see a degraded loop.

    Args:
        case: one vehicle and autopilot; see `Autopilot.degraded`.
        duration: s.
        initial_slosh: displacement in m, one for all tanks or one for each; the vehicle starts at rest.
        damping: fixed damping ratios in place of the tanks' laws.
        step: s, at most; default: a tenth of the fastest slosh radian and 0.6 of the fastest pole's.
        engine: disturbance of the engine command before the actuator, rad; see `signals`.
        wind: lateral wind, m/s; the case needs aerodynamics.

    Raises:
        ValueError: more steps than a run can take: a delay of microseconds is no delay, leave it out.
        OutsideValidity: a damping table does not start at 0 m, so that its force is unknown.
    """
    if not duration > 0.0:
        raise ValueError(f"duration must be > 0 s, is {duration:g} s")
    single(case, "simulate")
    loop = open_loop(case, damping)
    if wind is not None and case.vehicle.aerodynamics is None:
        raise ValueError("wind acts by the aerodynamics, and the case has none")
    for noise in (engine, wind):
        if isinstance(noise, Noise) and duration > noise.period:
            raise ValueError(f"the noise repeats after {noise.period:.0f} s: give it more lines or run shorter")
    h, lag = step_and_lag(loop, step)
    if duration / h > MOST_STEPS:
        cause = "the delay" if lag == 1 else "the fastest pole"
        raise ValueError(
            f"{duration:g} s in steps of {h:.3g} s, which {cause} asks for, are more than {MOST_STEPS:.0e} steps"
        )
    steps = int(np.ceil(duration / h))
    model = Model(loop, case, None if damping is None else loop.damping)
    x = np.zeros(model.size)
    x[loop.plant.slosh_states] = initial_slosh
    states, angle = np.zeros((steps + 1, model.size)), np.zeros(steps + 1)
    line, slopes = np.zeros(steps + 1 + lag), np.zeros(steps + 1 + lag)  # the delay line: nothing before t = 0
    mesh: Array = 0.5 * h * np.arange(2 * steps + 3, dtype=float)  # with the half steps
    pushed = np.stack([np.zeros_like(mesh) if signal is None else signal(mesh) for signal in (engine, wind)], axis=-1)
    stopped = ""
    count = steps + 1
    for k in range(steps + 1):
        states[k] = x
        old = line[k], slopes[k], line[k + 1] if lag else 0.0, slopes[k + 1] if lag else 0.0
        delayed = (old[0], 0.5 * (old[0] + old[2]) + h / 8.0 * (old[1] - old[3]), old[2])
        if k < lag:  # nothing comes out before the delay has passed, not on the way to the first value either
            delayed = (0.0, 0.0, 0.0)
        push = pushed[2 * k : 2 * k + 3]
        k1 = model.slope(x, delayed[0], lag, push[0])
        angle[k] = model.engine(x, delayed[0], lag, push[0])
        if lag:
            line[k + lag], slopes[k + lag] = model.command(x), model.command_slope(x, k1, h)
            if lag == 1 and k > 0:  # the newest value has just come in
                delayed = (old[0], 0.5 * (old[0] + line[k + 1]) + h / 8.0 * (old[1] - slopes[k + 1]), line[k + 1])
        if k == steps:
            break
        k2 = model.slope(x + 0.5 * h * k1, delayed[1], lag, push[1])
        k3 = model.slope(x + 0.5 * h * k2, delayed[1], lag, push[1])
        k4 = model.slope(x + h * k3, delayed[2], lag, push[2])
        x = model.stopped(x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4))
        size = float(np.max(np.abs(x)))
        if not size < DIVERGED:
            stopped = "beyond the damping data" if np.isnan(size) else "diverged"
            stopped += f" at {(k + 1) * h:.1f} s"
            count = k + 1
            break
    time = h * np.arange(count, dtype=float)
    return TimeHistory(
        case=case,
        time=time,
        slosh=states[:count, loop.plant.slosh_states],
        tvc=angle[:count],
        attitude=states[:count] @ model.attitude,
        step=h,
        stopped=stopped,
        linear=_is_linear(case, damping) and engine is None and wind is None,
    )


def _is_linear(case: Case, damping: Real | None) -> bool:
    actuator = case.autopilot.actuator
    limited = actuator is not None and actuator.limited
    constant = all(float(t.damping.amplitude(0.3)) in (0.0, np.inf) for t in case.vehicle.tanks)
    return not limited and (damping is not None or constant)


def step_and_lag(loop: Loop, most: float | None) -> tuple[float, int]:
    """Return the step in s and the delay in whole steps."""
    if most is not None and not most > 0.0:
        raise ValueError(f"step must be > 0 s, is {most:g} s")
    bare = loop.autopilot.model_copy(update={"delay": 0.0})
    poles = np.linalg.eigvals(system_matrix(replace(loop, autopilot=bare))[0])
    fastest = float(np.max(np.abs(poles)))
    slosh = float(np.max(loop.plant.tank_frequency, initial=0.0))
    h = min(0.6 / fastest, 0.1 / slosh if slosh else np.inf, most or np.inf)
    delay = float(loop.autopilot.delay)
    if delay == 0.0:
        return h, 0
    lag = int(np.ceil(delay / h))
    return delay / lag, lag
