"""The exact limit cycle: a periodic solution of the nonlinear equations, with its stability.

One sinusoid (`growth`) starts it, harmonic balance makes it exact, Floquet multipliers say whether it attracts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case, continuous
from sloshpy.damping import DampingLaw, ratios
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle.branch import mode_shape
from sloshpy.limit_cycle.cycle import Cycle
from sloshpy.limit_cycle.cycles import one_sinusoid_cycles
from sloshpy.limit_cycle.floquet import Floquet, floquet
from sloshpy.limit_cycle.harmonic_balance import balance, residual, solve
from sloshpy.limit_cycle.waveform import Waveform, peak, share, waveform
from sloshpy.units import Array, ComplexArray

if TYPE_CHECKING:
    import xarray as xr

FIRST = 8  # odd harmonics of the first solution
CONVERGED = 1e-8  # relative change of the amplitudes when the harmonics are doubled


@dataclass(frozen=True, kw_only=True)
class OrbitHistory:
    """One period of a periodic orbit.

    time: (T,), s. slosh, slosh_velocity: (T, n_tanks), m and m/s. tvc, attitude: (T,), rad.
    """

    time: Array
    slosh: Array
    slosh_velocity: Array
    tvc: Array
    attitude: Array


@dataclass(frozen=True, kw_only=True)
class PeriodicOrbit:
    """A periodic motion of the nonlinear loop as given.

    start: the one-sinusoid cycle it grew from. omega: rad/s.
    slosh_amplitude, tvc_amplitude: half peak-to-peak, m and rad.
    waveform: harmonics of slosh, engine and attitude. floquet: multipliers, see `Floquet`.
    residual: greatest imbalance of the slosh velocities over twice the harmonics kept, as a part of the fundamental.
    change: of the amplitudes when the harmonics were last doubled, relative.
    """

    case: Case
    start: Cycle
    omega: float
    slosh_amplitude: dict[str, float]
    tvc_amplitude: float
    waveform: Waveform
    floquet: Floquet
    residual: float
    change: float

    @property
    def period(self) -> float:
        """2 pi / omega in s."""
        return 2.0 * np.pi / self.omega

    @property
    def harmonics(self) -> float:
        """Rms of the engine motion that is not its fundamental, as a part of the whole."""
        return share(self.waveform.tvc)

    @property
    def multipliers(self) -> ComplexArray:
        """Floquet multipliers without the trivial one, the largest first."""
        return self.floquet.multiplier

    @property
    def stable(self) -> bool | None:
        """Whether the orbit attracts; None where that could not be told."""
        return self.floquet.stable

    @property
    def growth(self) -> float:
        """Rate of the disturbance that dies out slowest or grows fastest, ln|multiplier| / period, 1/s."""
        return float(np.log(np.abs(self.multipliers[0])) / self.period) if self.multipliers.size else -np.inf

    def time_history(self, samples: int = 512) -> OrbitHistory:
        """Return one period at evenly spaced times from 0, the end left out."""
        phase = 2.0 * np.pi * np.arange(samples) / samples
        x = self.waveform
        wave = np.exp(1j * np.outer(x.number, phase))
        return OrbitHistory(
            time=phase / self.omega,
            slosh=(x.slosh @ wave).real.T,
            slosh_velocity=((1j * self.omega * x.number * x.slosh) @ wave).real.T,
            tvc=(x.tvc @ wave).real,
            attitude=(x.attitude @ wave).real,
        )

    def __str__(self) -> str:
        slosh = ", ".join(f"{name} {a:.4f} m" for name, a in self.slosh_amplitude.items())
        kind = {True: "stable ", False: "unstable ", None: ""}[self.stable]
        precise = "" if self.change < CONVERGED else f"; NOT converged, amplitudes to {self.change:.1e}"
        return "\n".join(
            [
                f"{kind}periodic orbit at {self.omega / 2 / np.pi:.4f} Hz: {slosh}, engine "
                f"{1e3 * self.tvc_amplitude:.3f} mrad",
                f"  other harmonics {100.0 * self.harmonics:.3g} % of the engine motion; "
                f"{len(self.waveform.number)} odd harmonics, residual {self.residual:.1e}{precise}",
                f"  {self._words()}",
            ]
        )

    def _words(self) -> str:
        if not self.multipliers.size:
            return "attracts: every disturbance is gone within one period"
        size = np.abs(self.multipliers)
        largest, of_them = float(size[0]), f"largest multiplier {size[0]:.6f}"
        if self.stable is None:
            return f"not known whether it attracts: {of_them}, {self.floquet.unstable} beyond 1 by their count"
        if self.stable:
            return f"attracts: a disturbance keeps {100.0 * largest:.3g} % each period ({of_them})"
        per = f"grows by {100.0 * (largest - 1.0):.3g} % each period"
        if abs(self.multipliers[0].imag) > 1e-9 * largest:
            other = self.floquet.omega[0] / 2.0 / np.pi
            return (
                f"repels: a second oscillation at {other:.4f} Hz {per} beside it; the motion has two frequencies or "
                "goes elsewhere, simulate it"
            )
        return f"repels: a disturbance {per}; it divides motions that shrink from motions that grow"

    def to_dataset(self) -> "xr.Dataset":
        """Return the orbit as an xarray Dataset; real and imaginary parts apart, as NetCDF wants them."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        x, rho = self.waveform, self.multipliers
        return xr.Dataset(
            {
                "slosh": ("tank", list(self.slosh_amplitude.values()), {"units": "m"}),
                "slosh_real": (["tank", "harmonic"], x.slosh.real, {"units": "m"}),
                "slosh_imag": (["tank", "harmonic"], x.slosh.imag, {"units": "m"}),
                "tvc": ((), self.tvc_amplitude, {"units": "rad"}),
                "tvc_real": ("harmonic", x.tvc.real, {"units": "rad"}),
                "tvc_imag": ("harmonic", x.tvc.imag, {"units": "rad"}),
                "omega": ((), self.omega, {"units": "rad/s"}),
                "multiplier_real": ("disturbance", rho.real, {"units": "1"}),
                "multiplier_imag": ("disturbance", rho.imag, {"units": "1"}),
            },
            coords={"tank": list(self.slosh_amplitude), "harmonic": x.number},
            attrs={
                "stable": "unknown" if self.stable is None else str(self.stable).lower(),
                "residual": self.residual,
                "change": self.change,
                "harmonics": self.harmonics,
            },
        )


