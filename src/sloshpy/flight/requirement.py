"""The damping that a flight asks of each tank against its fill: what the baffle designer is handed."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sloshpy.flight.assess_flight import FlightAssessment
from sloshpy.units import Array

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, kw_only=True)
class DampingRequirement:
    """Damping required of one tank, one row for each time, (R,).

    time: s. fill: part of the volume, nan where unknown. required, neutral: least ratios for the disc margin and for
    stability alone; nan where none up to 0.3 suffices. available: at `amplitude`, m of the slosh mass, or at small
    amplitude where that is nan. held: how much the other tanks are damped, in words. omega: of the least disc margin at
    the required damping, rad/s. frequency, radius, acceleration: of the slosh mass and its tank, rad/s, m, m/s^2.
    """

    flight: str
    tank: str
    criterion: str
    assumptions: tuple[str, ...]
    phase: tuple[str, ...]
    time: Array
    fill: Array
    required: Array
    neutral: Array
    available: Array
    amplitude: Array
    omega: Array
    frequency: Array
    radius: Array
    acceleration: Array
    held: tuple[str, ...]

    @property
    def worst(self) -> int:
        """The row that asks for most; one that no damping satisfies comes first."""
        return int(np.argmax(np.where(np.isnan(self.required), np.inf, self.required)))

    def __str__(self) -> str:
        k = self.worst
        need = "no damping suffices" if np.isnan(self.required[k]) else f"{100.0 * self.required[k]:.4g} %"
        fill = f", {100.0 * self.fill[k]:.4g} % full" if np.isfinite(self.fill[k]) else ""
        return f"{self.tank}: needs most at {self.time[k]:g} s ({self.phase[k]}{fill}): {need}; {self.criterion}"

    def columns(self) -> dict[str, Any]:
        """Return the table by columns, units in their names."""
        return {
            "phase": list(self.phase),
            "time [s]": self.time,
            "fill [1]": self.fill,
            "required_damping [1]": self.required,
            "neutral_damping [1]": self.neutral,
            "available_damping [1]": self.available,
            "at_amplitude [m]": self.amplitude,
            "at_frequency [rad/s]": self.omega,
            "slosh_frequency [rad/s]": self.frequency,
            "radius [m]": self.radius,
            "acceleration [m/s^2]": self.acceleration,
            "other_tanks": list(self.held),
        }

    def to_dataset(self) -> "xr.Dataset":
        """Return the table as an xarray Dataset; criterion and assumptions are its attributes."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        data: dict[str, Any] = {}
        for head, values in self.columns().items():
            name, _, unit = head.partition(" ")
            data[name] = ("point", values, {"units": unit.strip("[]")} if unit else {})
        attributes = {
            "flight": self.flight,
            "tank": self.tank,
            "criterion": self.criterion,
            "assumptions": "\n".join(self.assumptions),
        }
        return xr.Dataset(data, attrs=attributes)


def damping_requirement(result: FlightAssessment, tank: str) -> DampingRequirement:
    """Return the damping that a flight asks of a tank, time by time.

    Args:
        result: of `assess_flight`. tank: its name.
    """
    own = [(r, r.phase.tanks.index(tank)) for r in result.reviews if tank in r.phase.tanks]
    if not own:
        raise ValueError(f"no tank {tank!r} in this flight; it has {', '.join(result.trajectory.tanks)}")
    criteria = dict.fromkeys(
        f"disc margin of eq 24 >= {c.disc_margin:g} at {20.0 * np.log10(c.gain_margin):.4g} dB and "
        f"{np.degrees(c.phase_margin):.4g} deg"
        for c in (r.phase.case.criteria for r, _ in own)
    )

    def joined(pieces: list[Array]) -> Array:
        return np.concatenate([np.asarray(x, dtype=float) for x in pieces])

    def of_mass(name: str) -> Array:
        found = [[getattr(c.vehicle.tanks[j], name) for c in r.phase.cases] for r, j in own]
        return joined([np.array([np.nan if x is None else x for x in row], dtype=float) for row in found])

    return DampingRequirement(
        flight=result.trajectory.name,
        tank=tank,
        criterion="; ".join(criteria),
        assumptions=_assumptions(result, tank),
        phase=tuple(r.phase.name for r, _ in own for _ in r.time),
        time=joined([r.time for r, _ in own]),
        fill=joined([r.phase.fill[:, j] for r, j in own if r.phase.fill is not None]),
        required=joined([r.required[j].required for r, j in own]),
        neutral=joined([r.required[j].neutral for r, j in own]),
        available=joined([r.phase.available_damping[:, j] for r, j in own]),
        amplitude=joined([r.phase.reference_amplitude[:, j] for r, j in own]),
        omega=joined([r.required[j].omega for r, j in own]),
        frequency=of_mass("frequency"),
        radius=of_mass("radius"),
        acceleration=joined([np.array([c.vehicle.acceleration for c in r.phase.cases]) for r, _ in own]),
        held=tuple(_held(r.phase.tanks, row, j) for r, j in own for row in r.held),
    )


def _held(tanks: tuple[str, ...], held: Array, own: int) -> str:
    return "; ".join(f"{name} {100.0 * held[j]:.4g} %" for j, name in enumerate(tanks) if j != own)


def _assumptions(result: FlightAssessment, tank: str) -> tuple[str, ...]:
    phases = [phase for phase in result.trajectory if tank in phase.tanks]
    notes = dict.fromkeys(f"{phase.name}: {note}" for phase in phases for note in phase.notes)
    return (
        "required: least ratio above which, for every larger one up to 0.3, the loop is stable and every disc "
        "margin related to this tank meets the criterion; where another tank is short by more than 1 % of it there, "
        "also what that tank asks of this one; nan where there is none",
        "the other tanks are held at the damping in the last column: where all tanks together meet the criterion, each "
        "by its own law at one common amplitude",
        "each time is a frozen linear loop: small angles, mass properties and acceleration of the moment",
        "available: by the tank's own law at the amplitude beside it, a tenth of the radius or where its data end "
        "before, in metres of the slosh mass, not of the wave at the wall; at small amplitude where none stands",
        *notes,
    )
