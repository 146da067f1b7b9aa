"""One slosh mass: a spring, a mass and a damper at a station of the vehicle, fig 1, or the pendulum that it is."""

from typing import Annotated, Any

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
)

from sloshpy.damping import AnyDamping
from sloshpy.units import Array, Quantity, Real, example, refusal

NAME = r"^[A-Za-z0-9][A-Za-z0-9 _.\-]{0,63}$"
NOT_GIVEN = float("nan")  # of a number that follows from others: known by identity, since nan itself is refused
_TWO_FORMS = "a spring-mass has station and frequency, a pendulum hinge_station and pendulum_length"


class SloshMass(BaseModel):
    """The first lateral slosh mode of a tank as a spring-mass-damper, fig 1, or as a pendulum.

        pendulum hinged at X_h, mass hanging aft under the axial acceleration a = (F - D)/M:
        X_s = X_h - L ,   w_s = sqrt(a / L) ,   z = L theta       exact for the rigid vehicle

    Of the pendulum the station follows at once, the frequency where the mass enters a `Vehicle` (nan before).
    Bending modes are read at the station, not at the hinge.
    Fields other than name and damping may carry leading axes (arrays): a batch of vehicles.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    name: str = Field(pattern=NAME, description="name of the tank")
    slosh_mass: Annotated[Real, Quantity("kg", "m_s", "slosh mass", above=0.0)]
    hinge_station: (
        Annotated[Real, Quantity("m", "X_h", "pendulum hinge forward of the gimbal, in place of station")] | None
    ) = None
    pendulum_length: Annotated[Real, Quantity("m", "L", "pendulum length, in place of frequency", above=0.0)] | None = (
        Field(default=None, validate_default=True)
    )
    station: Annotated[
        Real, Quantity("m", "X_s", "spring-mass location forward of the gimbal (not the pendulum hinge)")
    ] = Field(default=NOT_GIVEN, validate_default=True)
    frequency: Annotated[
        Real, Quantity("rad/s", "w_s", "slosh natural frequency at this case's axial acceleration", above=0.0)
    ] = Field(default=NOT_GIVEN, validate_default=True)
    radius: Annotated[Real, Quantity("m", "R", "tank radius, for the validity of the amplitude", above=0.0)] | None = (
        None
    )
    damping: AnyDamping

    @field_validator("pendulum_length")
    @classmethod
    def _whole_pendulum(cls, value: Real | None, info: ValidationInfo) -> Real | None:
        if "hinge_station" in info.data and (info.data["hinge_station"] is None) != (value is None):
            has, lacks = (
                ("pendulum_length", "hinge_station") if value is not None else ("hinge_station", info.field_name)
            )
            raise refusal((), f"{has} stands without {lacks}", _TWO_FORMS)
        return value

    @field_validator("station", "frequency", mode="wrap")
    @classmethod
    def _one_form(cls, value: Any, handler: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
        given = not (value is None or value is NOT_GIVEN)
        if not {"hinge_station", "pendulum_length"} <= info.data.keys():
            return handler(value) if given else NOT_GIVEN  # the pendulum is refused already
        hinge, length = info.data["hinge_station"], info.data["pendulum_length"]
        if hinge is None:
            if given:
                return handler(value)
            unit = "m" if info.field_name == "station" else "rad/s"
            raise refusal((), "is missing", f"add {info.field_name} = {example(unit).split(' or ')[0]}")
        if not given:
            return _kept(hinge - length) if info.field_name == "station" else NOT_GIVEN
        if "station" in info.data or info.field_name == "station":  # told once
            raise refusal((), "stands beside hinge_station and pendulum_length", f"give one form: {_TWO_FORMS}")
        return handler(value)

    def under(self, acceleration: Real) -> "SloshMass":
        """Return the slosh mass under an axial acceleration in m/s^2: a pendulum's frequency follows it."""
        if self.pendulum_length is None or self.hinge_station is None:
            return self
        if not np.array_equal(self.station, self.hinge_station - self.pendulum_length):
            raise refusal(
                ("station",), "is not hinge_station - pendulum_length", "change the hinge or the length of a pendulum"
            )
        with np.errstate(invalid="ignore"):  # no acceleration, no frequency: the vehicle refuses that
            return self.model_copy(update={"frequency": _kept(np.sqrt(acceleration / self.pendulum_length))})


def _kept(value: Real | Array) -> Real:
    """Return a derived number as a field keeps it: a float, or an array that cannot be written to."""
    if np.ndim(value) == 0:
        return float(value)
    array = np.array(value, dtype=float)
    array.setflags(write=False)
    return array
