"""One slosh mass: a spring, a mass and a damper at a station of the vehicle, fig 1."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from sloshpy.damping import AnyDamping
from sloshpy.units import Quantity, Real

NAME = r"^[A-Za-z0-9][A-Za-z0-9 _.\-]{0,63}$"


class SloshMass(BaseModel):
    """The first lateral slosh mode of a tank as a spring-mass-damper, fig 1.

    Fields other than name and damping may carry leading axes (arrays): a batch of vehicles.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    name: str = Field(pattern=NAME, description="name of the tank")
    slosh_mass: Annotated[Real, Quantity("kg", "m_s", "slosh mass", above=0.0)]
    station: Annotated[
        Real, Quantity("m", "X_s", "spring-mass location forward of the gimbal (not the pendulum hinge)")
    ]
    frequency: Annotated[
        Real, Quantity("rad/s", "w_s", "slosh natural frequency at this case's axial acceleration", above=0.0)
    ]
    radius: Annotated[Real, Quantity("m", "R", "tank radius, for the validity of the amplitude", above=0.0)] | None = (
        None
    )
    damping: AnyDamping
