"""A tank to the spring-masses that stand for its slosh in the plant, fig 1."""

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sloshpy.tank.closed_form import flat_bottom
from sloshpy.tank.contour_doubt import Doubt, doubt_of
from sloshpy.tank.doubtful import doubts_about, doubts_about_wall
from sloshpy.tank.eigen import TOLERANCE, modes_by_elements
from sloshpy.tank.liquid import LiquidSection, steps_at
from sloshpy.tank.modal import Modal, fixed_part
from sloshpy.tank.shapes import Annulus, Contour, Cylinder, Wall
from sloshpy.tank.tank import Tank
from sloshpy.units import Array

if TYPE_CHECKING:
    import xarray as xr

_ROUGHEST = 1e-3  # the doubt beyond which a mesh is no coarser
_NOTICED = 0.03  # of the liquid: a slosh mass that is left out and should not be


@dataclass(frozen=True, kw_only=True)
class SloshModes:
    """The slosh masses of a tank, its fixed mass and its rigid-lid inertia. Heights are above the lowest point, in m.

    Of each mode, (n,): kappa = w^2/a, 1/m; frequency, rad/s; slosh_mass, kg; spring_height: of the spring-mass, the one
    the plant's equations want, nan for a mode without mass; wave_per_displacement: wave height at the outer wall per
    slosh-mass displacement; error_estimate: relative, the worst of these numbers, the height's against the surface's
    radius; height and wave of a mode with less than a thousandth of the liquid count by their mass. rigid_lid_error and
    fixed_inertia_error: of the two inertias, relative. With a contour they hold what its points leave open.
    fixed_mass, kg, fixed_mass_height and fixed_mass_inertia, kg m^2, complete liquid mass, c.g. and rigid-lid inertia;
    the fixed inertia may be negative. rigid_lid_inertia: of the liquid about its c.g. with the surface closed by a lid,
    kg m^2. next_mass: of the first mode left out, kg. surface_radius, (k,), m, and surface_shape, (n, k): the modes
    along a radius of the surface, 1 at the wall. wall_friction, (n,), 1/m: int |grad phi|^2 over the wetted wall to
    that over the volume, floor_friction the part of what rises by less than 45 degrees; friction_error: relative.
    """

    tank: Tank
    section: LiquidSection
    kappa: Array
    frequency: Array
    slosh_mass: Array
    spring_height: Array
    wave_per_displacement: Array
    error_estimate: Array
    rigid_lid_error: float
    fixed_inertia_error: float
    liquid_mass: float
    fixed_mass: float
    fixed_mass_height: float
    fixed_mass_inertia: float
    rigid_lid_inertia: float
    next_mass: float
    surface_radius: Array
    surface_shape: Array
    wall_friction: Array
    floor_friction: Array
    friction_error: Array
    method: str

    @property
    def pendulum_length(self) -> Array:
        """L = 1/kappa, m."""
        return np.asarray(1.0 / self.kappa)

    @property
    def hinge_height(self) -> Array:
        """Height of the pendulum's hinge, L above the spring-mass; not the location the plant wants."""
        return self.spring_height + self.pendulum_length

    @property
    def f_hz(self) -> Array:
        """Frequencies in Hz."""
        return self.frequency / (2.0 * np.pi)

    @property
    def station(self) -> Array | None:
        """Stations of the spring-masses forward of the gimbal, m; None where the tank's own is not given."""
        bottom = self.tank.bottom_station
        return None if bottom is None else bottom + self.spring_height

    @property
    def liquid_cg_height(self) -> float:
        """Height of the liquid's c.g., m."""
        return self.section.cg_height

    @property
    def reasons(self) -> tuple[str, ...]:
        """What to know before the numbers are used."""
        found = doubts_about(self.tank.liquid.density, self.tank.acceleration, self.section)
        if isinstance(self.tank.shape, Contour):
            found += doubts_about_wall(self.tank.shape)
        if self.next_mass > _NOTICED * self.liquid_mass:
            share = 100.0 * self.next_mass / self.liquid_mass
            found.append(
                f"mode {len(self.kappa) + 1} holds {share:.3g} % of the liquid and is left out: ask for more modes"
            )
        if np.max(self.error_estimate) > TOLERANCE:
            found.append(f"numbers are good to {np.max(self.error_estimate):.1e} only, {TOLERANCE:.0e} was wanted")
        found += [
            f"the surface stands just at a step of the wall from r = {below:.4g} m to {above:.4g} m at "
            f"z = {self.section.depth:.4g} m: the one below it was taken, and just above it differs"
            for below, above in steps_at(self.tank.shape, self.section.depth)
        ]
        return tuple(found)

    @property
    def walls(self) -> tuple[Array, ...]:
        """Outer and inner wall of the whole tank as polygons (2, k): r and z in m."""
        return tuple(_outline(wall) for wall in (self.tank.shape.outer, self.tank.shape.inner) if wall)

    @property
    def outline(self) -> Array:
        """Boundary of the liquid's half section as a polygon (2, k): r and z in m."""
        f = np.linspace(0.0, 1.0, 65)
        return np.concatenate([part.point(f) for part in self.section.boundary], axis=1)

    def __str__(self) -> str:
        tank, s = self.tank, self.section
        full = 100.0 * s.volume / tank.volume
        ring = f"{s.inner_radius:.4g} to {s.radius:.6g}" if s.inner_radius > 0.0 else f"{s.radius:.6g}"
        lines = [
            f"{tank.name}: {tank.shape.kind}, {s.depth:.6g} m deep ({full:.4g} % full), surface radius {ring} m, "
            f"at {tank.acceleration:.6g} m/s^2",
            *(f"  - {reason}" for reason in self.reasons),
            f"  liquid {self.liquid_mass:.6g} kg, c.g. {s.cg_height:.6g} m above the lowest point; "
            f"rigid-lid inertia {self.rigid_lid_inertia:.6g} kg m^2 (error {self.rigid_lid_error:.0e})",
            f"  {'mode':>4s} {'Hz':>9s} {'rad/s':>9s} {'mass kg':>11s} {'of liquid':>9s} {'spring m':>10s} "
            f"{'hinge m':>10s} {'length m':>10s} {'wave m/m':>9s} {'error':>8s}"
            + ("  station m" if self.station is not None else ""),
        ]
        for n in range(len(self.kappa)):
            station = "" if self.station is None else f" {self.station[n]:10.5f}"
            lines.append(
                f"  {n + 1:4d} {self.f_hz[n]:9.5f} {self.frequency[n]:9.5f} {self.slosh_mass[n]:11.6g} "
                f"{100.0 * self.slosh_mass[n] / self.liquid_mass:7.3f} % {self.spring_height[n]:10.5f} "
                f"{self.hinge_height[n]:10.5f} {self.pendulum_length[n]:10.5f} {self.wave_per_displacement[n]:9.4f} "
                f"{self.error_estimate[n]:8.0e}{station}"
            )
        lines += [
            f"  fixed {self.fixed_mass:.6g} kg at {self.fixed_mass_height:.6g} m, "
            f"inertia {self.fixed_mass_inertia:.6g} kg m^2 (error {self.fixed_inertia_error:.0e}) about itself",
            f"  spring: place of the spring-mass, which the plant wants; hinge: of the equal pendulum. ({self.method})",
        ]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers in SI units; `sloshpy tank --json` adds those of `tank_damping`."""
        station = self.station

        def plain(value: float) -> float | None:
            return float(value) if np.isfinite(value) else None

        modes = [
            {
                "kappa": float(self.kappa[n]),
                "frequency_hz": float(self.f_hz[n]),
                "slosh_mass": float(self.slosh_mass[n]),
                "spring_height": plain(self.spring_height[n]),
                "hinge_height": plain(self.hinge_height[n]),
                "pendulum_length": float(self.pendulum_length[n]),
                "wave_per_displacement": float(self.wave_per_displacement[n]),
                "station": None if station is None else plain(station[n]),
                "error_estimate": float(self.error_estimate[n]),
            }
            for n in range(len(self.kappa))
        ]
        return {
            "name": self.tank.name,
            "reasons": list(self.reasons),
            "liquid_mass": self.liquid_mass,
            "liquid_cg_height": self.liquid_cg_height,
            "surface_radius": self.section.radius,
            "depth": self.section.depth,
            "modes": modes,
            "fixed_mass": self.fixed_mass,
            "fixed_mass_height": self.fixed_mass_height,
            "fixed_mass_inertia": self.fixed_mass_inertia,
            "rigid_lid_inertia": self.rigid_lid_inertia,
            "rigid_lid_error": self.rigid_lid_error,
            "fixed_inertia_error": self.fixed_inertia_error,
        }

    def to_json(self) -> str:
        """Return `to_dict` as one JSON object."""
        return json.dumps(self.to_dict(), indent=1)

    def to_dataset(self) -> "xr.Dataset":
        """Return the numbers as an xarray Dataset over the modes."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        of_modes = {
            "kappa": (self.kappa, "1/m"),
            "frequency": (self.frequency, "rad/s"),
            "slosh_mass": (self.slosh_mass, "kg"),
            "spring_height": (self.spring_height, "m"),
            "hinge_height": (self.hinge_height, "m"),
            "pendulum_length": (self.pendulum_length, "m"),
            "wave_per_displacement": (self.wave_per_displacement, "1"),
            "error_estimate": (self.error_estimate, "1"),
        }
        if self.station is not None:
            of_modes["station"] = (self.station, "m")
        of_tank = {
            "liquid_mass": (self.liquid_mass, "kg"),
            "liquid_cg_height": (self.liquid_cg_height, "m"),
            "surface_radius": (self.section.radius, "m"),
            "depth": (self.section.depth, "m"),
            "acceleration": (self.tank.acceleration, "m/s^2"),
            "fixed_mass": (self.fixed_mass, "kg"),
            "fixed_mass_height": (self.fixed_mass_height, "m"),
            "fixed_mass_inertia": (self.fixed_mass_inertia, "kg m^2"),
            "rigid_lid_inertia": (self.rigid_lid_inertia, "kg m^2"),
            "rigid_lid_error": (self.rigid_lid_error, "1"),
            "fixed_inertia_error": (self.fixed_inertia_error, "1"),
        }
        return xr.Dataset(
            {name: ("mode", values, {"units": unit}) for name, (values, unit) in of_modes.items()}
            | {name: ((), value, {"units": unit}) for name, (value, unit) in of_tank.items()},
            coords={"mode": np.arange(1, len(self.kappa) + 1)},
            attrs={"tank": self.tank.name, "method": self.method},
        )


