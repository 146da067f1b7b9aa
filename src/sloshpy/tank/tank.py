"""A tank: its shape, what is in it and how it is accelerated."""

from typing import Annotated, Any, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, model_validator

from sloshpy.damping.laws import MOST_DAMPING
from sloshpy.tank.liquid import LiquidSection, depth_of_volume, liquid_section, moments_below
from sloshpy.tank.shapes import AnyShape
from sloshpy.units import Quantity, UnitError, parse, refusal

NAME = r"^[A-Za-z0-9][A-Za-z0-9 _.\-]{0,63}$"  # as the slosh masses of a vehicle
_CONFIG = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)
_FILM = 1e-4  # m: what wets the floor, on which no wave runs
_FILL_CURE = 'write a depth as "6.2 m" or a part of the volume as "62 %"'


class Liquid(BaseModel):
    """The propellant."""

    model_config = _CONFIG

    density: Annotated[float, Quantity("kg/m^3", "rho", "density", above=0.0, most=3e4)]
    kinematic_viscosity: (
        Annotated[float, Quantity("m^2/s", "nu", "kinematic viscosity, for wall damping", above=0.0, most=1.0)] | None
    ) = None


class Ring(BaseModel):
    """A flat ring baffle on the wall."""

    model_config = _CONFIG

    kind: str = Field(default="ring", pattern="^ring$")
    height: Annotated[float, Quantity("m", "z_b", "height above the lowest point", above=0.0, most=1e3)]
    width: Annotated[float, Quantity("m", "w", "from the wall to the free edge", above=0.0, most=1e3)]


class Fill(BaseModel):
    """How full the tank is: the depth above the lowest point in m, or the part of the volume; one of them."""

    model_config = _CONFIG

    depth: Annotated[float, Quantity("m", "h", "depth above the lowest point", above=0.0)] | None = None
    fraction: Annotated[float, Quantity("1", "", "part of the tank's volume", above=0.0, below=1.0)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _as_written(cls, data: Any, info: ValidationInfo) -> Any:
        """Read "6.2 m", "62 %" or, in Python, a depth in m."""
        if isinstance(data, str):
            try:
                of_volume = data.strip().endswith("%")
                parse(data, "1" if of_volume else "m")
            except UnitError as error:
                raise refusal((), error.rule, _FILL_CURE) from None
            return {"fraction" if of_volume else "depth": data}
        if isinstance(data, bool) or not isinstance(data, int | float):
            if isinstance(data, cls | dict) and not (info.context and info.context.get("file")):
                return data
            raise refusal((), "is not a depth or a part of the volume", _FILL_CURE)
        if info.context and info.context.get("file"):
            raise refusal((), "has no unit", _FILL_CURE)
        return {"depth": float(data)}

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.depth is None) == (self.fraction is None):
            raise refusal((), "is not one of a depth and a part of the volume", _FILL_CURE)
        return self


class Tank(BaseModel):
    """A body of revolution about the vehicle's axis, partly filled, under axial acceleration.

    Heights are above the tank's lowest point. A fill in Python is "6.2 m", "62 %" or a depth in m.
    """

    model_config = _CONFIG

    name: str = Field(pattern=NAME, description="name of the tank")
    fill: Fill
    acceleration: Annotated[
        float,
        Quantity(
            "m/s^2",
            "a",
            "axial acceleration: thrust less drag over mass",
            above=0.0,
            hint="the model is of a liquid held down by acceleration; in coast it has no meaning",
        ),
    ]
    modes: int = Field(default=1, ge=1, le=12, strict=True, description="slosh masses wanted")
    bottom_station: (
        Annotated[float, Quantity("m", "X_t", "the tank's lowest point forward of the gimbal; gives stations")] | None
    ) = None
    damping_floor: (
        Annotated[
            float,
            Quantity(
                "1",
                "xi_0",
                "damping ratio at any amplitude, such as measured without baffles; the wall's where that is greater",
                above=0.0,
                most=MOST_DAMPING,
                hint='a damping ratio above 0.3 is not slosh; a percentage is written "0.1 %"',
            ),
        ]
        | None
    ) = None
    liquid: Liquid
    shape: AnyShape
    baffle: tuple[Ring, ...] = Field(default=(), description="ring baffles")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.fill.depth is not None and self.fill.depth >= self.height:
            rule = f"must be < {self.height:.6g} m, the height of the tank: no free surface is left"
            raise refusal(("fill",), rule, "the depth counts from the lowest point")
        little = self.fill.depth is not None or (self.fill.fraction is not None and self.fill.fraction < 1e-3)
        if little and self.depth < _FILM:
            rule = (
                f"must be >= {1e3 * _FILM:g} mm deep, and is {1e3 * self.depth:.3g} mm: a film, on which no wave runs"
            )
            raise refusal(("fill",), rule, "check the unit, or leave the empty tank out")
        for j, ring in enumerate(self.baffle):
            if ring.height > self.height:
                rule = f"must be <= {self.height:.6g} m, the height of the tank"
                raise refusal(("baffle", j, "height"), rule, "it counts from the lowest point")
            if ring.width >= self.radius:
                rule = f"must be < {self.radius:.6g} m, the radius of the tank: it would be a bulkhead"
                raise refusal(("baffle", j, "width"), rule, "it counts from the wall inwards")
            for other in self.baffle[:j]:
                if abs(other.height - ring.height) < max(other.width, ring.width):
                    rule = f"is less than a ring's width from the one of {other.height:g} m: together they damp as one"
                    raise refusal(("baffle", j, "height"), rule, "leave one of them, or set them further apart")
        return self

    @property
    def height(self) -> float:
        """Height of the tank's top, m."""
        return float(self.shape.outer[-1].point(1.0)[1])

    @property
    def radius(self) -> float:
        """Greatest radius of the wall, m."""
        along = np.linspace(0.0, 1.0, 65)
        return float(max(np.max(piece.point(t)[0]) for piece in self.shape.outer for t in along))

    @property
    def volume(self) -> float:
        """Volume of the whole tank, m^3."""
        return moments_below(self.shape, self.height)[0]

    @property
    def depth(self) -> float:
        """Depth of the liquid above the lowest point, m."""
        if self.fill.depth is not None:
            return self.fill.depth
        assert self.fill.fraction is not None
        return depth_of_volume(self.shape, self.fill.fraction * self.volume, self.height)

    @property
    def section(self) -> LiquidSection:
        """The liquid's half section."""
        return liquid_section(self.shape, self.depth)
