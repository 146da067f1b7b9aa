"""Bending modes of the structure with the slosh masses frozen, and the gimballed engine's own inertia."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from sloshpy.units import Quantity, Real
from sloshpy.vehicle.slosh_mass import NAME

_CONFIG = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)


class ModeShape(BaseModel):
    """A mode's lateral deflection and slope dY/dX at one station, in the normalisation of its generalised mass."""

    model_config = _CONFIG

    deflection: Annotated[Real, Quantity("1", "Y", "lateral deflection per unit of modal coordinate")]
    slope: Annotated[Real, Quantity("1/m", "Y'", "slope dY/dX per unit of modal coordinate, X forward")]


class ModeSlope(BaseModel):
    """A mode's slope at a station where only rotation counts."""

    model_config = _CONFIG

    slope: Annotated[Real, Quantity("1/m", "Y'", "slope dY/dX per unit of modal coordinate, X forward")]


class FlexibleMode(BaseModel):
    """One bending mode with the slosh masses frozen at rest in their tanks.

    Lateral position of the axis is Z + (X - Xcg) phi + sum Y_i(X) eta_i. A finite-element model with the liquid frozen
    in holds the slosh masses: they must be in the generalised mass, not added to it.
    """

    model_config = _CONFIG

    name: str = Field(pattern=NAME, description="name of the mode")
    frequency: Annotated[Real, Quantity("rad/s", "W", "natural frequency", above=0.0)]
    damping: Annotated[
        Real, Quantity("1", "zeta", "damping ratio", least=0.0, most=0.3, hint='a percentage is written "0.5 %"')
    ]
    generalized_mass: Annotated[Real, Quantity("kg", "M_i", "generalised mass", above=0.0)]
    gimbal: ModeShape
    gyro: ModeSlope
    rate_gyro: ModeSlope | None = Field(
        default=None, description="at the rate gyro; default: where the attitude is read"
    )
    accelerometer: ModeShape | None = Field(default=None, description="at the accelerometer, where one is fed back")
    tank: dict[str, ModeShape] = Field(default={}, description="at each slosh mass, by tank name")


class Engine(BaseModel):
    """Inertia of the gimballed engines (tail-wags-dog): what swivelling them does to the vehicle."""

    model_config = _CONFIG

    first_moment: Annotated[Real, Quantity("kg*m", "S", "first moment about the gimbal, c.g. aft of it", least=0.0)]
    inertia: Annotated[Real, Quantity("kg*m^2", "I_e", "moment of inertia about the gimbal", least=0.0)]


class Aerodynamics(BaseModel):
    """Quasi-steady normal force on the vehicle: N_alpha alpha at the centre of pressure."""

    model_config = _CONFIG

    normal_force_slope: Annotated[
        Real, Quantity("N", "N_alpha", "normal force per radian of angle of attack", least=0.0)
    ]
    center_of_pressure: Annotated[Real, Quantity("m", "X_cp", "centre of pressure forward of the gimbal")]
    speed: Annotated[Real, Quantity("m/s", "V", "speed relative to the air", above=0.0)]