def slosh_masses(tank: Tank, tolerance: float = TOLERANCE, doubt: Doubt | None = None) -> SloshModes:
    """Return the slosh masses of a tank, of the first lateral modes (m = 1), with all that the plant needs of them.

    In closed form for the flat-bottomed cylinder and annulus, otherwise from the linear eigenvalue problem by finite
    elements: Laplace's equation, no flow through the wall, d(phi)/dz = kappa phi on the surface.

        m = rho kappa (int x phi dS)^2 / int phi^2 dS;  H_s = z_F - 2 int x phi_z dV / (kappa int x phi dS)

    Args:
        tank: shape, fill, acceleration, liquid and the number of modes.
        tolerance: relative, of frequency and slosh mass and the rest; `error_estimate` says what was reached. A mesh
            is not refined beyond a tenth of what the points of a contour leave open.
        doubt: what the points of a contour leave open, where it is known; default: found by solving again.

    Raises:
        OutsideValidity: the liquid's section cannot be meshed.
    """
    section, count = tank.section, tank.modes + 1
    if doubt is None:
        exact = Doubt(modes=np.zeros(count), lid=0.0, fixed=0.0)
        doubt = doubt_of(tank.shape, section, count, tank.modes) if isinstance(tank.shape, Contour) else exact
    if isinstance(tank.shape, Cylinder | Annulus):
        modal = flat_bottom(section, count)
    else:
        least = min(float(np.min(doubt.modes[: tank.modes])), doubt.lid, _ROUGHEST)
        modal = modes_by_elements(section, count, tank.modes, max(tolerance, 0.1 * least))
    return _dressed(tank, section, modal, doubt)


