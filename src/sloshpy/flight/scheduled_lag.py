"""Filters and actuator by schedule: the keys of their coefficients and frequencies, and what makes no filter."""

import re
from collections.abc import Mapping

import numpy as np

from sloshpy.autopilot import Actuator, Autopilot, Filter
from sloshpy.autopilot.autopilot import ROUNDING
from sloshpy.autopilot.coefficients import alike, each
from sloshpy.units import Array, Quantity, Real

PARTS = ("numerator", "denominator")
COEFFICIENT = Quantity("1", "", "coefficient")
FREQUENCY = Quantity("rad/s", "w", "mean frequency of the poles, all poles and zeros moving with it", above=0.0)
_OWN = {"frequency": Quantity("rad/s", "w_a", above=0.0), "damping": Quantity("1", "zeta_a", above=0.0, most=10.0)}
_HOW = (
    'as "autopilot.filter.1.denominator.s^1", the first filter\'s coefficient of s, or "autopilot.filter.1.frequency"'
)
_POWER = re.compile(r"s\^(0|[1-9][0-9]?)")

Place = tuple[str | int, ...]  # of a number in a case


class NotScheduled(ValueError):
    """A key leads to nothing that may follow a schedule; `rule` and `cure` say why and what does."""

    def __init__(self, rule: str, cure: str) -> None:
        self.rule, self.cure = rule, cure
        super().__init__(f"{rule}. Cure: {cure}.")


def find_lag(pilot: Autopilot, words: tuple[str, ...]) -> tuple[Place, Quantity]:
    """Return place, unit and range of ("filter", "1", "denominator", "s^1") or ("actuator", "frequency").

    Filters count from 1, as in messages and dispersions. A filter's "frequency" is no field: see `lag_values`.

    Raises:
        NotScheduled: there is no such number.
    """
    if words[0] == "actuator":
        return _find_actuator(pilot.actuator, words[1:])
    there = [str(k + 1) for k in range(len(pilot.filter))]
    if not there:
        raise NotScheduled("names a filter, and the case has none", "add [[autopilot.filter]] to the case file")
    if len(words) < 2 or words[1] not in there:
        raise NotScheduled(f"names no filter of the case, which has {', '.join(there)}", f"write it {_HOW}")
    k, rest = int(words[1]) - 1, words[2:]
    if rest == ("frequency",):
        mean_frequency(pilot.filter[k])
        return ("autopilot", "filter", k, "frequency"), FREQUENCY
    return ("autopilot", "filter", k, *_coefficient(pilot.filter[k], rest)), COEFFICIENT


def _find_actuator(actuator: Actuator | None, words: tuple[str, ...]) -> tuple[Place, Quantity]:
    if actuator is None:
        raise NotScheduled("names an actuator, and the case has none", "add autopilot.actuator to the case file")
    if actuator.frequency is None:
        return ("autopilot", "actuator", *_coefficient(actuator, words)), COEFFICIENT
    if len(words) == 1 and words[0] in _OWN:
        return ("autopilot", "actuator", words[0]), _OWN[words[0]]
    if words and words[0] in Actuator.model_fields and words[0] not in PARTS:
        cure = "end the phase where it is switched, a case for each side"
        raise NotScheduled(f'"{words[0]}" of an actuator follows no schedule', cure)
    raise NotScheduled("names nothing of this actuator that follows a schedule", "one of frequency, damping")


def _coefficient(lag: Filter | Actuator, words: tuple[str, ...]) -> tuple[str, int]:
    """Return the part and the place in its list of a coefficient, named by its power of s."""
    power = _POWER.fullmatch(words[1]) if len(words) == 2 and words[0] in PARTS else None
    if power is None:
        raise NotScheduled("names no coefficient", f"write it {_HOW}; an actuator's likewise")
    order = len(getattr(lag, words[0])) - 1
    if int(power.group(1)) > order:
        rule = f"is beyond the case's {words[0]}, which ends at s^{order}"
        raise NotScheduled(rule, "give the case the order that the schedule has, with values of the first time")
    return words[0], order - int(power.group(1))


def mean_frequency(lag: Filter) -> float:
    """Return the geometric mean of the sizes of a filter's poles, rad/s.

    Raises:
        NotScheduled: it has no pole, or one at the origin.
    """
    _, bottom = lag.fraction
    n = len(bottom) - 1
    if n == 0 or bottom[-1] == 0.0:
        what = "a pole at the origin" if n else "no pole"
        raise NotScheduled(f"moves the frequency of a filter with {what}", "schedule its coefficients")
    return float(abs(bottom[-1] / bottom[0]) ** (1.0 / n))


def lag_values(pilot: Autopilot, place: Place, values: Array) -> dict[Place, Array]:
    """Return what goes into the case: the values themselves or, of a filter's frequency, all that it moves.

    (w/w0)^(n-p) times the coefficient of s^p, in numerator and denominator of the order n: G(s) becomes G(s w0/w).
    """
    if place[1:2] != ("filter",) or place[-1] != "frequency":
        return {place: values}
    k = int(place[2])
    lag = pilot.filter[k]
    share, n = values / mean_frequency(lag), len(lag.denominator) - 1
    found: dict[Place, Array] = {}
    for part in PARTS:
        coefficients = getattr(lag, part)
        for i, c in enumerate(coefficients):
            rise = n - (len(coefficients) - 1 - i)
            if rise:
                found["autopilot", "filter", k, part, i] = c * share**rise
    return found


def lag_fault(lag: Filter | Actuator, moved: Mapping[tuple[str, int], Array]) -> tuple[int, str, str] | None:
    """Return the first instant at which moving coefficients make no sound filter, with rule and cure; else None.

    Args:
        lag: as the case has it. moved: part and place in its list -> values at instants, (K,).
    """
    parts: dict[str, list[Real]] = {part: list(getattr(lag, part)) for part in PARTS}
    for (part, i), values in moved.items():
        parts[part][i] = values
    top, bottom = alike(parts["numerator"], parts["denominator"])
    for part, polynomial in zip(PARTS, (top, bottom), strict=True):
        turned = np.flatnonzero(polynomial[0] * polynomial[0, 0] <= 0.0)
        if len(turned):
            rule = f"{part}: its first coefficient, of s^{len(polynomial) - 1}, passes through 0"
            return int(turned[0]), rule, "end the phase before, with a case of the order that there is"
    still = np.cumprod(bottom[::-1] == 0.0, axis=0).sum(axis=0)  # poles at the origin
    if np.any(still != still[0]):
        rule = "denominator: has a pole that reaches or leaves the origin"
        return int(np.argmax(still != still[0])), rule, "end the phase there, a case for each side"
    for k, polynomial in enumerate(each(bottom)):
        poles = np.roots(polynomial)
        rounding = ROUNDING * np.abs(poles)
        beyond = poles[(poles.real > rounding) | ((poles.real >= -rounding) & (poles.imag != 0.0))]
        if len(beyond):
            worst = beyond[np.argmax(beyond.real)] + 0.0  # no -0
            swing = f" +- {abs(worst.imag):.4g}j" if worst.imag else ""
            rule = f"denominator: has a pole at {worst.real:.4g}{swing} rad/s"
            return k, rule, "what is scheduled is stable at every time: correct the rows, or end the phase before"
    return None
