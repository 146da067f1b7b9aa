"""Growth of an oscillation against its amplitude; limit cycles are where it neither grows nor decays.

For a slosh mode at amplitude a of its own tank, every tank's damping is f_j(W A_j / w_j) with the amplitudes A_j that
the closed-loop eigenvector gives, iterated until both agree. sigma(a) = Re lambda; a zero is a limit cycle, stable
where sigma falls through it.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.case import Case
from sloshpy.damping import ratios
from sloshpy.dynamics.loop import Loop, open_loop, single
from sloshpy.dynamics.poles import NEUTRAL, characteristic_matrix, closed_loop_poles, polish
from sloshpy.dynamics.response import transfer
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle.neutral import neutral_cycles
from sloshpy.units import Array, ComplexArray

if TYPE_CHECKING:
    import xarray as xr


ROUNDS = 50  # of damping and mode shape; some ten are enough where they agree at all


@dataclass(frozen=True, kw_only=True)
class GrowthCurve:
    """One slosh mode followed over its amplitude.

    amplitude: (A,), m, of the mode's own tank. pole: (A,), rad/s, sigma + j W; nan where a law has no data.
    damping: (A, n_tanks), ratios by each tank's law. slosh: (A, n_tanks), m, amplitudes of all tanks. tvc: (A,), rad.
    """

    case: Case
    tank: str
    amplitude: Array
    pole: ComplexArray
    damping: Array
    slosh: Array
    tvc: Array

    @property
    def growth(self) -> Array:
        """sigma(a) in 1/s."""
        return np.asarray(self.pole.real)

    @property
    def time_to_double(self) -> float:
        """ln 2 / sigma at the smallest amplitude in s; inf where the mode does not grow."""
        return float(np.log(2.0) / self.growth[0]) if self.growth[0] > 0.0 else np.inf

    def __str__(self) -> str:
        grows = f"doubles in {self.time_to_double:.2f} s" if np.isfinite(self.time_to_double) else "does not grow"
        return f"{self.tank} slosh at small amplitude: {grows} ({self.growth[0]:+.5f} 1/s)"

    def to_dataset(self) -> "xr.Dataset":
        """Return the curve as an xarray Dataset over the amplitude."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "growth": ("amplitude", self.growth, {"units": "1/s"}),
                "omega": ("amplitude", self.pole.imag, {"units": "rad/s"}),
                "slosh": (["amplitude", "tank"], self.slosh, {"units": "m"}),
                "tvc": ("amplitude", self.tvc, {"units": "rad"}),
            },
            coords={
                "amplitude": ("amplitude", self.amplitude, {"units": "m"}),
                "tank": [t.name for t in self.case.vehicle.tanks],
            },
        )


