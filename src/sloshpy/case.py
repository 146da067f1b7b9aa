"""What one case file describes: a vehicle, its autopilot and the criteria for accepting them."""

from typing import Annotated, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from sloshpy.autopilot import Autopilot
from sloshpy.errors import OutsideValidity
from sloshpy.units import Quantity, refusal
from sloshpy.vehicle import Vehicle
from sloshpy.vehicle.slosh_mass import NAME

_CONFIG = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)


class Criteria(BaseModel):
    """What the designer accepts; the defaults are the paper's."""

    model_config = _CONFIG

    gain_margin: Annotated[float, Quantity("dB", "GM_d", "gain axis of the disc margin", above=1.0)] = 10.0**0.3
    phase_margin: Annotated[float, Quantity("rad", "PM_d", "phase axis of the disc margin", above=0.0, most=np.pi)] = (
        np.pi / 6.0
    )
    disc_margin: Annotated[
        float, Quantity("1", "DM", "least disc margin, and the threshold that sets the required damping", above=0.0)
    ] = 1.0
    limit_cycle_disc_margin: Annotated[
        float, Quantity("1", "DM", "disc margin below which slosh frequencies enter the limit-cycle band", above=0.0)
    ] = 1.1
    tvc_amplitude: Annotated[
        float, Quantity("rad", "beta", "largest acceptable limit-cycle amplitude of the engine", above=0.0)
    ] = np.pi / 360.0

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.limit_cycle_disc_margin < self.disc_margin:
            raise refusal(
                ("limit_cycle_disc_margin",),
                "must be >= disc_margin",
                "widen the band, as the paper does with 1.1 for 1.0",
            )
        return self


class Source(BaseModel):
    """Where a case came from: the file, its hash and the texts as written."""

    model_config = _CONFIG

    file: str
    sha256: str
    given: dict[str, str]  # "vehicle.mass" -> "16000 kg"
    notes: tuple[str, ...] = ()  # what was done with it that a reader should know


class Case(BaseModel):
    """A vehicle with its autopilot and criteria: everything a question about it needs."""

    model_config = _CONFIG

    name: str = Field(
        pattern=NAME.replace("{0,63}", "{0,99}"), description="what the case is called in figures and reports"
    )
    vehicle: Vehicle
    autopilot: Autopilot
    criteria: Criteria = Criteria()
    source: Source | None = None

    def tank_index(self, tank: int | str) -> int:
        """Return the number of a tank given by name or number."""
        names = [t.name for t in self.vehicle.tanks]
        if tank not in names and tank not in range(len(names)):
            raise ValueError(f"no tank {tank!r}; this vehicle has {', '.join(names) or 'none'}")
        return names.index(tank) if isinstance(tank, str) else int(tank)

    def __eq__(self, other: object) -> bool:
        """Whether two cases describe the same; the file they came from does not count."""
        if not isinstance(other, Case):
            return NotImplemented
        return all(getattr(self, name) == getattr(other, name) for name in ("name", "vehicle", "autopilot", "criteria"))

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        actuator = self.autopilot.actuator
        if self.vehicle.engine is not None and actuator is None:
            raise refusal(
                ("vehicle", "engine"),
                "has inertia, but nothing accelerates it: the autopilot has no actuator",
                "give autopilot.actuator its frequency and damping",
            )
        if self.vehicle.engine is not None and actuator is not None:
            top, bottom = actuator.fraction
            if len(bottom) < len(top) + 2:
                raise refusal(
                    ("autopilot", "actuator", "numerator"),
                    "is of less than two orders below the denominator: a step of the command would jerk the engine "
                    "without end, and it has inertia",
                    "give a denominator of two orders more",
                )
        if self.vehicle.accelerometer_station is not None and not np.any(self.autopilot.accelerometer_gain):
            raise refusal(
                ("vehicle", "accelerometer_station"),
                "is read by nothing: the accelerometer gain is 0",
                "give autopilot.accelerometer_gain or leave the station out",
            )
        fault = accelerometer_fault(self.vehicle, self.autopilot)
        if fault is not None:
            raise refusal(*fault)
        return self


def continuous(case: Case, verb: str) -> None:
    """Refuse a digital autopilot where a verb knows no sampler."""
    if case.autopilot.sample_time is not None:
        raise OutsideValidity(f"{verb} knows no sampler: `simulate` does, and the limit cycles by one sinusoid")


def accelerometer_fault(vehicle: Vehicle, autopilot: Autopilot) -> tuple[tuple[str | int, ...], str, str] | None:
    """Return the key, the rule and the cure where an accelerometer is fed back that the model cannot follow.

    The accelerometer feels the thrust at once, as beta, and the engine's inertia, as beta''. With less lag than that
    the loop is algebraic, and with any delay neutral: nothing of it survives the next lag that is left out.
    """
    if not np.any(autopilot.accelerometer_gain):
        return None
    missing = "is missing: the autopilot feeds an accelerometer back"
    if vehicle.accelerometer_station is None:
        return ("vehicle", "accelerometer_station"), missing, 'add accelerometer_station = "9 m"'
    for i, mode in enumerate(vehicle.flexible_modes):
        if mode.accelerometer is None:
            cure = 'add accelerometer = { deflection = 0.5, slope = "0.05 1/m" }'
            return ("vehicle", "flexible_modes", i, "accelerometer"), missing, cure
    if autopilot.lag_order < (1 if vehicle.engine is None else 3):
        rule = "feeds the thrust back at once: neither actuator nor filters lag"
        if vehicle.engine is not None:
            rule = "feeds the engine's inertia back at once: actuator and filters roll off by less than three orders"
        cure = "give the autopilot an actuator or a filter that lags, as an accelerometer has"
        return ("autopilot", "accelerometer_gain"), rule, cure
    return None
