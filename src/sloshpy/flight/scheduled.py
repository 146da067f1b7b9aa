"""Quantities of a case that follow a schedule: found by their key, put in as arrays over time, checked at each time."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, get_args

import numpy as np
from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from sloshpy.case import Case
from sloshpy.flight.scheduled_lag import NotScheduled, find_lag
from sloshpy.units import Array, Quantity

Steps = tuple[str | int, ...]
_PARTS = ("vehicle", "tank", "autopilot", "aerodynamics", "engine", "flexible_mode")
_SPRING, _PENDULUM = ("station", "frequency"), ("hinge_station", "pendulum_length")
_STEADY = ("criteria", "actuator", "filter", "digital_filter", "sample_time", "damping")  # these switch by phase


@dataclass(frozen=True, kw_only=True)
class Scheduled:
    """A quantity of a case that may follow a schedule: where it stands, and its unit and range."""

    key: str
    steps: Steps
    quantity: Quantity

    def fault(self, values: Array) -> tuple[int, str, str] | None:
        """Return the first value out of range, the rule and the cure; None where all are in it."""
        adapter: TypeAdapter[Any] = TypeAdapter(self.quantity_type)
        try:
            adapter.validate_python(values)
        except ValidationError:
            for k, value in enumerate(values):
                try:
                    adapter.validate_python(float(value))
                except ValidationError as error:
                    words = error.errors()[0].get("ctx", {})
                    return k, str(words.get("rule", "is out of range")), str(words.get("cure", ""))
        return None

    @property
    def quantity_type(self) -> Any:
        """The annotated type that checks the values."""
        return Annotated[float, self.quantity]


def scheduled(case: Case, key: str) -> Scheduled:
    """Return the quantity that a key such as "vehicle.mass" or "tank.LOX.slosh_mass" means.

    Raises:
        NotScheduled: there is none, or it may not change within a phase.
    """
    head, _, rest = key.partition(".")
    if head == "autopilot" and rest.split(".")[0] in {"filter", "actuator"}:
        place, quantity = find_lag(case.autopilot, tuple(rest.split(".")))
        return Scheduled(key=key, steps=place, quantity=quantity)
    if head not in _PARTS:
        raise NotScheduled("is no quantity of a case", f"it begins with one of {', '.join(_PARTS)}")
    steps: list[str | int] = ["autopilot"] if head == "autopilot" else ["vehicle"]
    if head in {"tank", "flexible_mode"}:
        field = "tanks" if head == "tank" else "flexible_modes"
        names = [one.name for one in getattr(case.vehicle, field)]
        name = next((n for n in sorted(names, key=len, reverse=True) if rest.startswith(f"{n}.")), None)
        if name is None:
            raise NotScheduled(f"names no {head.replace('_', ' ')} of the case", f"one of {', '.join(names) or 'none'}")
        steps += [field, names.index(name)]
        rest = rest[len(name) + 1 :]
    elif head in {"aerodynamics", "engine"}:
        steps.append(head)
    noun: Any = case
    for step in steps:
        noun = noun[step] if isinstance(step, int) else getattr(noun, step)
    if noun is None:
        raise NotScheduled(f"is not in the case: it has no [{head}]", f"add [{head}] to the case file")
    if head == "tank":
        pendulum = noun.pendulum_length is not None
        own, other = (_PENDULUM, _SPRING) if pendulum else (_SPRING, _PENDULUM)
        if rest in other:  # what follows from the other form would be thrown away
            raise NotScheduled(
                f"is not how the case gives this tank, which is a {'pendulum' if pendulum else 'spring-mass'}",
                f"schedule {' and '.join(own)}, or give it in the other form in the case",
            )
    return Scheduled(key=key, steps=(*steps, *(words := tuple(rest.split(".")))), quantity=_quantity(noun, words))


def _quantity(noun: Any, words: tuple[str, ...]) -> Quantity:
    """Return the unit and range of a field of a noun, or of a shape within it."""
    for depth, word in enumerate(words):
        if isinstance(noun, dict):
            noun = noun.get(word)
            continue
        if word in _STEADY and isinstance(noun, BaseModel) and word in type(noun).model_fields:
            raise NotScheduled(
                f'"{word}" follows no schedule', "end the phase where it is switched, a case for each side"
            )
        if not isinstance(noun, BaseModel) or word not in type(noun).model_fields:
            names = _names(noun) if isinstance(noun, BaseModel) else []
            raise NotScheduled(
                f'has no quantity "{word}" that follows a schedule', f"one of {', '.join(names) or 'none'}"
            )
        if depth == len(words) - 1:
            found = _of_field(type(noun).model_fields[word])
            if found is None:
                raise NotScheduled(f'"{word}" is no number', f"one of {', '.join(_names(noun))}")
            return found
        noun = getattr(noun, word)
    raise NotScheduled("is no number", "name a quantity in it")


def _names(noun: BaseModel) -> list[str]:
    return [n for n, f in type(noun).model_fields.items() if n not in _STEADY and _of_field(f) is not None]


def _of_field(field: FieldInfo) -> Quantity | None:
    """Return the quantity of a field, also where it is optional."""
    stack: list[Any] = [*field.metadata, *get_args(field.annotation)]
    while stack:
        one = stack.pop(0)
        if isinstance(one, Quantity):
            return None if one.sequence else one
        stack += get_args(one)
    return None


def with_schedules(case: Case, values: Mapping[Steps, Array]) -> Case:
    """Return a case with arrays over time in place of numbers, unchecked: see `checked`."""
    changed: Any = case
    for steps, array in values.items():
        changed = _put(changed, steps, array)
    found: Case = changed
    return found


def _put(value: Any, steps: Steps, array: Array) -> Any:
    if not steps:
        return array
    first, rest = steps[0], steps[1:]
    if isinstance(value, tuple):
        assert isinstance(first, int)
        return (*value[:first], _put(value[first], rest, array), *value[first + 1 :])
    if isinstance(value, dict):
        return value | {first: _put(value[first], rest, array)}
    name = str(first)
    return BaseModel.model_copy(value, update={name: _put(getattr(value, name), rest, array)})


def first_fault(cases: tuple[Case, ...]) -> tuple[int, str, str, str] | None:
    """Return the first case that is no possible vehicle: its number, the key, the rule and the cure; else None."""
    for k, case in enumerate(cases):
        try:
            _rebuilt(case)
        except ValidationError as error:
            one = error.errors(include_url=False)[0]
            words = one.get("ctx", {})
            steps = (*one["loc"], *words.get("key", ()))
            key = " ".join(step if isinstance(step, str) else str(step + 1) for step in steps)
            return k, key, str(words.get("rule", one["msg"])), str(words.get("cure", ""))
    return None


def _rebuilt(value: Any) -> Any:
    """Return a value made anew, so that every noun in it checks itself; a damping law is left as it is."""
    if isinstance(value, BaseModel) and "law" not in type(value).model_fields:
        fields = {name: getattr(value, name) for name in type(value).model_fields}
        return type(value)(**{name: _rebuilt(one) for name, one in fields.items()})
    if isinstance(value, tuple):
        return tuple(_rebuilt(one) for one in value)
    if isinstance(value, dict):
        return {name: _rebuilt(one) for name, one in value.items()}
    return value


def as_springs(case: Case) -> Case:
    """Return a case whose pendulums are the spring-masses that they are under its acceleration: X_h - L, sqrt(a/L)."""
    tanks = []
    for tank in case.vehicle.tanks:
        if tank.pendulum_length is None or tank.hinge_station is None:
            tanks.append(tank)
            continue
        spring: dict[str, Any] = {"hinge_station": None, "pendulum_length": None}
        spring["station"] = np.asarray(tank.hinge_station - np.asarray(tank.pendulum_length))
        spring["frequency"] = np.sqrt(np.asarray(case.vehicle.acceleration) / tank.pendulum_length)
        tanks.append(tank.model_copy(update=spring))
    return case.model_copy(update={"vehicle": BaseModel.model_copy(case.vehicle, update={"tanks": tuple(tanks)})})


def frequencies_follow(case: Case, before: Case, own: frozenset[int]) -> tuple[Case, tuple[str, ...]]:
    """Return the case with the slosh frequencies that no schedule gives at its own acceleration: w^2 goes as a.

    Args:
        case: with arrays over time. before: the single case that the frequencies were given for.
        own: numbers of the tanks whose frequency has a schedule.

    Returns:
        The case, and the names of the tanks whose frequency was scaled.
    """
    share = np.sqrt(np.asarray(case.vehicle.acceleration) / float(before.vehicle.acceleration))
    if np.allclose(share, 1.0, rtol=1e-6, atol=0.0):
        return case, ()
    free = [j for j, tank in enumerate(case.vehicle.tanks) if j not in own and tank.pendulum_length is None]
    found: dict[Steps, Array] = {
        ("vehicle", "tanks", j, "frequency"): np.asarray(case.vehicle.tanks[j].frequency) * share for j in free
    }
    return with_schedules(case, found), tuple(case.vehicle.tanks[j].name for j in free)