def periodic_orbit(case: Case, cycle: Cycle | None = None, harmonics: int = 128) -> PeriodicOrbit:
    """Return the exact periodic orbit near a one-sinusoid limit cycle, with its Floquet multipliers.

    Multi-harmonic balance over the odd harmonics, the delay exact; the harmonics are doubled until the amplitudes
    change by less than 1e-8.

    Args:
        case: one vehicle and autopilot.
        cycle: where to start; default: every one-sinusoid cycle of the case, also where several modes grow at once.
            Then the attracting orbit of the greatest engine amplitude is returned, or where none attracts the one of
            the greatest engine amplitude.
        harmonics: odd harmonics to which the doubling may go; `change` says what it came to.

    Raises:
        OutsideValidity: a damping table does not start at 0 m, so that its force is unknown; there is no cycle to start
            from; no periodic motion was found; it leaves the damping data; the engine meets a limit of its actuator.
    """
    single(case, "periodic_orbit")
    continuous(case, "periodic_orbit")
    for tank in case.vehicle.tanks:
        if tank.damping.smallest_amplitude > 0.0:
            raise OutsideValidity(
                f"the damping table of {tank.name} starts at {tank.damping.smallest_amplitude:g} m, so the force at "
                "smaller velocities is unknown. Cure: add a row at 0 m"
            )
    if cycle is not None:
        return _orbit(case, cycle, harmonics)
    starts = one_sinusoid_cycles(case)
    if not starts:
        raise OutsideValidity("there is no one-sinusoid limit cycle to start from: no slosh mode becomes neutral")
    found: list[PeriodicOrbit] = []
    refused: list[OutsideValidity] = []
    for start in starts:
        try:
            found.append(_orbit(case, start, harmonics))
        except OutsideValidity as error:
            refused.append(error)
    if not found:
        raise refused[0]
    return max(found, key=lambda orbit: (orbit.stable is True, orbit.tvc_amplitude))


