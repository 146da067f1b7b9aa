"""Laws of slosh damping: xi = f(A) at slosh amplitude A, and the force that has this describing function.

An amplitude A of a law is V/w: slosh velocity amplitude over slosh natural frequency. At the slosh frequency it is the
displacement amplitude of the slosh mass; in an oscillation at another frequency W it is W A / w. The paper sets
W = w before eq 17; keeping the ratio makes its 0.474 m the 0.444 m that a simulation shows.
"""

import bisect
import functools
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, model_validator

from sloshpy.damping.describing_function import describing_function_factor, invert_describing_function
from sloshpy.errors import OutsideValidity
from sloshpy.units import Array, Quantity, Real, UnitError, parse, refusal

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

# Above this a "damping ratio" is a percentage, a log decrement or 2 xi; it is a factor 3 above any baffle.
MOST_DAMPING = 0.3
ROUNDING = 1e-6  # relative: to more digits no damping is known, and a required one is not found
_HINT = 'a damping ratio above 0.3 is not slosh; a percentage is written "4.8 %"'


Force = Callable[[float], float]  # of a velocity in m/s, m/s^2


class DampingLaw(Protocol):
    """What the method asks of a law: xi = f(A) for the frequency domain, a force for the time domain."""

    @property
    def largest_amplitude(self) -> float:
        """The amplitude in m up to which the law is supported; inf for a formula that says nothing of it."""

    @property
    def smallest_amplitude(self) -> float:
        """The amplitude in m from which the law is supported; 0 for a formula."""

    def ratio(self, amplitude: Real) -> Array:
        """Return xi at amplitudes V/w in m, any shape; nan outside the supported range."""

    def acceleration(self, velocity: Real, natural_frequency: float) -> Array:
        """Return the damping acceleration in m/s^2 at slosh velocities in m/s; nan outside the supported range."""

    def force(self, natural_frequency: float) -> Force:
        """Return the same for one velocity at a time, for the innermost loop of a simulation."""

    def amplitude(self, ratio: Real) -> Array:
        """Return the least amplitude in m beyond which the law always gives at least the ratio.

        Where the law gives it already at its smallest amplitude, that amplitude is returned; where a constant never
        gives it, inf; where tested data do not reach it, nan.
        """


def _attained(ratio: Real, most: float) -> Array:
    """Return damping ratios, those that a law gives at most but for rounding as what it gives."""
    ratio = np.asarray(ratio, dtype=float)
    return np.where((ratio > most) & (ratio <= most * (1.0 + ROUNDING)), most, ratio)


