"""Every input of a case as rows of a table: key, symbol, meaning, as given and in SI with the everyday unit."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from sloshpy.case import Case
from sloshpy.damping import PowerDamping
from sloshpy.units import Quantity, show

OWN_TABLES = {"name", "tanks", "flexible_modes", "engine", "aerodynamics"}  # of the vehicle, but not in its table
MOST_SHOWN = 12  # values of a list shown one by one


@dataclass(frozen=True, kw_only=True)
class InputRow:
    """One input; `given` is the text of the case file, "" for a default or a case made in Python.

    course: whether it changes along time.
    """

    key: str
    symbol: str
    meaning: str
    given: str
    value: str
    course: bool = False


def input_rows(case: Case) -> list[InputRow]:
    """Return every input of a case in the order of its nouns, keys as in a case file.

    Of a batch along time each number that changes is shown with its first and last value and, where it goes beyond
    them, its least and greatest.
    """
    given = case.source.given if case.source is not None else {}
    rows = [*_rows("vehicle", case.vehicle, given)]
    for tank in case.vehicle.tanks:
        rows += _rows(f"tank.{tank.name}", tank, given)
    for mode in case.vehicle.flexible_modes:
        rows += _rows(f"flexible_mode.{mode.name}", mode, given)
    for key, part in (("engine", case.vehicle.engine), ("aerodynamics", case.vehicle.aerodynamics)):
        rows += _rows(key, part, given) if part is not None else []
    return [*rows, *_rows("autopilot", case.autopilot, given), *_rows("criteria", case.criteria, given)]


def _rows(key: str, noun: BaseModel, given: dict[str, str]) -> Iterator[InputRow]:
    for name, field in type(noun).model_fields.items():
        value, at = getattr(noun, name), f"{key}.{field.alias or name}"
        if value is None or name in OWN_TABLES:
            continue
        if isinstance(value, dict):  # a mode's shapes by tank
            for tank, shape in value.items():
                yield from _rows(f"{at}.{tank}", shape, given)
            continue
        if isinstance(value, BaseModel):
            yield from _rows(at, value, given)
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            for k, part in enumerate(value):
                yield from _rows(f"{at}.{k + 1}", part, given)
        elif not isinstance(value, tuple) or value:
            quantity = _quantity(field)
            yield InputRow(
                key=at,
                symbol=quantity.symbol if quantity else "",
                meaning=(quantity.meaning if quantity else field.description) or "",
                given=given.get(at, ""),
                value=_shown(noun, name, value, quantity),
                course=any(_along_time(noun, x) and not _steady(x) for x in _items(value)),
            )


def _shown(noun: BaseModel, name: str, value: Any, quantity: Quantity | None) -> str:
    if isinstance(noun, PowerDamping) and name == "slope":
        return _slope(noun)
    if isinstance(value, tuple) and any(_along_time(noun, x) for x in value):  # coefficients in descending powers
        each = [_shown(noun, name, x, quantity) for x in value]
        return "; ".join(f"s^{len(value) - 1 - k}: {text}" for k, text in enumerate(each))
    return _course(value, quantity) if _along_time(noun, value) else _value(value, quantity)


def _items(value: Any) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else (value,)


def _along_time(noun: BaseModel, value: Any) -> bool:
    """Whether a value is a course over time; a law's arrays are its data."""
    return isinstance(value, np.ndarray) and value.ndim == 1 and "law" not in type(noun).model_fields


def _steady(course: Any) -> bool:
    """Whether a course changes by no more than the rounding of what was computed at each time."""
    return bool(np.ptp(course) <= 1e-9 * np.max(np.abs(course)))


def _course(value: Any, quantity: Quantity | None) -> str:
    """Return the first and the last value of a course, and its extremes where they lie between."""
    ends, low, high = (value[0], value[-1]), np.min(value), np.max(value)
    if _steady(value):
        return _value(float(low), quantity)
    parts = [f"{_value(float(ends[0]), quantity)} to {_value(float(ends[1]), quantity)}"]
    parts += [f"at least {_value(float(low), quantity)}"] if low < min(ends) else []
    parts += [f"at most {_value(float(high), quantity)}"] if high > max(ends) else []
    return ", ".join(parts)


def _quantity(field: FieldInfo) -> Quantity | None:
    """Return the unit and meaning of a field, also where it stands inside an optional or a list."""
    found = [m for m in field.metadata if isinstance(m, Quantity)]
    return found[0] if found else _nested(field.annotation)


def _nested(annotation: Any) -> Quantity | None:
    for part in get_args(annotation):
        if isinstance(part, Quantity):
            return part
        found = _nested(part)
        if found is not None:
            return found
    return None


def _value(value: Any, quantity: Quantity | None) -> str:
    if quantity is None or isinstance(value, str):
        return str(value)
    if quantity.unit == "1" and np.ndim(value) == 0 and "ratio" not in quantity.meaning:
        return f"{float(value):.6g}"  # a gain or an exponent is no percentage
    if quantity.unit == "rad/s" and "rate" in quantity.meaning:
        return f"{float(value):.6g} rad/s ({np.degrees(float(value)):.5g} deg/s)"
    if np.ndim(value) == 0:
        return show(float(value), quantity.unit)
    shown = [f"{float(v):.6g}" for v in value[:MOST_SHOWN]]
    more = f" ... ({len(value)} values)" if len(value) > MOST_SHOWN else ""
    return ", ".join(shown) + more + ("" if quantity.unit == "1" else f" {quantity.unit}")


def _slope(law: PowerDamping) -> str:
    unit = "1/m" if law.exponent == 1.0 else f"1/m^{law.exponent:g}"
    return f"{law.slope:.6g} {unit}"
