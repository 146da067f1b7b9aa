"""Shapes of tanks, all bodies of revolution: the walls of their section, from the lowest point up."""

from abc import ABC, abstractmethod
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from sloshpy.tank.contour import check_contour, pieces_through
from sloshpy.tank.pieces import Arc, Line, Piece
from sloshpy.units import Array, Quantity, refusal

Wall = tuple[Piece, ...]
_RADIUS = Quantity("m", "R", "inner radius of the tank", above=0.0, most=1e3)
_HEIGHT = Quantity("m", "H", "height of the tank", above=0.0, most=1e3)


class Shape(BaseModel, ABC):
    """What the shapes share: a frozen value; an outer wall from the axis or an inner wall up, an inner wall or none."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    @property
    @abstractmethod
    def outer(self) -> Wall:
        """The outer wall, from the axis or the inner wall up."""

    @property
    def inner(self) -> Wall:
        return ()


class Cylinder(Shape):
    """A circular cylinder with a flat bottom."""

    kind: Literal["cylinder"] = "cylinder"
    radius: Annotated[float, _RADIUS]
    height: Annotated[float, _HEIGHT]

    @property
    def outer(self) -> Wall:
        R, H = self.radius, self.height
        return Line(start=(0.0, 0.0), end=(R, 0.0)), Line(start=(R, 0.0), end=(R, H))


class Annulus(Shape):
    """The space between two upright circular cylinders, with a flat bottom."""

    kind: Literal["annulus"] = "annulus"
    radius: Annotated[float, _RADIUS]
    inner_radius: Annotated[float, Quantity("m", "R_i", "radius of the inner wall", above=0.0, most=1e3)]
    height: Annotated[float, _HEIGHT]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.inner_radius >= self.radius:
            raise refusal(("inner_radius",), f"must be < the radius {self.radius:g} m", "swap them, or check the units")
        return self

    @property
    def outer(self) -> Wall:
        R_i, R, H = self.inner_radius, self.radius, self.height
        return Line(start=(R_i, 0.0), end=(R, 0.0)), Line(start=(R, 0.0), end=(R, H))

    @property
    def inner(self) -> Wall:
        return (Line(start=(self.inner_radius, 0.0), end=(self.inner_radius, self.height)),)


class Capsule(Shape):
    """A cylinder between two domes, each half an ellipsoid."""

    kind: Literal["capsule"] = "capsule"
    radius: Annotated[float, _RADIUS]
    barrel: Annotated[float, Quantity("m", "H_b", "height of the cylindrical part", least=0.0, most=1e3)]
    dome: Annotated[float, Quantity("m", "H_d", "height of each dome", above=0.0, most=1e3)]

    @property
    def outer(self) -> Wall:
        R, b, d = self.radius, self.barrel, self.dome
        below = Arc(centre=(0.0, d), axes=(R, d), t=(0.0, 0.5 * np.pi))
        above = Arc(centre=(0.0, d + b), axes=(R, d), t=(0.5 * np.pi, np.pi))
        return (below, Line(start=(R, d), end=(R, d + b)), above) if b > 0.0 else (below, above)


class Sphere(Shape):
    """A sphere."""

    kind: Literal["sphere"] = "sphere"
    radius: Annotated[float, _RADIUS]

    @property
    def outer(self) -> Wall:
        R = self.radius
        return (Arc(centre=(0.0, R), axes=(R, R), t=(0.0, np.pi)),)


class Spheroid(Shape):
    """An ellipsoid of revolution about the vehicle's axis."""

    kind: Literal["spheroid"] = "spheroid"
    radius: Annotated[float, _RADIUS]
    half_height: Annotated[float, Quantity("m", "B", "half the height", above=0.0, most=1e3)]

    @property
    def outer(self) -> Wall:
        A, B = self.radius, self.half_height
        return (Arc(centre=(0.0, B), axes=(A, B), t=(0.0, np.pi)),)


class Cone(Shape):
    """A cone, apex down."""

    kind: Literal["cone"] = "cone"
    half_angle: Annotated[float, Quantity("rad", "alpha", "angle between axis and wall", above=0.0, below=0.5 * np.pi)]
    height: Annotated[float, _HEIGHT]

    @property
    def outer(self) -> Wall:
        return (Line(start=(0.0, 0.0), end=(self.height * float(np.tan(self.half_angle)), self.height)),)


class Toroid(Shape):
    """A ring with a circular section."""

    kind: Literal["toroid"] = "toroid"
    ring_radius: Annotated[float, Quantity("m", "R", "from the axis to the centre of the tube", above=0.0, most=1e3)]
    tube_radius: Annotated[float, Quantity("m", "r_0", "radius of the tube", above=0.0, most=1e3)]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.tube_radius >= self.ring_radius:
            rule = f"must be < the ring radius {self.ring_radius:g} m"
            raise refusal(("tube_radius",), rule, "the ring radius is that of the tube's centre line")
        return self

    @property
    def outer(self) -> Wall:
        R, r = self.ring_radius, self.tube_radius
        return (Arc(centre=(R, r), axes=(r, r), t=(0.0, np.pi)),)

    @property
    def inner(self) -> Wall:
        R, r = self.ring_radius, self.tube_radius
        return (Arc(centre=(R, r), axes=(-r, r), t=(0.0, np.pi)),)


_Z = Quantity("m", "z", "heights of the wall's points, rising", sequence=True)
_R = Quantity("m", "r", "radii of the wall's points", least=0.0, most=1e3, sequence=True)


class Contour(Shape):
    """Any body of revolution: points of its outer wall from the lowest up and, where there is one, of an inner wall.

    A run of points that bend alike is a smooth curve through them; elsewhere the wall is straight between points, with
    an edge where it turns. `straight` makes it straight everywhere. What the points leave open is in the errors.
    """

    kind: Literal["contour"] = "contour"
    z: Annotated[Array, _Z]
    r: Annotated[Array, _R]
    z_inner: Annotated[Array, _Z] | None = None
    r_inner: Annotated[Array, _R] | None = None
    resolution: (
        Annotated[
            float,
            Quantity(
                "m",
                "",
                "step to which points are rounded; if not given, as digits show",
                above=0.0,
                most=10.0,
            ),
        ]
        | None
    ) = None
    straight: bool = Field(default=False, description="straight between the points everywhere")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_contour(self.z, self.r, self.z_inner, self.r_inner)
        return self

    @property
    def outer_points(self) -> tuple[Array, Array]:
        """Radii and heights of the outer wall's points, from the axis or the inner wall up."""
        r, z = self.r, self.z - self.z[0]
        if self.r_inner is not None:  # the floor is wetted from the inner wall on, whether it is listed or not
            beyond = (z > 0.0) | (r > self.r_inner[0])
            r, z = np.append(self.r_inner[0], r[beyond]), np.append(0.0, z[beyond])
        return r, z

    @property
    def inner_points(self) -> tuple[Array, Array] | None:
        """Radii and heights of the inner wall's points; None where there is none."""
        if self.z_inner is None or self.r_inner is None:
            return None
        return self.r_inner, self.z_inner - self.z[0]

    @property
    def outer(self) -> Wall:
        return pieces_through(*self.outer_points, self.straight)

    @property
    def inner(self) -> Wall:
        points = self.inner_points
        return () if points is None else pieces_through(*points, self.straight)


AnyShape = Annotated[
    Cylinder | Capsule | Sphere | Spheroid | Cone | Annulus | Toroid | Contour, Field(discriminator="kind")
]