class _Law(BaseModel):
    """What the laws share: a frozen value with named fields, valid at every amplitude unless it says otherwise."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    @property
    def largest_amplitude(self) -> float:
        return np.inf

    @property
    def smallest_amplitude(self) -> float:
        return 0.0


class ConstantDamping(_Law):
    """Linear damping: the same ratio at every amplitude."""

    law: Literal["constant"] = "constant"
    constant_ratio: Annotated[float, Quantity("1", "xi", "damping ratio", least=0.0, most=MOST_DAMPING, hint=_HINT)] = (
        Field(alias="ratio")
    )

    def ratio(self, amplitude: Real) -> Array:
        return np.full(np.shape(amplitude), self.constant_ratio)

    def acceleration(self, velocity: Real, natural_frequency: float) -> Array:
        return np.asarray(-2.0 * self.constant_ratio * natural_frequency * np.asarray(velocity))

    def force(self, natural_frequency: float) -> Force:
        d = 2.0 * self.constant_ratio * natural_frequency
        return lambda v: -d * v

    def amplitude(self, ratio: Real) -> Array:
        return np.where(_attained(ratio, self.constant_ratio) <= self.constant_ratio, 0.0, np.inf)


class PowerDamping(_Law):
    """xi = slope A^exponent; exponent 1 is the paper's odd square law (eqs 14, 18), 1/2 a ring baffle (Miles).

    A formula of limited validity carries its `largest_amplitude`: beyond it there is no number, as beyond a table.
    """

    law: Literal["power"] = "power"
    exponent: Annotated[float, Quantity("1", "p", "exponent of the amplitude", above=0.0, most=4.0)] = 1.0
    slope: Annotated[float, Quantity("1", "alpha", "damping ratio at an amplitude of 1 m, in m^-exponent", above=0.0)]
    holds_to: (
        Annotated[float, Quantity("m", "A", "slosh-mass displacement to which the law holds", above=0.0, most=1e3)]
        | None
    ) = Field(default=None, alias="largest_amplitude")

    @model_validator(mode="before")
    @classmethod
    def _slope_in_its_unit(cls, data: Any, info: ValidationInfo) -> Any:
        """Read a slope such as "0.1 1/m"; its unit is m^-p, so it depends on the exponent beside it."""
        if not isinstance(data, dict) or "slope" not in data:
            return data
        p, slope = data.get("exponent", 1.0), data["slope"]
        if isinstance(p, str):
            try:
                p = parse(p, "1")
            except UnitError:
                p = None
        if isinstance(p, bool) or not isinstance(p, int | float) or not 0.0 < p <= 4.0:
            # the exponent's own check says what is wrong; without it the slope has no unit to be read in
            return data | {"slope": 1.0} if isinstance(slope, str) else data
        cure = f'write "0.1 1/m^{p:g}"' if p != 1 else 'write "0.1 1/m"'
        if isinstance(slope, str):
            try:
                return data | {"slope": parse(slope, f"1/m^{p:g}" if p != 1 else "1/m")}
            except UnitError as error:
                raise refusal(("slope",), error.rule, error.cure if p == 1 else cure) from None
        if info.context and info.context.get("file"):
            raise refusal(("slope",), "has no unit" if isinstance(slope, int | float) else "is not a number", cure)
        return data

    @property
    def largest_amplitude(self) -> float:
        return np.inf if self.holds_to is None else self.holds_to

    def ratio(self, amplitude: Real) -> Array:
        A = np.asarray(amplitude, dtype=float)
        xi = np.asarray(self.slope * A**self.exponent)  # eq 18
        return xi if self.holds_to is None else np.where(self.holds_to >= A, xi, np.nan)

    def coefficient(self, natural_frequency: float) -> float:
        """Return c of the damping acceleration -c |v|^p v; for p = 1 it is b = 3 pi alpha / 4, eqs 14 and 19."""
        alpha, p, w = self.slope, self.exponent, natural_frequency
        return float(2.0 * alpha * w ** (1.0 - p) / describing_function_factor(p))

    def acceleration(self, velocity: Real, natural_frequency: float) -> Array:
        speed = np.abs(velocity)
        force = np.asarray(-self.coefficient(natural_frequency) * speed**self.exponent * velocity)  # eq 14
        if self.holds_to is None:
            return force
        return np.where(self.holds_to * natural_frequency >= speed, force, np.nan)

    def force(self, natural_frequency: float) -> Force:
        c, p = self.coefficient(natural_frequency), self.exponent
        if self.holds_to is not None:
            fastest = self.holds_to * natural_frequency
            return lambda v: -c * abs(v) ** p * v if abs(v) <= fastest else math.nan
        return (lambda v: -c * abs(v) * v) if p == 1.0 else (lambda v: -c * abs(v) ** p * v)

    def amplitude(self, ratio: Real) -> Array:
        if self.holds_to is None:
            return np.asarray((np.asarray(ratio, dtype=float) / self.slope) ** (1.0 / self.exponent))
        most = float(self.ratio(self.holds_to))
        ratio = _attained(ratio, most)
        return np.where(ratio <= most, np.minimum((ratio / self.slope) ** (1.0 / self.exponent), self.holds_to), np.nan)


class TableDamping(_Law):
    """Tested or computed damping against amplitude, interpolated monotonically (PCHIP), never extrapolated."""

    law: Literal["table"] = "table"
    tested_amplitude: Annotated[
        Array, Quantity("m", "A", "slosh-mass displacement amplitudes, increasing", least=0.0, most=1e3, sequence=True)
    ] = Field(alias="amplitude")
    tested_ratio: Annotated[
        Array, Quantity("1", "xi", "damping ratios", least=0.0, most=MOST_DAMPING, sequence=True, hint=_HINT)
    ] = Field(alias="ratio")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        A, xi = self.tested_amplitude, self.tested_ratio
        if len(A) != len(xi):
            raise refusal(
                ("ratio",), f"has {len(xi)} values for {len(A)} amplitudes", "give one ratio for each amplitude"
            )
        if len(A) < 2:
            raise refusal(
                ("amplitude",),
                f"has {len(A)} row{'' if len(A) == 1 else 's'}",
                'give at least two, or use law = "constant"',
            )
        if np.any(np.diff(A) <= 0.0):
            k = int(np.argmax(np.diff(A) <= 0.0))
            raise refusal(
                ("amplitude", k + 1), f"must increase, but {A[k + 1]:g} m follows {A[k]:g} m", "sort the rows"
            )
        return self

    def __eq__(self, other: object) -> bool:
        """Whether two tables hold the same rows."""
        if not isinstance(other, TableDamping):
            return NotImplemented
        mine, theirs = (self.tested_amplitude, self.tested_ratio), (other.tested_amplitude, other.tested_ratio)
        return all(np.array_equal(one, two) for one, two in zip(mine, theirs, strict=True))

    @property
    def largest_amplitude(self) -> float:
        return float(self.tested_amplitude[-1])

    @property
    def smallest_amplitude(self) -> float:
        return float(self.tested_amplitude[0])

    @functools.cached_property
    def _curve(self) -> "PchipInterpolator":
        from scipy.interpolate import PchipInterpolator  # 0.3 s: only when a table is used

        return PchipInterpolator(self.tested_amplitude, self.tested_ratio, extrapolate=False)

    @functools.cached_property
    def _force(self) -> "PchipInterpolator":
        """h(u)/w of the force h(|v|) v against u/w: N(V) = 2 w f(V/w) makes it free of w."""
        from scipy.interpolate import PchipInterpolator  # as above

        if self.smallest_amplitude > 0.0:
            raise OutsideValidity(
                f"the damping table starts at {self.smallest_amplitude:g} m, so the force at smaller velocities is "
                "unknown. Cure: add a row at 0 m"
            )
        A = self.tested_amplitude
        between = np.linspace(0.0, 1.0, 64)[:-1]
        nodes = np.append((A[:-1, None] + np.diff(A)[:, None] * between).ravel(), A[-1])
        f, slope = self._curve, self._curve.derivative()
        force = invert_describing_function(
            lambda a: 2.0 * f(np.minimum(a, A[-1])), lambda a: 2.0 * slope(np.minimum(a, A[-1])), nodes[1:], A
        )
        return PchipInterpolator(nodes, np.append(2.0 * f(0.0), force), extrapolate=False)

    @property
    def force_cubics(self) -> tuple[Array, Array]:
        """Nodes in m, (P + 1,), and cubics, (P, 4), highest power first, of h over w against |v| / w; force -h v."""
        return self._force.x, self._force.c.T

    def ratio(self, amplitude: Real) -> Array:
        return np.asarray(self._curve(amplitude))

    def acceleration(self, velocity: Real, natural_frequency: float) -> Array:
        w, v = natural_frequency, np.asarray(velocity)
        return np.asarray(-w * self._force(np.abs(v) / w) * v)

    def force(self, natural_frequency: float) -> Force:
        w, nodes, cubics = natural_frequency, self._force.x.tolist(), self._force.c.T.tolist()
        last = len(cubics)

        def of(v: float) -> float:
            u = abs(v) / w
            if not u <= nodes[last]:
                return math.nan
            k = min(bisect.bisect_right(nodes, u), last) - 1
            (a, b, c, d), x = cubics[k], u - nodes[k]
            return float(-w * (d + x * (c + x * (b + x * a))) * v)

        return of

    def amplitude(self, ratio: Real) -> Array:
        return np.asarray(np.vectorize(self._amplitude, otypes=[float])(ratio))

    def _amplitude(self, ratio: float) -> float:
        ratio = float(_attained(ratio, self.tested_ratio[-1]))
        if self.tested_ratio[-1] < ratio:
            return np.nan
        roots = self._curve.solve(ratio, extrapolate=False)
        below = [k for k, xi in enumerate(self.tested_ratio) if xi < ratio]
        if not below:
            return self.smallest_amplitude
        return float(roots[np.isfinite(roots) & (roots > self.tested_amplitude[below[-1]])][0])


class SumDamping(_Law):
    """Several dampers at work together, such as a smooth wall and a baffle: ratios and forces add."""

    law: Literal["sum"] = "sum"
    of: tuple[Annotated[ConstantDamping | PowerDamping | TableDamping, Field(discriminator="law")], ...] = Field(
        min_length=1
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.smallest_amplitude >= self.largest_amplitude:
            low, high = self.smallest_amplitude, self.largest_amplitude
            rule = f"has no amplitude at which all its laws hold: one begins at {low:g} m, one ends at {high:g} m"
            raise refusal(("of",), rule, "give laws that hold over a common range")
        return self

    @property
    def largest_amplitude(self) -> float:
        return min(law.largest_amplitude for law in self.of)

    @property
    def smallest_amplitude(self) -> float:
        return max(law.smallest_amplitude for law in self.of)

    def ratio(self, amplitude: Real) -> Array:
        return np.asarray(sum(law.ratio(amplitude) for law in self.of))

    def acceleration(self, velocity: Real, natural_frequency: float) -> Array:
        return np.asarray(sum(law.acceleration(velocity, natural_frequency) for law in self.of))

    def force(self, natural_frequency: float) -> Force:
        parts = [law.force(natural_frequency) for law in self.of]
        return lambda v: sum([part(v) for part in parts])

    def amplitude(self, ratio: Real) -> Array:
        return np.asarray(np.vectorize(self._amplitude, otypes=[float])(ratio))

    def _amplitude(self, ratio: float) -> float:
        """Search downwards from where the sum suffices to the last amplitude where it does not."""
        from scipy.optimize import brentq  # 0.3 s: only when an inverse of a sum is wanted

        low, high = self.smallest_amplitude, self.largest_amplitude
        if np.isinf(high):
            if all(isinstance(law, ConstantDamping) for law in self.of):
                return 0.0 if float(self.ratio(0.0)) >= _attained(ratio, float(self.ratio(0.0))) else np.inf
            high = 1.0
            while float(self.ratio(high)) < ratio:  # a power law grows without bound, so this ends
                high *= 2.0
        else:
            ratio = float(_attained(ratio, float(self.ratio(high))))
            if float(self.ratio(high)) < ratio:
                return np.nan
        knots = [law.tested_amplitude for law in self.of if isinstance(law, TableDamping)]
        A = np.unique(np.clip(np.concatenate([np.linspace(low, high, 513), *knots]), low, high))
        short = np.flatnonzero(self.ratio(A) < ratio)
        if len(short) == 0:
            return low
        k = int(short[-1])
        return float(brentq(lambda a: float(self.ratio(a)) - ratio, A[k], A[k + 1], xtol=1e-14, rtol=1e-14))


AnyDamping = Annotated[ConstantDamping | PowerDamping | TableDamping | SumDamping, Field(discriminator="law")]


def small_amplitude_ratio(law: DampingLaw) -> float:
    """Return xi at the smallest amplitude that the law supports: 0 m for a formula, the first row of a table."""
    return float(law.ratio(law.smallest_amplitude))


def ratios(laws: Sequence[DampingLaw], amplitudes: Array) -> Array:
    """Return each law's xi at its own amplitude; `amplitudes` has the laws on its last axis."""
    return np.stack([law.ratio(amplitudes[..., j]) for j, law in enumerate(laws)], axis=-1)