@dataclass(frozen=True, kw_only=True)
class Cycle:
    """A limit cycle of the loop as given: frequency in rad/s, amplitudes in m and rad, whether it attracts."""

    tank: str
    omega: float
    slosh_amplitude: dict[str, float]
    tvc_amplitude: float
    stable: bool

    def to_dataset(self) -> "xr.Dataset":
        """Return the cycle as an xarray Dataset over the tanks."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "slosh": ("tank", list(self.slosh_amplitude.values()), {"units": "m"}),
                "omega": ((), self.omega, {"units": "rad/s"}),
                "tvc": ((), self.tvc_amplitude, {"units": "rad"}),
            },
            coords={"tank": list(self.slosh_amplitude)},
            attrs={"stable": int(self.stable)},
        )

    def __str__(self) -> str:
        slosh = ", ".join(f"{name} {a:.4f} m" for name, a in self.slosh_amplitude.items())
        kind = "stable" if self.stable else "unstable"
        engine = f"engine {1e3 * self.tvc_amplitude:.3f} mrad"
        return f"{kind} limit cycle at {self.omega / 2 / np.pi:.4f} Hz: {slosh}, {engine}"


def growth_curve(case: Case, tank: int = 0, amplitude: Array | None = None) -> GrowthCurve:
    """Return how a tank's slosh mode grows against its amplitude.

    Args:
        case: one vehicle and autopilot.
        tank: number of the tank whose mode and amplitude are meant.
        amplitude: amplitudes in m, increasing, > 0; default: up to where the tank's law gives 0.3 or its data end.
    """
    single(case, "growth_curve")
    loop = open_loop(case)
    amplitude = _amplitudes(case, tank) if amplitude is None else np.asarray(amplitude, dtype=float)
    last = _start(loop, tank)
    modes = []
    for a in amplitude:
        mode = _at(case, loop, tank, float(a), last)
        modes.append(mode)
        last = last if np.isnan(mode.pole) else mode
    return GrowthCurve(
        case=case,
        tank=case.vehicle.tanks[tank].name,
        amplitude=amplitude,
        pole=np.array([mode.pole for mode in modes]),
        damping=np.array([mode.damping for mode in modes]),
        slosh=np.array([mode.slosh for mode in modes]),
        tvc=np.array([mode.tvc for mode in modes]),
    )


def limit_cycles(case: Case) -> tuple[Cycle, ...]:
    """Return every limit cycle of the loop as given, all tanks coupled, each with its own law.

    Raises:
        OutsideValidity: two slosh modes grow at small amplitude; one sinusoid then predicts no limit cycle.
    """
    if not any(_varies(case, j) for j in range(len(case.vehicle.tanks))):
        return ()
    growing = [p for p in closed_loop_poles(open_loop(case)).value if p.real > NEUTRAL * abs(p) and p.imag > 0.0]
    if len(growing) > 1:
        raise OutsideValidity(f"{len(growing)} modes grow at once: one sinusoid predicts no limit cycle; simulate it")
    return one_sinusoid_cycles(case)


def one_sinusoid_cycles(case: Case) -> tuple[Cycle, ...]:
    """Return where each slosh mode neither grows nor decays, as if it were alone: a start, not yet a prediction."""
    found: list[Cycle] = []
    for j in range(len(case.vehicle.tanks)):
        curve = growth_curve(case, j)
        sigma = curve.growth
        known = np.flatnonzero(np.isfinite(sigma))
        for k, m in pairwise(known):
            if sigma[k] * sigma[m] >= 0.0:
                continue
            cycle = _cycle(case, j, curve, int(k)) if m == k + 1 else None
            if cycle is None or not np.isfinite(cycle.omega):
                cycle = _across(case, j, curve, int(k), int(m))
            if not any(_same(cycle, other) for other in found):
                found.append(cycle)
    return tuple(found)


@dataclass(frozen=True, kw_only=True)
class _Mode:
    """A mode at one amplitude: its pole, the damping of every tank, slosh and engine amplitudes; nan without data."""

    pole: complex
    damping: Array
    slosh: Array
    tvc: float


def _at(case: Case, loop: Loop, tank: int, a: float, start: _Mode) -> _Mode:
    """Return a mode at amplitude a, consistent with every law, from a mode at a neighbouring amplitude."""
    laws = [t.damping for t in case.vehicle.tanks]
    w = loop.plant.tank_frequency
    nothing = np.full(len(laws), np.nan)
    pole, xi, step, before = start.pole, start.damping, 1.0, np.inf
    for _ in range(ROUNDS if not np.isnan(pole) else 0):
        z = mode_shape(replace(loop, damping=xi), pole)
        slosh = a * np.abs(z) / np.abs(z[tank])
        wanted = ratios(laws, abs(pole.imag) * slosh / w)
        if np.any(np.isnan(wanted)):
            break
        change = float(np.max(np.abs(wanted - xi)))
        # with several tanks the full step can alternate between two states: halve it where it does not close in
        step = max(0.5 * step, 0.1) if change > 0.7 * before else step
        xi, before = xi + step * (wanted - xi), change
        moved = complex(polish(replace(loop, damping=xi), np.array(pole)))
        if np.isnan(moved):
            break
        if abs(moved - pole) < 1e-12 * abs(pole) and change < 1e-12:
            return _Mode(pole=moved, damping=xi, slosh=slosh, tvc=float(a / np.abs(z[tank])))
        pole = moved
    return _Mode(pole=complex(np.nan, np.nan), damping=nothing, slosh=nothing, tvc=np.nan)


def mode_shape(loop: Loop, pole: complex) -> ComplexArray:
    """Return the slosh amplitudes of a mode per engine angle."""
    z = np.atleast_1d(transfer(loop, np.array(pole)).slosh)
    if np.all(np.isfinite(z)) and np.any(z != 0.0):
        return z
    # the engine does not reach this mode (slosh at the centre of percussion): its shape is the null vector
    vector = np.conj(np.linalg.svd(characteristic_matrix(loop, np.array(pole))[0])[2][-1])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = vector[:-1][loop.plant.slosh] / vector[-1]
    return np.asarray(
        ratio if np.all(np.isfinite(ratio)) else vector[:-1][loop.plant.slosh] / np.finfo(float).tiny ** 0.5
    )


def _cycle(case: Case, tank: int, curve: GrowthCurve, k: int) -> Cycle:
    from scipy.optimize import brentq  # 0.3 s: only where a limit cycle is there to find

    loop = open_loop(case)
    start = _Mode(pole=complex(curve.pole[k]), damping=curve.damping[k], slosh=curve.slosh[k], tvc=float(curve.tvc[k]))

    def sigma(a: float) -> float:
        return _at(case, loop, tank, a, start).pole.real

    a = float(brentq(sigma, curve.amplitude[k], curve.amplitude[k + 1], xtol=1e-13))
    mode = _at(case, loop, tank, a, start)
    return Cycle(
        tank=curve.tank,
        omega=mode.pole.imag,
        slosh_amplitude={t.name: float(A) for t, A in zip(case.vehicle.tanks, mode.slosh, strict=True)},
        tvc_amplitude=mode.tvc,
        stable=bool(curve.growth[k] > 0.0),
    )


def _across(case: Case, tank: int, curve: GrowthCurve, k: int, m: int) -> Cycle:
    """Return the cycle between two amplitudes between which damping and mode shape did not settle by iteration."""
    loop = open_loop(case)
    one = replace(loop, damping=loop.damping[None])
    laws = [t.damping for t in case.vehicle.tanks]
    for part in (0.5, 0.25, 0.75, 0.0, 1.0):
        slosh = curve.slosh[k] ** (1.0 - part) * curve.slosh[m] ** part
        omega = (1.0 - part) * curve.pole[k].imag + part * curve.pole[m].imag
        found = neutral_cycles(one, laws, tank, slosh[None], np.array([omega]))
        a = found.slosh[0, tank]
        if curve.amplitude[k] <= a <= curve.amplitude[m] and (found.slope[0] < 0.0) == (curve.growth[k] > 0.0):
            return Cycle(
                tank=curve.tank,
                omega=float(found.omega[0]),
                slosh_amplitude={t.name: float(A) for t, A in zip(case.vehicle.tanks, found.slosh[0], strict=True)},
                tvc_amplitude=float(found.tvc[0]),
                stable=bool(found.slope[0] < 0.0),
            )
    raise OutsideValidity(
        f"{curve.tank} slosh becomes neutral between {curve.amplitude[k]:.3g} and {curve.amplitude[m]:.3g} m, but its "
        "damping and its shape do not settle there: simulate it"
    )


def _start(loop: Loop, tank: int) -> _Mode:
    """Return the tank's closed-loop slosh mode at small amplitude."""
    poles = closed_loop_poles(loop)
    pole = complex(poles.value[poles.tank.index(loop.plant.tanks[tank])])
    return _Mode(pole=pole, damping=loop.damping, slosh=np.zeros(len(loop.damping)), tvc=0.0)


def _varies(case: Case, tank: int) -> bool:
    law = case.vehicle.tanks[tank].damping
    return not np.isinf(law.amplitude(0.3)) and float(law.amplitude(0.3)) != 0.0


def _amplitudes(case: Case, tank: int) -> Array:
    law = case.vehicle.tanks[tank].damping
    low, high = law.smallest_amplitude, law.largest_amplitude
    if np.isinf(high):
        high = float(law.amplitude(0.3)) if _varies(case, tank) else 1.0  # m: a constant law has no scale of its own
    low = max(low, 1e-7 * high)
    return np.unique(np.concatenate([np.geomspace(low, high, 49), np.linspace(low, high, 33)]))


def _same(one: Cycle, other: Cycle) -> bool:
    return abs(one.omega - other.omega) < 1e-6 * one.omega and np.allclose(
        list(one.slosh_amplitude.values()), list(other.slosh_amplitude.values()), rtol=1e-4
    )