def _outline(wall: Wall) -> Array:
    return np.concatenate([piece.point(np.linspace(0.0, 1.0, 129)) for piece in wall], axis=1)


def _dressed(tank: Tank, section: LiquidSection, modal: Modal, doubt: Doubt) -> SloshModes:
    """Return the result from what does not depend on density and acceleration."""
    n = slice(0, tank.modes)
    rho, H_cg = tank.liquid.density, section.cg_height
    m_T, m, H_s = rho * section.volume, rho * modal.mass_volume[n], modal.spring_height[n]
    I_F = rho * modal.lid_volume
    V_0, H_0, J_0 = fixed_part(modal, section.volume, H_cg, tank.modes)
    m_0, I_0 = rho * V_0, rho * J_0
    return SloshModes(
        tank=tank,
        section=section,
        kappa=modal.kappa[n],
        frequency=np.sqrt(modal.kappa[n] * tank.acceleration),
        slosh_mass=m,
        spring_height=H_s,
        wave_per_displacement=modal.wave[n],
        error_estimate=modal.error[n] + doubt.modes[n],
        rigid_lid_error=float(np.max(modal.error[n])) + doubt.lid,
        fixed_inertia_error=modal.fixed_error + doubt.fixed,
        liquid_mass=m_T,
        fixed_mass=m_0,
        fixed_mass_height=H_0,
        fixed_mass_inertia=I_0,
        rigid_lid_inertia=I_F,
        next_mass=rho * float(modal.mass_volume[-1]),
        surface_radius=modal.radius,
        surface_shape=modal.shape[n],
        wall_friction=modal.friction[n],
        floor_friction=modal.floor_friction[n],
        friction_error=modal.friction_error[n] + doubt.modes[n],
        method=modal.method,
    )
