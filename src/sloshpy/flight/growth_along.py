"""Growth of one slosh mode along a phase: da/dt = (sigma(a, t) + alpha(t)) a.

sigma is the growth curve of the frozen loop (see `limit_cycle.growth`), the mode followed in time by continuity. alpha
is what the slow change itself does. Write the loop as x' = A(t) x with the slosh mass's own momentum kept,

    m_j z_j'' -> (m_j z_j')' ,  that is  z_j'' gains -(m_j'/m_j) z_j'          (dA in that row)

and a mode as x = a(t) r(t) exp(int lambda dt), its right vector r scaled so that the slosh of its own tank is 1. To
first order in the rates of change, l the left vector,

    alpha = Re[ -(l . r') + l . dA r ] / (l . r)

For one undamped oscillator that is -(1/2) d ln(m w)/dt, so that m w a^2, its energy over its frequency, is kept. The
momentum term is that of the wave: with kappa(h) of the falling depth, the surface's (eta'/kappa)' + g eta = 0 becomes
(m z')' + m w^2 z = 0 in the slosh mass's displacement z, since m goes as kappa in a cylinder and eta as m z.

A delay tau(t) is a chain of states at the pace 1/tau, through which a signal takes not tau but tau - tau' tau / 2: what
went in later goes faster or slower. What comes out of the line is u(t - tau(t)), so that alpha gains (tau tau' / 2)
d sigma / d tau.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.autopilot.blocks import LEAST_DELAY
from sloshpy.dynamics import Loop, open_loop
from sloshpy.dynamics.states import system_matrix
from sloshpy.errors import OutsideValidity
from sloshpy.flight.trajectory import Phase
from sloshpy.limit_cycle.branch import Follower, Mode
from sloshpy.limit_cycle.growth import follow
from sloshpy.units import Array, ComplexArray, IntArray

if TYPE_CHECKING:
    import xarray as xr

MOST_MIXING = 0.1  # more, and the error is that of a mode taken for two
DELAY_STEP = 1e-3  # of the delay, over which the state matrix is derived by it
LONGEST = 2.0  # s, of a step of the amplitude: sigma and alpha change over tens of seconds


@dataclass(frozen=True, kw_only=True)
class FlightGrowth:
    """The amplitude of one slosh mode along a phase.

    time: (S,), s. amplitude: (S,), m of the mode's own tank. growth, adiabatic: (S,), 1/s, sigma and alpha.
    slosh: (S, n_tanks), m, of all tanks. tvc: (S,), rad. pole: (S,), rad/s. start, finish: the mode at both ends,
    at the phase's time before the start and after the end.
    mixing: (S,), share of another mode that the change brings into the slosh of the mode's own tank, to first order:
    |l_k . A' r| / |lambda - lambda_k|^2, in slosh. Where it is not small, no one mode describes the motion.
    """

    phase: Phase
    tank: str
    time: Array
    amplitude: Array
    growth: Array
    adiabatic: Array
    slosh: Array
    tvc: Array
    pole: ComplexArray
    mixing: Array
    start: Mode
    finish: Mode

    @property
    def factor(self) -> float:
        """Amplitude at the end over that at the start."""
        return float(self.amplitude[-1] / self.amplitude[0])

    @property
    def greatest(self) -> int:
        """Where the amplitude is greatest."""
        return int(np.argmax(self.amplitude))

    @property
    def led_by(self) -> str:
        """Tank that moves most at the end, weighed by its slosh mass: another than the mode's own has taken it over."""
        masses = [float(t.slosh_mass) for t in self.phase.cases[-1].vehicle.tanks]
        return self.phase.tanks[int(np.argmax(self.slosh[-1] ** 2 * masses))]

    def __str__(self) -> str:
        k = self.greatest
        own = "" if self.led_by == self.tank else f"; {self.led_by} slosh has taken the mode over"
        change = float(np.trapezoid(self.adiabatic, self.time))
        mixed = float(np.max(self.mixing))
        at = self.time[int(np.argmax(self.mixing))]
        caution = (
            f"\n  caution: at {at:g} s the change mixes {100.0 * mixed:.3g} % of another mode in: simulate it"
            if mixed > MOST_MIXING
            else ""
        )
        return (
            f"{self.tank} slosh from {self.amplitude[0]:.4g} m at {self.time[0]:g} s to {self.amplitude[-1]:.4g} m at "
            f"{self.time[-1]:g} s, factor {self.factor:.4g} ({self.phase.name}){own}\n"
            f"  at most {self.amplitude[k]:.4g} m at {self.time[k]:g} s, engine {1e3 * np.max(self.tvc):.4g} mrad; "
            f"the change of the vehicle itself gives a factor of {np.exp(change):.4g}{caution}"
        )

    def to_dataset(self) -> "xr.Dataset":
        """Return the course as an xarray Dataset over time."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "amplitude": ("time", self.amplitude, {"units": "m"}),
                "growth": ("time", self.growth, {"units": "1/s"}),
                "adiabatic": ("time", self.adiabatic, {"units": "1/s"}),
                "omega": ("time", self.pole.imag, {"units": "rad/s"}),
                "slosh": (["time", "of"], self.slosh, {"units": "m"}),
                "tvc": ("time", self.tvc, {"units": "rad"}),
                "mixing": ("time", self.mixing, {"units": "1"}),
            },
            coords={"time": ("time", self.time, {"units": "s"}), "of": list(self.phase.tanks)},
            attrs={"tank": self.tank, "phase": self.phase.name},
        )


def growth_along(
    phase: Phase, tank: int | str = 0, amplitude: float = 0.01, start: float | None = None, end: float | None = None
) -> FlightGrowth:
    """Return the amplitude of a tank's slosh mode along a phase, from one amplitude on.

    sigma and alpha are taken at the times of the phase and linear between them; alpha at the damping of the mode when
    it is first there. An event ends it: `growth_across` goes on behind those that leave vehicle and liquid alone.

    Args:
        phase: its times close enough that sigma is nearly linear between them.
        tank: name or number of the tank whose mode and amplitude are meant.
        amplitude: at the start, m, > 0.
        start, end: s, within the phase; default: its ends.

    Raises:
        OutsideValidity: a time outside the phase, an amplitude beyond the damping data, a mode that is lost.
    """
    j = phase.case.tank_index(tank)
    t0 = float(phase.time[0]) if start is None else start
    t1 = float(phase.time[-1]) if end is None else end
    if not (amplitude > 0.0 and t1 > t0):
        raise ValueError(
            f"wants an amplitude > 0 m and an end after the start, has {amplitude:g} m, {t0:g} and {t1:g} s"
        )
    course = _Course(phase, j)
    k, _ = phase.place(t0)
    phase.place(t1)
    course.begin(k, amplitude)
    first = course.state(t0, amplitude)
    steps = int(np.ceil((t1 - t0) / LONGEST))
    time = np.linspace(t0, t1, steps + 1)
    h, y = (t1 - t0) / steps, np.log(amplitude)
    rows = [first]
    for t in time[:-1]:
        k1 = rows[-1].rate
        k2 = course.state(t + 0.5 * h, np.exp(y + 0.5 * h * k1)).rate
        k3 = course.state(t + 0.5 * h, np.exp(y + 0.5 * h * k2)).rate
        k4 = course.state(min(t + h, t1), np.exp(y + h * k3)).rate
        y += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        rows.append(course.state(min(t + h, t1), float(np.exp(y))))
    return FlightGrowth(
        phase=phase,
        tank=phase.tanks[j],
        time=time,
        amplitude=np.array([row.amplitude for row in rows]),
        growth=np.array([row.growth for row in rows]),
        adiabatic=np.array([row.adiabatic for row in rows]),
        slosh=np.array([row.slosh for row in rows]),
        tvc=np.array([row.tvc for row in rows]),
        pole=np.array([row.pole for row in rows]),
        mixing=np.array([row.mixing for row in rows]),
        start=course.near[k],
        finish=course.near[phase.place(t1)[0] + 1],
    )


@dataclass(frozen=True, kw_only=True)
class _State:
    """The mode at one time and amplitude, linear between the two times of the phase beside it."""

    amplitude: float
    growth: float
    adiabatic: float
    slosh: Array
    tvc: float
    pole: complex
    mixing: float

    @property
    def rate(self) -> float:
        return self.growth + self.adiabatic


class _Course:
    """The mode of one tank at the times of a phase: found once at each, then followed in amplitude."""

    def __init__(self, phase: Phase, tank: int) -> None:
        self.phase, self.tank = phase, tank
        self.near: dict[int, Mode] = {}
        self._adiabatic: dict[int, tuple[float, float]] = {}
        self._loops: dict[int, Loop] = {}
        self._batch = open_loop(phase.case, phase.small_damping)

    def begin(self, k: int, amplitude: float) -> None:
        """Find the mode at one time, from small amplitude on."""
        modes = follow(self.phase.cases[k], self.tank, amplitude)
        if not modes or abs(modes[-1].amplitude / amplitude - 1.0) > 1e-9:
            raise OutsideValidity(
                f"{self.phase.tanks[self.tank]}: no mode at {amplitude:g} m and {self.phase.time[k]:g} s: the damping "
                "data do not reach there, or another tank takes the mode over before"
            )
        self.near[k] = modes[-1]

    def state(self, time: float, amplitude: float) -> _State:
        """Return the mode at a time and an amplitude."""
        k, part = self.phase.place(time)
        (one, a), (other, b) = self._at(k, amplitude), self._at(k + 1, amplitude)

        def mixed(x: float, y: float) -> float:
            return float((1.0 - part) * x + part * y)

        return _State(
            amplitude=amplitude,
            growth=mixed(one.pole.real, other.pole.real),
            adiabatic=mixed(a[0], b[0]),
            mixing=max(a[1], b[1]),
            slosh=np.asarray((1.0 - part) * one.slosh + part * other.slosh),
            tvc=mixed(one.tvc, other.tvc),
            pole=complex((1.0 - part) * one.pole + part * other.pole),
        )

    def _at(self, k: int, amplitude: float) -> tuple[Mode, tuple[float, float]]:
        """Return the mode at one of the times, from one at a neighbouring time or amplitude, its alpha and mixing."""
        case = self.phase.cases[k]
        near = self.near.get(k) or self.near[k - 1 if k - 1 in self.near else k + 1]
        follower = Follower(loop=self._loop(k), laws=[t.damping for t in case.vehicle.tanks], tank=self.tank)
        mode = follower.at(amplitude, near)
        if mode is None:
            raise OutsideValidity(
                f"{self.phase.tanks[self.tank]}: its mode is lost at {amplitude:.4g} m and {self.phase.time[k]:g} s: "
                "the damping data end, or the times lie too far apart"
            )
        self.near[k] = mode
        if k not in self._adiabatic:
            self._adiabatic[k] = self._alpha(k, mode)
        return mode, self._adiabatic[k]

    def _loop(self, k: int) -> Loop:
        if k not in self._loops:
            self._loops[k] = open_loop(self.phase.cases[k])
        return self._loops[k]

    def _alpha(self, k: int, mode: Mode) -> tuple[float, float]:
        """Return alpha, 1/s, and mixing at one of the times: differences to its neighbours, the damping held."""
        t, pilot = self.phase.time, self._batch.autopilot
        low, high = max(k - 1, 0), min(k + 1, len(t) - 1)
        span = float(t[high] - t[low])
        tau = np.broadcast_to(np.asarray(pilot.delay, dtype=float), t.shape)
        faster = float(tau[high] - tau[low]) / span
        own = max(float(tau[k]), LEAST_DELAY) if faster else float(tau[k])
        # the delay held, that 1/tau is no difference of far values; one batch, that all have the same states
        nudge = DELAY_STEP * own
        delay = np.array([own, own, own, own - nudge, own + nudge])
        before, here, after, less, more = self._matrix(mode, np.array([low, k, high, k, k]), delay)
        rate, by_delay = (after - before) / span, (more - less) / (2.0 * nudge) if faster else np.zeros_like(here)
        logs = [np.log(self._loop(i).plant.tank_mass) for i in (low, high)]
        mass_rate = (logs[1] - logs[0]) / span
        whole = rate + by_delay * faster
        alpha, mixing, by_tau = adiabatic_rate(self._loop(k), here, whole, mass_rate, mode.pole, self.tank, by_delay)
        return alpha + 0.5 * float(tau[k]) * faster * by_tau, mixing

    def _matrix(self, mode: Mode, at: IntArray, delay: Array) -> Array:
        """Return the state matrices at some times, (len(at), N, N), with other delays in s."""
        loop = self._batch.take(at)
        pilot = loop.autopilot.model_copy(update={"delay": delay})
        return system_matrix(replace(loop, autopilot=pilot, damping=np.tile(mode.damping, (len(at), 1))))[0]


def adiabatic_rate(
    loop: Loop, A: Array, rate: Array, mass_rate: Array, pole: complex, tank: int, by: Array
) -> tuple[float, float, float]:
    """Return alpha of the mode nearest a pole, 1/s, how much of another mode the change brings in, and d sigma / dp.

    Args:
        loop: one loop. A: its state matrix. rate: dA/dt. mass_rate: (n_tanks,), d ln m_j / dt, 1/s.
        pole: rad/s. tank: number of the tank whose slosh the amplitude is. by: dA/dp.
    """
    value, right = np.linalg.eig(A)
    left = np.linalg.inv(right)
    n = int(np.argmin(np.abs(value - pole)))
    own, velocity = slosh_rows(loop)
    r, l = right[:, n], left[n]
    turned, mixing = np.zeros(len(value), dtype=complex), 0.0  # r' without a part along r itself
    for k in range(len(value)):
        if k != n:
            part = (left[k] @ rate @ r) / (value[n] - value[k]) * right[:, k]
            turned += part
            mixing = max(mixing, float(abs(part[own[tank]] / (value[n] - value[k]) / r[own[tank]])))
    along = -turned[own[tank]] / r[own[tank]]  # the slosh of the mode's own tank stays 1
    momentum = -np.sum(mass_rate * l[velocity] * r[velocity])
    return float((-along + momentum).real), mixing, float((l @ by @ r).real)


def slosh_rows(loop: Loop) -> tuple[Array, Array]:
    """Return where the slosh displacements and their rates stand in the state of the loop, (n_tanks,) each."""
    p = loop.plant
    displacement = np.arange(p.slosh_states.start, p.slosh_states.stop)
    return displacement, displacement + p.mass.shape[-1]
