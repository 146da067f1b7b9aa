"""Gains, filters, delay and actuator.

phi, phi', acc, Z, Z' --> a0 phi + a1 phi' + a2 acc + b0 Z + b1 Z' --> gain --> filters --> delay --> actuator --> beta

A digital autopilot samples what the (analogue) filters give every T seconds, passes it through its digital filters and
holds the command until the next: ... --> filters --> sampler --> gain --> digital filters --> hold --> delay --> ...
"""

from typing import Annotated, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from sloshpy.autopilot.coefficients import alike, each
from sloshpy.units import Array, BoolArray, Quantity, Real, refusal

_CONFIG = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)


_Coefficients = tuple[Annotated[Real, Quantity("1", "", "coefficient")], ...]
_Fixed = tuple[Annotated[float, Quantity("1", "", "coefficient")], ...]
_TWO_FORMS = "an actuator has frequency and damping, or numerator and denominator"
DIGITAL_ROUNDING = 1e-6  # a pole this near the unit circle is one on it
ROUNDING = 1e-12  # a root this near the imaginary axis, relative to its size, is one on it


class Actuator(BaseModel):
    """Engine actuator w^2 / (s^2 + 2 zeta w s + w^2) with optional limits, or a stable transfer function.

    Coefficients are in descending powers of s.
    """

    model_config = _CONFIG

    frequency: Annotated[Real, Quantity("rad/s", "w_a", "natural frequency", above=0.0)] | None = None
    damping: Annotated[Real, Quantity("1", "zeta_a", "damping ratio", above=0.0, most=10.0)] | None = Field(
        default=None, validate_default=True
    )
    deflection_limit: Annotated[float, Quantity("rad", "", "largest engine angle", above=0.0)] | None = None
    rate_limit: Annotated[float, Quantity("rad/s", "", "largest engine rate", above=0.0, rate=True)] | None = None
    deadband: (
        Annotated[float, Quantity("rad", "", "half width of the command's dead band about zero", above=0.0)] | None
    ) = None
    numerator: _Coefficients | None = Field(
        default=None, min_length=1, description="of the transfer function, in place of frequency and damping"
    )
    denominator: _Coefficients | None = Field(default=None, min_length=1, description="of the transfer function")

    @field_validator("damping")
    @classmethod
    def _whole_form(cls, value: Real | None, info: ValidationInfo) -> Real | None:
        if value is None and info.data.get("frequency") is not None:
            raise refusal((), "is missing", "add damping = 0.7")
        if value is not None and info.data.get("frequency", value) is None:
            raise refusal((), "stands without frequency", _TWO_FORMS)
        return value

    @field_validator("numerator", "denominator")
    @classmethod
    def _leading_coefficient(cls, value: tuple[Real, ...] | None) -> tuple[Real, ...] | None:
        return None if value is None else _led(value)

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        second_order, fraction = self.frequency is not None, (self.numerator is not None, self.denominator is not None)
        if second_order and any(fraction):
            given = "numerator" if fraction[0] else "denominator"
            raise refusal((given,), "stands beside frequency and damping", f"give one form: {_TWO_FORMS}")
        if not second_order and not any(fraction):
            raise refusal(("frequency",), "is missing", 'add frequency = "6 Hz" and damping, or a transfer function')
        if any(fraction) and not all(fraction):
            given, lacks = ("numerator", "denominator") if fraction[0] else ("denominator", "numerator")
            raise refusal((given,), f"stands without {lacks}", f"add {lacks} = [...]")
        if all(fraction):
            self._sound_fraction()
        return self

    def _sound_fraction(self) -> None:
        top, bottom = self.fraction
        if len(top) > len(bottom):
            raise refusal(("numerator",), "has more coefficients than the denominator", "an actuator must be proper")
        roots = np.concatenate([np.roots(c) for c in each(bottom)])
        if np.any(roots.real >= -ROUNDING * np.abs(roots)):
            worst = roots[np.argmax(roots.real)] + 0.0  # no -0
            place = (
                f"{worst.real:.4g} rad/s" if worst.imag == 0.0 else f"{worst.real:.4g} +- {abs(worst.imag):.4g}j rad/s"
            )
            raise refusal(
                ("denominator",), f"has a pole at {place}", "an actuator is stable: every pole lies left of the axis"
            )
        for limit in ("deflection_limit", "rate_limit", "deadband"):
            if getattr(self, limit) is not None:
                rule = "needs the actuator's frequency and damping: a transfer function has no rate to limit"
                raise refusal((limit,), rule, "give frequency and damping in place of numerator and denominator")

    @property
    def limited(self) -> bool:
        """Whether it has a limit or a dead band, so that it is more than linear."""
        return any(limit is not None for limit in (self.deflection_limit, self.rate_limit, self.deadband))

    def beyond(self, angle: Real, omega: Real) -> BoolArray:
        """Return where an engine amplitude in rad at rad/s is not the linear actuator's; a dead band always is."""
        angle = np.asarray(angle, dtype=float)
        stop, fastest = (np.inf if x is None else x for x in (self.deflection_limit, self.rate_limit))
        return np.asarray((angle > stop) | (angle * omega > fastest) | (self.deadband is not None))

    @property
    def fraction(self) -> tuple[Array, Array]:
        """Numerator and denominator in descending powers of s, (k, ...) with the batch's axes behind."""
        if self.numerator is not None and self.denominator is not None:
            return alike(self.numerator, self.denominator)
        w, zeta = np.asarray(self.frequency, dtype=float), np.asarray(self.damping, dtype=float)  # one form is whole
        return alike((w**2,), (1.0, 2.0 * zeta * w, w**2))


