"""The vehicle: a rigid body on vectored thrust with its slosh masses, table 1."""

from collections.abc import Mapping
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from sloshpy.units import Array, Quantity, Real, refusal
from sloshpy.vehicle.flexible_mode import Aerodynamics, Engine, FlexibleMode
from sloshpy.vehicle.slosh_mass import SloshMass


class Vehicle(BaseModel):
    """A vehicle under thrust, seen in one plane.

        tail                         c.g.                        nose
         |---- station X ---->        |                           |
       gimbal ------------------------o---------- m_s ------------->  X, metres forward of the gimbal plane
         \\ beta                   l = Xcg - X_s, positive behind the c.g.
          \\ thrust; beta > 0 pushes the tail toward +Z and so turns the nose toward -Z

    Mass, inertia and c.g. include the engines and the sloshing fluid at rest on the axis.
    Fields may carry leading axes (arrays that broadcast together): a batch of vehicles.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    mass: Annotated[Real, Quantity("kg", "M", "vehicle mass with engines and sloshing fluid", above=0.0)]
    inertia: Annotated[
        Real, Quantity("kg*m^2", "I", "pitch-yaw moment of inertia with engines and sloshing fluid", above=0.0)
    ]
    cg: Annotated[Real, Quantity("m", "X_cg", "centre of gravity forward of the gimbal", above=0.0)]
    thrust: Annotated[Real, Quantity("N", "F", "total engine thrust", above=0.0)]
    vectored_thrust: Annotated[Real, Quantity("N", "R'", "vectored engine thrust; default: thrust", above=0.0)] = Field(
        default_factory=lambda data: data["thrust"]
    )
    drag: Annotated[Real, Quantity("N", "D", "drag", least=0.0)] = 0.0
    accelerometer_station: (
        Annotated[Real, Quantity("m", "X_a", "lateral accelerometer forward of the gimbal, where one is fed back")]
        | None
    ) = None
    tanks: tuple[SloshMass, ...] = Field(default=(), description="slosh masses, one for each tank")
    flexible_modes: tuple[FlexibleMode, ...] = Field(default=(), description="bending modes")
    engine: Engine | None = None
    aerodynamics: Aerodynamics | None = None

    @field_validator("tanks")
    @classmethod
    def _pendulums_hang(cls, tanks: tuple[SloshMass, ...], info: ValidationInfo) -> tuple[SloshMass, ...]:
        if not {"mass", "thrust", "drag"} <= info.data.keys():
            return tanks  # refused already
        return _hung(tanks, (info.data["thrust"] - info.data["drag"]) / info.data["mass"])

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if np.any(np.asarray(self.vectored_thrust) > self.thrust):
            raise refusal(("vectored_thrust",), "must be <= thrust", "give the part of the thrust that is gimballed")
        if np.any(np.asarray(self.drag) >= self.thrust):
            raise refusal(("drag",), "must be < thrust", "the axial acceleration that drives slosh must be > 0")
        seen: dict[str, int] = {}
        for j, tank in enumerate(self.tanks):
            if tank.name.casefold() in seen:
                raise refusal(
                    ("tanks", j, "name"), f"is the name of tank {seen[tank.name.casefold()] + 1} too", "rename one"
                )
            seen[tank.name.casefold()] = j
        for i, mode in enumerate(self.flexible_modes):
            names = [t.name for t in self.tanks]
            if mode.name.casefold() in seen:
                raise refusal(
                    ("flexible_modes", i, "name"), "is the name of a tank or of another mode too", "rename one"
                )
            seen[mode.name.casefold()] = i
            for name in names:
                if name not in mode.tank:
                    raise refusal(
                        ("flexible_modes", i, "tank"),
                        f'has no shape at tank "{name}"',
                        f"give tank.{name} its deflection and slope",
                    )
            for name in mode.tank:
                if name not in names:
                    raise refusal(
                        ("flexible_modes", i, "tank", name), "is no tank of the case", f"one of {', '.join(names)}"
                    )
        if self.engine is not None:
            S, I_e = np.asarray(self.engine.first_moment), np.asarray(self.engine.inertia)
            if np.any(I_e * np.asarray(self.mass) < S**2):  # S^2 / I_e is at most the mass of the engines
                raise refusal(
                    ("engine", "first_moment"),
                    "squared over the inertia is more than the vehicle's mass",
                    "both are about the gimbal: inertia is at least first_moment^2 / mass of the engines",
                )
        if self.aerodynamics is not None:
            felt = np.asarray(self.aerodynamics.normal_force_slope) > 0.0
            if np.any(felt) and not np.all(felt):  # without air Z' is drift too: another set of states
                raise refusal(
                    ("aerodynamics", "normal_force_slope"),
                    "is 0 for some vehicles of the batch",
                    "put those into a batch of their own",
                )
        share = 1.0 - self.mass_matrix_margin
        if not np.all(share < 1.0):  # so that an overflow to nan is refused too
            heaviest = int(np.argmax([np.max(tank.slosh_mass) for tank in self.tanks]))
            raise refusal(
                ("tanks", heaviest, "slosh_mass"),
                f"makes the mass matrix indefinite: m/M + m l^2/I must be < 1 (is {np.max(share):.4g})",
                "check that mass and inertia include the slosh mass",
            )
        return self

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with some fields changed; the frequency of a pendulum follows the new acceleration."""
        copy = super().model_copy(update=update, deep=deep)
        if all(tank.pendulum_length is None for tank in copy.tanks):
            return copy
        return super().model_copy(update={**(update or {}), "tanks": _hung(copy.tanks, copy.acceleration)}, deep=deep)

    @property
    def acceleration(self) -> Real:
        """Axial acceleration a = (F - D)/M, m/s^2; k3 of the paper."""
        return (self.thrust - self.drag) / self.mass

    def lever(self, tank: SloshMass) -> Real:
        """Return l = Xcg - X_s in m, positive where the slosh mass is behind the c.g."""
        return self.cg - tank.station

    @property
    def mass_matrix_margin(self) -> Array:
        """Smallest eigenvalue of the scaled slosh mass matrix, shape of the batch: 1 - m/M - m l^2/I for one tank.

        The slosh block left by eliminating Z, phi and the bending modes is 1 - V V' with the columns sqrt(m/M),
        l sqrt(m/I) and Y_i sqrt(m/M_i); its least eigenvalue is one minus the greatest of the small Gram matrix V' V.
        It must be positive.
        """
        if not self.tanks:
            return np.asarray(1.0)
        with np.errstate(all="ignore"):  # an overflow is inf or nan, and that is refused
            m = [np.asarray(tank.slosh_mass) for tank in self.tanks]
            columns = [[np.sqrt(m_j / np.asarray(self.mass)) for m_j in m]]
            columns += [
                [self.lever(t) * np.sqrt(m_j / np.asarray(self.inertia)) for t, m_j in zip(self.tanks, m, strict=True)]
            ]
            columns += [
                [
                    f.tank[t.name].deflection * np.sqrt(m_j / np.asarray(f.generalized_mass))
                    for t, m_j in zip(self.tanks, m, strict=True)
                ]
                for f in self.flexible_modes
            ]
            flat = np.broadcast_arrays(*(entry for column in columns for entry in column))
            V = np.stack(flat, axis=-1).reshape(*flat[0].shape, len(columns), len(m))
            gram = V @ np.swapaxes(V, -1, -2)
        finite = np.all(np.isfinite(gram), axis=(-1, -2))
        greatest = np.linalg.eigvalsh(np.where(finite[..., None, None], gram, np.eye(len(columns))))[..., -1]
        return np.asarray(np.where(finite, 1.0 - greatest, -np.inf))


def _hung(tanks: tuple[SloshMass, ...], acceleration: Real) -> tuple[SloshMass, ...]:
    """Return the slosh masses under an axial acceleration; an error says which one it is."""
    hung = []
    for j, tank in enumerate(tanks):
        try:
            hung.append(tank.under(acceleration))
        except PydanticCustomError as error:
            words = error.context or {}
            raise refusal((j, *words["key"]), words["rule"], words["cure"]) from None
    return tuple(hung)
