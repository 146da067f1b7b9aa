"""Stationary response to noise by statistical linearisation: rms of slosh and engine, damping at the rms it causes.

A damper under Gaussian velocity of standard deviation sigma acts like the linear one with

    N(sigma) = E[force v] / sigma^2 ,       for the odd square law  b sqrt(8/pi) sigma .

The rms of every slosh velocity follows from the damping, and the damping from the rms; both are iterated until they
agree. The loop, its delay included, is exact in frequency.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.autopilot import forward_transfer
from sloshpy.autopilot.transfer import forward_fraction
from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.damping import DampingLaw
from sloshpy.dynamics.characteristic import characteristic_matrix
from sloshpy.dynamics.growth import greatest_growth
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import NEUTRAL, closed_loop_eigenvalues
from sloshpy.errors import OutsideValidity
from sloshpy.simulation.signals import Noise
from sloshpy.units import Array, ComplexArray

if TYPE_CHECKING:
    import xarray as xr

FORMULA_TAIL = 8.0  # standard deviations integrated over for a formula
DATA_TAIL = 4.0  # and for a table, which must reach as far; 6e-5 of the time is beyond
ROUNDS = 200


@dataclass(frozen=True, kw_only=True)
class ForcedResponse:
    """Stationary response of a case to noise.

    slosh: (n_tanks,), rms, m. velocity: (n_tanks,), rms, m/s. tvc: rms, rad. damping: (n_tanks,), ratios that the laws
    give at this rms. engine, wind: the disturbances.
    """

    case: Case
    slosh: Array
    velocity: Array
    tvc: float
    damping: Array
    engine: Noise | None
    wind: Noise | None

    def __str__(self) -> str:
        lines = [f"{self.case.name} under noise, rms:"]
        for tank, z, xi in zip(self.case.vehicle.tanks, self.slosh, self.damping, strict=True):
            lines.append(f"  {tank.name} slosh {z:.4g} m, damped {100.0 * xi:.3g} %")
        return "\n".join([*lines, f"  engine {1e3 * self.tvc:.4g} mrad ({np.degrees(self.tvc):.3g} deg)"])

    def to_dataset(self) -> "xr.Dataset":
        """Return the rms values as an xarray Dataset over the tanks."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "slosh": ("tank", self.slosh, {"units": "m"}),
                "velocity": ("tank", self.velocity, {"units": "m/s"}),
                "damping": ("tank", self.damping, {"units": "1"}),
                "tvc": ((), self.tvc, {"units": "rad"}),
            },
            coords={"tank": [t.name for t in self.case.vehicle.tanks]},
        )


def forced_response(case: Case, engine: Noise | None = None, wind: Noise | None = None) -> ForcedResponse:
    """Return the stationary rms of slosh and engine under independent noises, by statistical linearisation.

    Args:
        case: one vehicle and autopilot.
        engine: noise of the engine command, rad.
        wind: noise of the lateral wind, m/s; the case needs aerodynamics.

    Raises:
        OutsideValidity: the loop is not stable at small amplitude, so that it oscillates by itself and nothing is
            Gaussian; or a damping table ends before four standard deviations.
    """
    single(case, "forced_response")
    if engine is None and wind is None:
        raise ValueError("give a noise on the engine, the wind, or both")
    if wind is not None and case.vehicle.aerodynamics is None:
        raise ValueError("wind acts by the aerodynamics, and the case has none")
    loop = open_loop(case)
    axis = NEUTRAL * float(np.max(loop.plant.tank_frequency, initial=0.0))
    if float(greatest_growth(loop)) > axis:
        raise OutsideValidity("the loop grows at small amplitude and oscillates by itself: simulate it under the noise")
    laws = [tank.damping for tank in case.vehicle.tanks]
    w = loop.plant.tank_frequency
    xi = np.maximum(loop.damping, 1e-3)  # an undamped start would ring without bound
    for _ in range(ROUNDS):
        slosh, velocity, tvc = _rms(replace(loop, damping=xi), engine, wind)
        wanted = np.array(
            [stochastic_ratio(law, float(v), float(wj)) for law, v, wj in zip(laws, velocity, w, strict=True)]
        )
        if np.max(np.abs(wanted - xi), initial=0.0) < 1e-10:
            return ForcedResponse(
                case=case, slosh=slosh, velocity=velocity, tvc=tvc, damping=wanted, engine=engine, wind=wind
            )
        xi = np.sqrt(np.maximum(wanted, 1e-12) * xi)  # the mean of logarithms: more damping gives less rms
    raise OutsideValidity("damping and rms do not settle on each other: simulate the loop under the noise")


