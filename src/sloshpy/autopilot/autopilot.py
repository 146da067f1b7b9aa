"""Gains, filters, delay and actuator.

phi, phi' --> a0 phi + a1 phi' --> gain --> filters --> delay --> actuator --> beta
"""

from typing import Annotated, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from sloshpy.units import Quantity, Real, refusal

_CONFIG = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)


class Actuator(BaseModel):
    """Second-order engine actuator w^2 / (s^2 + 2 zeta w s + w^2) with optional limits."""

    model_config = _CONFIG

    frequency: Annotated[float, Quantity("rad/s", "w_a", "natural frequency", above=0.0)]
    damping: Annotated[float, Quantity("1", "zeta_a", "damping ratio", above=0.0, most=10.0)]
    deflection_limit: Annotated[float, Quantity("rad", "", "largest engine angle", above=0.0)] | None = None
    rate_limit: Annotated[float, Quantity("rad/s", "", "largest engine rate", above=0.0)] | None = None
    deadband: (
        Annotated[float, Quantity("rad", "", "half width of the command's dead band about zero", above=0.0)] | None
    ) = None


class Filter(BaseModel):
    """A transfer function, coefficients in descending powers of s."""

    model_config = _CONFIG

    numerator: tuple[Annotated[float, Quantity("1", "", "coefficient")], ...] = Field(min_length=1)
    denominator: tuple[Annotated[float, Quantity("1", "", "coefficient")], ...] = Field(min_length=1)

    @field_validator("numerator", "denominator")
    @classmethod
    def _leading_coefficient(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        if value[0] == 0.0:
            raise refusal((), "must not start with 0", "drop the leading zeros")
        return value

    @model_validator(mode="after")
    def _proper(self) -> Self:
        if len(self.numerator) > len(self.denominator):
            raise refusal(("numerator",), "has more coefficients than the denominator", "a filter must be proper")
        return self


class Autopilot(BaseModel):
    """Attitude control beta = a0 phi + a1 phi' (eq 13, sign corrected) with gain, filters, delay and actuator.

    Gains and delay may carry leading axes (arrays): a batch of autopilots.
    """

    model_config = _CONFIG

    attitude_gain: Annotated[Real, Quantity("1", "a_0", "attitude gain, rad/rad", least=0.0)]
    rate_gain: Annotated[Real, Quantity("s", "a_1", "attitude-rate gain, rad/(rad/s)", least=0.0)]
    gain: Annotated[Real, Quantity("dB", "", "extra loop gain", above=1e-5, below=1e5)] = 1.0
    delay: Annotated[Real, Quantity("s", "tau", "pure delay in the loop", least=0.0, most=5.0)] = 0.0
    actuator: Actuator | None = None
    filter: tuple[Filter, ...] = ()

    @model_validator(mode="after")
    def _closes_the_loop(self) -> Self:
        if np.any((np.asarray(self.attitude_gain) == 0.0) & (np.asarray(self.rate_gain) == 0.0)):
            raise refusal(("attitude_gain",), "and rate_gain are both 0: the loop is open", "give at least one gain")
        return self

    def degraded(self, gain: float = 1.0, delay: float = 0.0) -> "Autopilot":
        """Return the autopilot with an extra loop gain (amplitude ratio, > 0) and an extra delay in s."""
        if not np.all(np.asarray(gain) > 0.0) or np.any(np.asarray(self.delay) + delay < 0.0):
            raise ValueError(
                "a degradation needs a gain ratio > 0 and leaves a delay >= 0 s; no delay is a phase advance"
            )
        return self.model_copy(update={"gain": self.gain * gain, "delay": self.delay + delay})
