"""What one case file describes: a vehicle, its autopilot and the criteria for accepting them."""

from typing import Annotated, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from sloshpy.autopilot import Autopilot
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

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.vehicle.engine is not None and self.autopilot.actuator is None:
            raise refusal(
                ("vehicle", "engine"),
                "has inertia, but nothing accelerates it: the autopilot has no actuator",
                "give autopilot.actuator its frequency and damping",
            )
        return self