class Filter(BaseModel):
    """A transfer function, coefficients in descending powers of s; each may carry the batch's axes."""

    model_config = _CONFIG

    numerator: _Coefficients = Field(min_length=1)
    denominator: _Coefficients = Field(min_length=1)

    @field_validator("numerator", "denominator")
    @classmethod
    def _leading_coefficient(cls, value: tuple[Real, ...]) -> tuple[Real, ...]:
        return _led(value)

    @model_validator(mode="after")
    def _proper(self) -> Self:
        if len(self.numerator) > len(self.denominator):
            raise refusal(("numerator",), "has more coefficients than the denominator", "a filter must be proper")
        return self

    @property
    def fraction(self) -> tuple[Array, Array]:
        """Numerator and denominator in descending powers of s, (k, ...) with the batch's axes behind."""
        return alike(self.numerator, self.denominator)


class DigitalFilter(BaseModel):
    """A pulse transfer function, coefficients in descending powers of z: poles inside the unit circle, or one at 1."""

    model_config = _CONFIG

    numerator: _Fixed = Field(min_length=1)
    denominator: _Fixed = Field(min_length=1)

    @field_validator("numerator", "denominator")
    @classmethod
    def _leading_coefficient(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        _led(value)
        return value

    @model_validator(mode="after")
    def _causal_and_stable(self) -> Self:
        if len(self.numerator) > len(self.denominator):
            raise refusal(("numerator",), "has more coefficients than the denominator", "a filter must be causal")
        poles = np.roots(self.denominator)
        wild = poles[(np.abs(poles) > 1.0 - DIGITAL_ROUNDING) & (np.abs(poles - 1.0) > DIGITAL_ROUNDING)]
        if len(wild) or self.integrators > 1:
            worst = complex(wild[np.argmax(np.abs(wild))]) if len(wild) else 1.0
            rule = f"has a pole at z = {worst:.6g}" + ("" if len(wild) else f", {self.integrators}-fold")
            cure = "poles lie inside the unit circle, or one at z = 1; coefficients are in descending powers of z"
            raise refusal(("denominator",), rule, cure)
        return self

    @property
    def integrators(self) -> int:
        """How many poles lie at z = 1."""
        # a pole of order k spreads over the k-th root of the rounding of the coefficients
        return int(np.sum(np.abs(np.roots(self.denominator) - 1.0) < DIGITAL_ROUNDING))


def _led(coefficients: tuple[Real, ...]) -> tuple[Real, ...]:
    if np.any(np.asarray(coefficients[0]) == 0.0):
        raise refusal((), "must not start with 0", "drop the leading zeros")
    return coefficients


class Autopilot(BaseModel):
    """Control beta = a0 phi + a1 phi' + a2 acc + b0 Z + b1 Z' (eq 13, sign corrected), gain, filters, delay, actuator.

    acc is the specific force along the body's lateral axis at the accelerometer; Z is the drift of the c.g., which an
    outer loop of guidance holds with positive gains b0, b1. All share gain, filters, delay and actuator.
    Gains and delay may carry leading axes (arrays): a batch of autopilots.
    """

    model_config = _CONFIG

    attitude_gain: Annotated[Real, Quantity("1", "a_0", "attitude gain, rad/rad", least=0.0)]
    rate_gain: Annotated[Real, Quantity("s", "a_1", "attitude-rate gain, rad/(rad/s)", least=0.0)]
    accelerometer_gain: Annotated[
        Real, Quantity("rad/(m/s^2)", "a_2", "gain of the lateral accelerometer, rad/(m/s^2)")
    ] = 0.0
    drift_gain: Annotated[Real, Quantity("rad/m", "b_0", "gain of the lateral drift of the c.g., rad/m")] = 0.0
    drift_rate_gain: Annotated[Real, Quantity("rad/(m/s)", "b_1", "gain of the drift's rate, rad/(m/s)")] = 0.0
    gain: Annotated[Real, Quantity("dB", "", "extra loop gain", above=1e-5, below=1e5)] = 1.0
    delay: Annotated[Real, Quantity("s", "tau", "pure delay in the loop", least=0.0, most=5.0)] = 0.0
    actuator: Actuator | None = None
    filter: tuple[Filter, ...] = ()
    sample_time: (
        Annotated[
            float,
            Quantity("s", "T", "period of a digital autopilot: sensors sampled, command held", above=0.0, most=5.0),
        ]
        | None
    ) = None
    digital_filter: tuple[DigitalFilter, ...] = ()

    @model_validator(mode="after")
    def _closes_the_loop(self) -> Self:
        if np.any((np.asarray(self.attitude_gain) == 0.0) & (np.asarray(self.rate_gain) == 0.0)):
            raise refusal(("attitude_gain",), "and rate_gain are both 0: the loop is open", "give at least one gain")
        if self.mixed_drift:
            raise refusal(
                (self.mixed_drift,), "is 0 for some autopilots of the batch", "put those into a batch of their own"
            )
        return self

    @model_validator(mode="after")
    def _digital(self) -> Self:
        if self.digital_filter and self.sample_time is None:
            rule = "is missing: a digital filter works at it"
            raise refusal(("sample_time",), rule, 'add sample_time = "20 ms"')
        if sum(f.integrators for f in self.digital_filter) > 1:
            rule = "integrates once more: two poles at z = 1 in all"
            raise refusal(("digital_filter", len(self.digital_filter) - 1, "denominator"), rule, "leave one")
        return self

    @property
    def hold(self) -> float:
        """Delay of the zero-order hold, half a period, in s; 0 for a continuous autopilot."""
        return 0.5 * (self.sample_time or 0.0)

    @property
    def dead_time(self) -> Real:
        """Delay of the loop that turns its phase evenly, s: the pure delay and the hold's."""
        return self.delay + self.hold if self.hold else self.delay

    @property
    def prompt(self) -> Self:
        """The autopilot without delay and hold, its digital filters by continuous ones (bilinear)."""
        continuous = tuple(_bilinear(f, self.sample_time or 0.0) for f in self.digital_filter)
        update = {"delay": 0.0, "filter": self.filter + continuous, "sample_time": None, "digital_filter": ()}
        return self.model_copy(update=update)

    @property
    def actuator_alone(self) -> Self:
        """The actuator with nothing before it."""
        update = {"filter": (), "delay": 0.0, "gain": 1.0, "sample_time": None, "digital_filter": ()}
        return self.model_copy(update=update)

    @property
    def mixed_drift(self) -> str:
        """Which drift gain is 0 for some of a batch alone, "" for none: they would have another set of states."""
        position, velocity = np.asarray(self.drift_gain) != 0.0, np.asarray(self.drift_rate_gain) != 0.0
        if np.any(position):
            return "" if np.all(position) else "drift_gain"
        return "" if np.all(velocity) or not np.any(velocity) else "drift_rate_gain"

    @property
    def lag_order(self) -> int:
        """Orders by which filters and actuator together roll off: poles less zeros; a delay is no lag of this kind."""
        parts = [(len(f.numerator), len(f.denominator)) for f in self.filter]
        if self.actuator is not None:
            top, bottom = self.actuator.fraction
            parts.append((len(top), len(bottom)))
        return sum(below - above for above, below in parts)

    def degraded(self, gain: float = 1.0, delay: float = 0.0) -> "Autopilot":
        """Return the autopilot with an extra loop gain (amplitude ratio, > 0) and an extra delay in s."""
        if not np.all(np.asarray(gain) > 0.0) or np.any(np.asarray(self.delay) + delay < 0.0):
            raise ValueError(
                "a degradation needs a gain ratio > 0 and leaves a delay >= 0 s; no delay is a phase advance"
            )
        return self.model_copy(update={"gain": self.gain * gain, "delay": self.delay + delay})


def _bilinear(f: DigitalFilter, T: float) -> Filter:
    """Return a digital filter with z = (2/T + s) / (2/T - s): the same near and below a tenth of the sampling rate."""
    order = len(f.denominator) - 1
    plus, minus = np.array([1.0, 2.0 / T]), np.array([-1.0, 2.0 / T])
    polynomials = []
    for z in (f.numerator, f.denominator):
        total = np.zeros(order + 1)
        for k, c in enumerate(reversed(z)):  # of z^k
            part = np.array([c])
            for factor in [plus] * k + [minus] * (order - k):
                part = np.convolve(part, factor)
            total += part
        polynomials.append(total / (2.0 / T) ** order)
    size = np.max(np.abs(polynomials[0]))
    top = np.where(np.abs(polynomials[0]) < ROUNDING * size, 0.0, polynomials[0])  # a zero at z = -1 lies at infinity
    return Filter(numerator=tuple(np.trim_zeros(top, "f")), denominator=tuple(polynomials[1]))