def _orbit(case: Case, cycle: Cycle, harmonics: int) -> PeriodicOrbit:
    loop = open_loop(case)
    laws = [tank.damping for tank in case.vehicle.tanks]
    names = loop.plant.tanks
    leader = names.index(cycle.tank)
    V, omega = _start(loop, laws, cycle, leader)
    least = 0.1 * float(np.abs(V[leader, 0]))
    kept, change, last = min(FIRST, harmonics), np.inf, np.full(len(names) + 1, np.inf)
    while True:
        b = balance(loop, laws, kept)
        V, omega = solve(b, _padded(V, kept), omega, leader)
        found = waveform(b, V, omega)
        amplitudes = found.amplitudes
        # a tank at rest among moving ones is judged by the greatest of them
        scale = np.append(np.full(len(names), np.max(amplitudes[:-1])), max(amplitudes[-1], np.finfo(float).tiny))
        change = float(np.max(np.abs(amplitudes - last) / scale))
        if change < CONVERGED or 2 * kept > harmonics:
            break
        kept, last = 2 * kept, amplitudes
    if abs(V[leader, 0]) < least:
        raise OutsideValidity("no periodic motion was found near the one-sinusoid cycle: it shrinks to rest")
    _within_limits(case, found)
    twice = balance(loop, laws, 2 * kept)
    left = residual(twice, _padded(V, 2 * kept), omega)
    return PeriodicOrbit(
        case=case,
        start=cycle,
        omega=omega,
        slosh_amplitude={name: float(a) for name, a in zip(names, amplitudes, strict=False)},
        tvc_amplitude=float(amplitudes[-1]),
        waveform=found,
        floquet=floquet(b, V, omega),
        residual=float(np.max(np.abs(left)) / np.max(np.abs(V[:, 0]))),
        change=change,
    )


def _start(loop: Loop, laws: Sequence[DampingLaw], cycle: Cycle, leader: int) -> tuple[ComplexArray, float]:
    """Return the fundamental of the slosh velocities (n_tanks, 1) and the frequency of a one-sinusoid cycle."""
    amplitude = np.array([cycle.slosh_amplitude[name] for name in loop.plant.tanks])
    xi = ratios(laws, cycle.omega * amplitude / loop.plant.tank_frequency)
    if np.any(np.isnan(xi)):
        raise OutsideValidity("the cycle to start from lies outside the damping data")
    z = mode_shape(replace(loop, damping=xi), 1j * cycle.omega)
    return (1j * cycle.omega * amplitude[leader] * z / np.abs(z[leader]))[:, None], cycle.omega


def _padded(V: ComplexArray, harmonics: int) -> ComplexArray:
    return np.concatenate([V, np.zeros((len(V), harmonics - V.shape[1]), dtype=complex)], axis=1)


def _within_limits(case: Case, found: Waveform) -> None:
    """Refuse a motion in which the engine meets a limit of its actuator, which the balance does not know."""
    actuator = case.autopilot.actuator
    if actuator is None or actuator.frequency is None or actuator.damping is None:
        return  # a transfer function has no limits
    if actuator.deadband is not None:
        raise OutsideValidity("the actuator has a dead band, which the balance does not know: simulate it")
    s = 1j * found.omega * found.number
    w, zeta = actuator.frequency, actuator.damping
    command = found.tvc * (s**2 + 2.0 * zeta * w * s + w**2) / w**2
    stop, fastest = actuator.deflection_limit, actuator.rate_limit
    angle = max(peak(found.tvc, found.number), peak(command, found.number))
    rate = peak(s * found.tvc, found.number)
    if stop is not None and angle > stop:
        raise OutsideValidity(
            f"an engine command of {np.degrees(angle):.3g} deg is beyond the actuator's {np.degrees(stop):.3g} deg: "
            "simulate it"
        )
    if fastest is not None and rate > fastest:
        raise OutsideValidity(
            f"an engine rate of {np.degrees(rate):.3g} deg/s is beyond the actuator's {np.degrees(fastest):.3g} deg/s: "
            "simulate it"
        )
