"""Which tank's damping moves which mode and which minimum of the disc margin: exact first derivatives.

A pole is where T(s, xi) is singular, u* T = 0 and T v = 0, so that

    ds/d xi_j = - u* (dT/d xi_j) v / u* (dT/ds) v ,   dT/d xi_j = 2 w_j m_j s  on the diagonal entry of tank j alone

A minimum of eq 24 moves in frequency as xi changes, but its value does so only by the change of L where it stands
(envelope theorem): with P = Y_a (1 + s d Z_a)^-1 of `response`, dL/d xi_j = 2 w_j s P_j z_j / beta.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case, Criteria
from sloshpy.dynamics.characteristic import characteristic_matrix
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.plant import slosh_damping
from sloshpy.dynamics.poles import Poles, closed_loop_poles
from sloshpy.dynamics.response import at_reference, excess_damping, transfer
from sloshpy.stability.margins import DISTANT, Margins, loop_margins
from sloshpy.stability.mode_shape import null_vectors
from sloshpy.units import Array, ComplexArray, Real

if TYPE_CHECKING:
    import xarray as xr

DOUBLE = 1e-8  # second singular value of the scaled matrix below which two poles coincide: no derivative exists
TOUCHING = 1e-9  # disc margin below which the curve runs through -1, where the distance has a corner


@dataclass(frozen=True, kw_only=True)
class DampingSensitivity:
    """First derivatives of one loop by each tank's damping ratio, all else held.

    poles: the closed loop's. pole_slope: (K, n_tanks), ds/d xi in rad/s; nan where two poles coincide.
    margins: the minima of eq 24, M of them. margin_slope: (M, n_tanks), d/d xi of the signed disc margin at each
    minimum, positive where more damping is better; nan where the margin is 0.
    """

    case: Case
    poles: Poles
    pole_slope: ComplexArray
    margins: Margins
    margin_slope: Array

    @property
    def tanks(self) -> tuple[str, ...]:
        """Names of the tanks, the last axis of the slopes."""
        return self.poles.source.plant.tanks

    @property
    def growth_slope(self) -> Array:
        """d Re s / d xi in 1/s, (K, n_tanks)."""
        return np.asarray(self.pole_slope.real)

    @property
    def driver(self) -> tuple[str, ...]:
        """The tank whose damping changes the growth of each mode most; "" where none is known to."""
        size = np.where(np.isnan(self.growth_slope), 0.0, np.abs(self.growth_slope))
        return tuple(self.tanks[int(np.argmax(row))] if np.any(row > 0.0) else "" for row in size)

    def __str__(self) -> str:
        wide = max([11, *(len(tank) + 1 for tank in self.tanks)])
        names = "".join(f"{tank:>{wide}s}" for tank in self.tanks)
        lines = [
            "d growth per 1 % more damping, 1/s",
            f"  {'mode':20s} {'Hz':>9s} {'growth 1/s':>11s}{names}  driven by",
        ]
        for k, (p, name) in enumerate(zip(self.poles.value, self.poles.name, strict=True)):
            slopes = "".join(f"{0.01 * slope:+{wide}.5f}" for slope in self.growth_slope[k])
            hertz = p.imag / (2.0 * np.pi)
            lines.append(f"  {name:20s} {hertz:9.4f} {p.real:+11.5f}{slopes}  {self._driven(k)}".rstrip())
        lines += [
            "d signed disc margin per 1 % more damping",
            f"  {'minimum':20s} {'Hz':>9s} {'disc margin':>11s}{names}",
        ]
        sign = 1.0 if self.margins.stable else -1.0
        for k, (omega, value, mode) in enumerate(self.margins.listed(self.margins.minima)):
            if value > DISTANT:
                continue
            slopes = "".join(f"{0.01 * slope:+{wide}.5f}" for slope in self.margin_slope[k])
            lines.append(f"  {mode:20s} {omega / (2.0 * np.pi):9.4f} {sign * value:+11.4f}{slopes}")
        return "\n".join(lines)

    def _driven(self, k: int) -> str:
        """Return the tank that moves a slosh mode most with its part in the mode, and beside it the mode's own."""
        driver, own = self.driver[k], self.poles.tank[k]
        if own is None or not driver:
            return ""
        part = self.poles.participation[k, self.poles.groups.index(f"{driver} slosh")]
        return f"{driver} ({100.0 * part:.0f} % of it){'' if driver == own else f', more than by {own}'}"

    def to_dataset(self) -> "xr.Dataset":
        """Return the derivatives as an xarray Dataset over modes, minima and tanks."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        minima, count = self.margins.minima, len(self.margin_slope)
        return xr.Dataset(
            {
                "growth": ("mode", self.poles.value.real, {"units": "1/s"}),
                "omega": ("mode", self.poles.value.imag, {"units": "rad/s"}),
                "growth_slope": (["mode", "tank"], self.pole_slope.real, {"units": "1/s"}),
                "omega_slope": (["mode", "tank"], self.pole_slope.imag, {"units": "rad/s"}),
                "disc_margin": ("minimum", minima.value[:count], {"units": "1"}),
                "minimum_omega": ("minimum", minima.omega[:count], {"units": "rad/s"}),
                "margin_slope": (["minimum", "tank"], self.margin_slope, {"units": "1"}),
            },
            coords={"mode": list(self.poles.name), "tank": list(self.tanks)},
            attrs={"stable": int(self.margins.stable)},
        )


def damping_sensitivity(case: Case, damping: Real | None = None, amplitude: Real | None = None) -> DampingSensitivity:
    """Return how each tank's damping moves every closed-loop mode and every minimum of eq 24.

    Args:
        case: one vehicle and autopilot, no batch.
        damping: slosh damping ratios, one for all tanks or one for each. amplitude: slosh amplitudes in m, likewise.
    """
    single(case, "damping_sensitivity")
    loop = open_loop(case, damping, amplitude)
    poles = closed_loop_poles(loop)
    found = loop_margins(loop, case.criteria)
    return DampingSensitivity(
        case=case,
        poles=poles,
        pole_slope=np.array([pole_slope(loop, complex(p)) for p in poles.value]).reshape(-1, len(loop.plant.tanks)),
        margins=found,
        margin_slope=_margin_slope(loop, case.criteria, found),
    )


def pole_slope(loop: Loop, pole: complex) -> ComplexArray:
    """Return ds/d xi of one pole of one loop by each tank's damping ratio, (n_tanks,), rad/s; nan if it is double."""
    n = len(loop.plant.tanks)
    nothing = np.full(n, np.nan, dtype=complex)
    if not np.isfinite(pole):
        return nothing
    shape = null_vectors(loop, pole)
    if shape.separation < DOUBLE:
        return nothing
    s, u, v = shape.pole, shape.left, shape.right
    dT = characteristic_matrix(loop, np.asarray(s))[1]
    own = np.arange(len(v))[loop.plant.slosh]
    change = s * slosh_damping(loop.plant, np.ones(n))
    return np.asarray(-u[own] * change * v[own] / (u @ dT @ v))


