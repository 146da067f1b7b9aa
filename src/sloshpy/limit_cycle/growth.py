"""Growth of an oscillation against its amplitude; limit cycles are where it neither grows nor decays.

For a slosh mode at amplitude a of its own tank, every tank's damping is f_j(W A_j / w_j) with the amplitudes A_j that
the closed-loop eigenvector gives, iterated until both agree. sigma(a) = Re lambda; a zero is a limit cycle, stable
where sigma falls through it.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.case import Case
from sloshpy.damping import ratios
from sloshpy.dynamics.loop import Loop, open_loop, single
from sloshpy.dynamics.poles import characteristic_matrix, closed_loop_poles, polish
from sloshpy.dynamics.response import transfer
from sloshpy.errors import OutsideValidity
from sloshpy.units import Array, ComplexArray

if TYPE_CHECKING:
    import xarray as xr


NEUTRAL = 1e-9  # growth below this part of the frequency is rounding: an undamped mode that control does not reach


@dataclass(frozen=True, kw_only=True)
class GrowthCurve:
    """One slosh mode followed over its amplitude.

    amplitude: (A,), m, of the mode's own tank. pole: (A,), rad/s, sigma + j W; nan where a law has no data.
    slosh: (A, n_tanks), m, amplitudes of all tanks. tvc: (A,), rad.
    """

    case: Case
    tank: str
    amplitude: Array
    pole: ComplexArray
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
    rows = []
    for a in amplitude:
        pole, slosh, tvc = _at(case, loop, tank, float(a), last)
        rows.append((pole, slosh, tvc))
        last = last if np.isnan(pole) else pole
    return GrowthCurve(
        case=case,
        tank=case.vehicle.tanks[tank].name,
        amplitude=amplitude,
        pole=np.array([r[0] for r in rows]),
        slosh=np.array([r[1] for r in rows]),
        tvc=np.array([r[2] for r in rows]),
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
    found: list[Cycle] = []
    for j in range(len(case.vehicle.tanks)):
        curve = growth_curve(case, j)
        sigma = curve.growth
        for k in np.flatnonzero(sigma[:-1] * sigma[1:] < 0.0):
            cycle = _cycle(case, j, curve, int(k))
            if not any(_same(cycle, other) for other in found):
                found.append(cycle)
    return tuple(found)


def _at(case: Case, loop: Loop, tank: int, a: float, pole: complex) -> tuple[complex, Array, float]:
    """Return pole, slosh amplitudes and engine amplitude of a mode at amplitude a, consistent with every law."""
    laws = [t.damping for t in case.vehicle.tanks]
    w = loop.plant.tank_frequency
    xi = loop.damping
    for step in range(200):
        if np.isnan(pole):
            break
        z = _shape(replace(loop, damping=xi), pole)
        slosh = a * np.abs(z) / np.abs(z[tank])
        wanted = ratios(laws, abs(pole.imag) * slosh / w)
        if np.any(np.isnan(wanted)):
            return complex(np.nan, np.nan), np.full(len(laws), np.nan), np.nan
        # half steps: with several tanks the full step can alternate between two states
        xi = wanted if step == 0 or len(laws) == 1 else 0.5 * (xi + wanted)
        before, pole = pole, complex(polish(replace(loop, damping=xi), np.array(pole)))
        if abs(pole - before) < 1e-12 * abs(pole) and np.all(np.abs(xi - wanted) < 1e-12):
            return pole, slosh, float(a / np.abs(z[tank]))
    return complex(np.nan, np.nan), np.full(len(laws), np.nan), np.nan


def _shape(loop: Loop, pole: complex) -> ComplexArray:
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

    loop, start = open_loop(case), complex(curve.pole[k])
    a = brentq(
        lambda a: _at(case, loop, tank, a, start)[0].real, curve.amplitude[k], curve.amplitude[k + 1], xtol=1e-13
    )
    pole, slosh, tvc = _at(case, loop, tank, float(a), start)
    return Cycle(
        tank=curve.tank,
        omega=pole.imag,
        slosh_amplitude={t.name: float(A) for t, A in zip(case.vehicle.tanks, slosh, strict=True)},
        tvc_amplitude=tvc,
        stable=bool(curve.growth[k] > 0.0),
    )


def _start(loop: Loop, tank: int) -> complex:
    """Return the tank's closed-loop slosh pole at small amplitude."""
    poles = closed_loop_poles(loop)
    return complex(poles.value[poles.tank.index(loop.plant.tanks[tank])])


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