def stochastic_ratio(law: DampingLaw, velocity: float, natural_frequency: float) -> float:
    """Return the equivalent damping ratio of a law under Gaussian velocity.

    Args:
        law: of the damping.
        velocity: standard deviation, m/s.
        natural_frequency: rad/s.

    Raises:
        OutsideValidity: the law's data end before four standard deviations.
    """
    formula = np.isinf(law.largest_amplitude)
    tail = FORMULA_TAIL if formula else DATA_TAIL
    node, weight = np.polynomial.legendre.leggauss(200)
    x = 0.5 * tail * (node + 1.0)
    p = weight * np.exp(-0.5 * x**2)
    force = -law.acceleration(velocity * x, natural_frequency)
    if np.any(np.isnan(force)):
        raise OutsideValidity(
            f"the damping data end at {law.largest_amplitude:g} m, but four standard deviations of the slosh velocity "
            f"ask for {DATA_TAIL * velocity / natural_frequency:.3g} m"
        )
    if velocity == 0.0:
        return float(law.ratio(0.0))
    return float(np.sum(p * force * x) / np.sum(p * x**2) / (2.0 * natural_frequency * velocity))


def _rms(loop: Loop, engine: Noise | None, wind: Noise | None) -> tuple[Array, Array, float]:
    """Return rms of slosh, slosh velocity and engine angle of a linear loop."""
    n = len(loop.plant.tanks)
    power = np.zeros(2 * n + 1)
    for noise, which in ((engine, "engine"), (wind, "wind")):
        if noise is None:
            continue
        omega, weight = _nodes(loop, noise.low, noise.high)
        z, beta = _responses(loop, omega, which)
        density = noise.density * weight
        power[:n] += density @ np.abs(z) ** 2
        power[n : 2 * n] += density @ (omega[:, None] * np.abs(z)) ** 2
        power[-1] += density @ np.abs(beta) ** 2
    return np.sqrt(power[:n]), np.sqrt(power[n : 2 * n]), float(np.sqrt(power[-1]))


def _responses(loop: Loop, omega: Array, which: str) -> tuple[ComplexArray, ComplexArray]:
    """Return closed-loop slosh, (F, n_tanks), and engine angle, (F,), per unit of a disturbance."""
    s = 1j * omega
    T, _ = characteristic_matrix(loop.along(), s)
    right = np.zeros(T.shape[:-1], dtype=complex)
    if which == "engine":  # enters before the actuator: d beta = n y + d (actuator) disturbance
        right[:, -1] = forward_fraction(loop.autopilot, s)[1] * forward_transfer(loop.autopilot.actuator_alone, s)
    else:  # alpha = phi - (Z' - wind) / V: the wind pushes where Z' resists
        right[:, :-1] = loop.plant.damping[:, 0]
    x = np.linalg.solve(T, right[..., None])[..., 0]
    return x[:, :-1][:, loop.plant.slosh], x[:, -1]


def _nodes(loop: Loop, low: float, high: float) -> tuple[Array, Array]:
    """Return frequencies and weights of an integral over a band, dense about the closed-loop poles."""
    poles = closed_loop_eigenvalues(loop)
    poles = poles[np.isfinite(poles)]
    near = np.maximum(np.abs(poles.real), 1e-9 * np.abs(poles))[:, None] * 2.0 ** np.arange(40)
    centre = np.abs(poles.imag)[:, None]
    marks = np.concatenate([(centre - near).ravel(), (centre + near).ravel(), np.geomspace(low, high, 40)])
    edges = np.unique(np.concatenate([[low, high], marks[(marks > low) & (marks < high)]]))
    node, weight = np.polynomial.legendre.leggauss(6)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (node + 1.0)).ravel(), (half * weight).ravel()