def loop_slope(loop: Loop, s: ComplexArray) -> ComplexArray:
    """Return dL/d xi at complex frequencies by each tank's damping ratio, (..., n_tanks)."""
    _, Y_a, _, Z_a = at_reference(loop, s)
    sd = np.asarray(s)[..., None] * excess_damping(loop)
    closure = np.eye(sd.shape[-1]) + sd[..., :, None] * Z_a
    P = np.linalg.solve(np.swapaxes(closure, -1, -2), Y_a[..., None])[..., 0]
    return np.asarray(2.0 * loop.plant.tank_frequency * s[..., None] * P * transfer(loop, s).slosh)


def _margin_slope(loop: Loop, criteria: Criteria, found: Margins) -> Array:
    """Return the derivative of the signed disc margin at each minimum that is not nan, (M, n_tanks)."""
    known = np.isfinite(found.minima.omega)
    s, value = 1j * found.minima.omega[known], found.minima.value[known]
    L = transfer(loop.along(), s).loop
    relative = loop_slope(loop.along(), s) / L[:, None]
    gain, phase = np.log(criteria.gain_margin), criteria.phase_margin
    with np.errstate(divide="ignore", invalid="ignore"):
        pull = (np.log(np.abs(L)) / gain**2)[:, None] * relative.real + (np.angle(-L) / phase**2)[
            :, None
        ] * relative.imag
        slope = np.where(value[:, None] > TOUCHING, pull / value[:, None], np.nan)
    return np.asarray(slope if found.stable else -slope)
