"""Units at the door: "202328 lbf", "6.6e5 slug*ft^2", "0.34 Hz" become SI floats; the only room that knows units."""

import difflib
import math
import re
from dataclasses import dataclass
from functools import cache
from tokenize import TokenError
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationInfo
from pydantic_core import PydanticCustomError, core_schema

if TYPE_CHECKING:
    import pint

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complexfloating[Any, Any]]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.integer[Any]]
Real = float | Array

LARGEST = 1e15  # in SI: beyond it nothing is a vehicle's
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_UNIT = re.compile(r"(?:[^\W\d]\w*|[*/() ]|\^-?\d{1,2}(?:\.\d{1,6})?|\^\(-?\d{1,2}/\d{1,2}\))+")
_TOWER = re.compile(r"\^[-\d./()]*\^")  # m^9^9^9 would keep pint busy for ever
_HYPHEN = re.compile(r"(?<=[A-Za-z\d)])-(?=[A-Za-z(])")  # slug-ft^2 is a product, not a subtraction
_ANGLES = {"radian", "degree", "turn", "revolution", "cycle", "arcminute", "arcsecond", "revolutions_per_minute"}
_SIGNS = {ord(k): v for k, v in {"²": "^2", "³": "^3", "·": "*", "×": "*", "−": "-", "°": "deg"}.items()}
_NOT_A_UNIT = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    LookupError,
    SyntaxError,
    TypeError,
    ValueError,
    TokenError,
)
_EXAMPLES = {
    "kg": '"16000 kg" or "35274 lbm"',
    "kg*m^2": '"9e5 kg*m^2" or "6.6e5 slug*ft^2"',
    "kg*m": '"1500 kg*m" or "337 slug*ft"',
    "m": '"9 m" or "29.5 ft"',
    "N": '"900 kN" or "202328 lbf"',
    "s": '"0.14 s" or "20 ms"',
    "rad/s": '"2 rad/s" or "0.32 Hz"',
    "rad": '"0.5 deg" or "5 mrad"',
    "1/m": '"0.1 1/m" or "10 %/m"',
    "m/s": '"400 m/s"',
    "m/s^2": '"12.1 m/s^2" or "1.2 g_0"',
    "rad/(m/s^2)": '"0.004 rad/(m/s^2)" or "0.2 deg/(m/s^2)"',
    "rad/m": '"0.0002 rad/m" or "0.01 deg/m"',
    "rad/(m/s)": '"0.002 rad/(m/s)" or "0.1 deg/(m/s)"',
    "kg/m^3": '"1141 kg/m^3" or "71.2 lbm/ft^3"',
    "m^2/s": '"1.7e-7 m^2/s" or "0.17 cSt"',
    "dB": '"6 dB"',
    "1": '0.048 or "4.8 %"',
}


_KINDS = {
    "kg": "a mass",
    "m": "a length",
    "s": "a time",
    "1/s": "a frequency",
    "N": "a force",
    "kg*m^2": "a moment of inertia",
    "kg*m": "a first moment of mass",
    "m/s": "a speed",
    "m/s^2": "an acceleration",
    "1/m": "a ratio per length",
    "s/m": "an angle per speed",
    "s^2/m": "an angle per acceleration",
    "kg/m^3": "a density",
    "m^2/s": "a kinematic viscosity",
    "dimensionless": "a plain number or an angle",
}


_SIGNS = {ord(k): v for k, v in {"²": "^2", "³": "^3", "·": "*", "×": "*", "−": "-", "°": "deg"}.items()}


class UnitError(ValueError):
    """A text is not a number with a fitting unit; `rule` says what is wanted, `cure` what to write."""

    def __init__(self, rule: str, cure: str) -> None:
        self.rule, self.cure = rule, cure
        super().__init__(f"{rule}. Cure: {cure}.")


@cache
def _registry() -> "pint.UnitRegistry[Any]":
    import pint  # 0.4 s with its registry: only when a text is read

    registry: pint.UnitRegistry[Any] = pint.UnitRegistry()
    registry.define("lbm = pound")
    return registry


def example(unit: str, rate: bool = False) -> str:
    """Return texts a user could write for a quantity of this SI unit; of an angular rate without Hz."""
    if rate:
        return '"15 deg/s" or "0.26 rad/s"'
    return _EXAMPLES.get(unit, f'"1 {unit}"')


def parse(text: str, unit: str, rate: bool = False) -> float:
    """Read a number with its unit and return it in SI.

    Args:
        text: what the user wrote, such as "202328 lbf", "6.6e5 slug-ft^2", "0.34 Hz", "4.8 %", "6 dB".
        unit: the SI unit wanted. "rad/s" takes cyclic units times 2 pi, "dB" returns the amplitude ratio
            10^(dB/20), "1" takes bare numbers and percent.
        rate: of "rad/s", that it is how fast something turns, not a frequency: hertz is refused.

    Raises:
        UnitError: no number, unknown unit, or a unit of another dimension.
    """
    text = text.strip()
    number = _NUMBER.match(text)
    if number is None:
        raise UnitError("must start with a number", f"write {example(unit)}")
    tail = text[number.end() :]
    if tail[:1] in {",", "_", "'"}:
        raise UnitError("is not one plain number", "write a decimal point and no thousands separator")
    if re.match(r"[dD][+-]?\d", tail):
        raise UnitError("has a Fortran exponent", "write e in place of D, as in 1.0e3")
    value, name = float(number.group()), tail.strip()
    if not math.isfinite(value):
        raise UnitError("must be finite", f"write {example(unit)}")
    if unit == "dB":
        if name != "dB":
            raise UnitError("must be in dB", 'write the gain as in "6 dB"; a ratio k is 20 log10(k) dB')
        if abs(value) > 6000.0:
            raise UnitError("is out of range", 'write the gain as in "6 dB"')
        return float(10.0 ** (value / 20.0))
    if not name:
        if unit == "1":
            return value
        raise UnitError("has no unit", f"write {example(unit, rate)}")
    return _convert(value, name, unit, rate)


def _convert(value: float, name: str, unit: str, rate: bool) -> float:
    import pint

    if '"' in name or "'" in name:
        raise UnitError("has a quotation mark for a unit", "write in or ft, as in 100 in")
    plain = name.translate(_SIGNS)
    plain = _HYPHEN.sub("*", plain).replace("%", "percent").replace("**", "^")
    below = plain.removeprefix("1/")
    registry = _registry()
    try:
        if len(below) > 60 or _UNIT.fullmatch(below) is None or _TOWER.search(below):
            raise ValueError("not a product of powers of names")
        written = registry.parse_units(below if below == plain else f"dimensionless/{below}")
        wanted = registry.parse_units("dimensionless" if unit == "1" else unit)
    except (*_NOT_A_UNIT, pint.errors.PintError):
        close = difflib.get_close_matches(
            plain, ["rad/s", "Hz", "kg", "lbm", "slug", "lbf", "ft", "deg", "mrad", "kN"], n=1
        )
        hint = f"did you mean {close[0]}? Write" if close else "write"
        raise UnitError(f'has the unknown unit "{name}"', f"{hint} {example(unit)}") from None
    if written.dimensionality != wanted.dimensionality:
        raise UnitError(
            f"is {_kind(written)}, must be {_kind(wanted)}", _cure_dimension(plain, unit) or f"write {example(unit)}"
        )
    if not registry.Quantity(1.0, written)._is_multiplicative:
        raise UnitError("is on a logarithmic scale or one with an offset", f"write {example(unit)}")
    powers = {str(u): p for u, p in written._units.items()}
    cyclic = sum(p for u, p in powers.items() if u.endswith("hertz"))
    angular = sum(p for u, p in powers.items() if u in _ANGLES or u.endswith("radian"))
    if rate and angular == 0:
        rule = "is a frequency, must be an angular rate" if cyclic else "does not say of which angle"
        raise UnitError(rule, f"write {example(unit, rate)}")
    if unit == "rad/s" and cyclic == 0 and angular == 0:
        raise UnitError("does not say whether it is cyclic or angular", f"write {example(unit)}")
    if unit == "rad" and angular == 0:
        raise UnitError("is not an angle", f"write {example(unit)}")
    if unit.startswith(("rad/(", "rad/m")) and angular == 0:
        raise UnitError("does not say of which angle", f"write {example(unit)}")
    if unit == "1" and (angular != 0 or cyclic != 0):
        raise UnitError("is an angle or a frequency, must be a plain number", f"write {example(unit)}")
    if unit != "rad/s" and cyclic != 0:
        raise UnitError("is a frequency", f"write {example(unit)}")
    factor = 2.0 * math.pi if cyclic else 1.0  # pint takes 1 Hz for 1 rad/s
    converted = float(registry.Quantity(value, written).to(wanted).magnitude) * factor
    if not math.isfinite(converted):
        raise UnitError(f"must be finite in {unit}", f"write {example(unit)}")
    if abs(converted) > LARGEST:  # its square would leave the range of numbers, and no warning names the key
        raise UnitError(f"must be below {LARGEST:g} {unit}", f"write {example(unit)}")
    return converted


def _kind(units: Any) -> str:
    for unit, name in _KINDS.items():
        if _registry().parse_units(unit).dimensionality == units.dimensionality:
            return name
    return f"of dimension {units.dimensionality}"


def _cure_dimension(name: str, unit: str) -> str:
    if unit == "N" and name in {"lb", "lbm", "pound"}:
        return "did you mean lbf? lb and lbm are masses"
    if unit == "kg" and name == "lbf":
        return "did you mean lbm? lbf is a force"
    if unit == "m/s^2" and name == "g":
        return "did you mean g_0? g is a gram"
    if unit == "kg*m^2" and "lbf" in name:
        return "did you mean lbm or slug? lbf is a force"
    return ""


def decibel(ratio: Real) -> Real:
    """Return 20 log10 of an amplitude ratio."""
    return 20.0 * np.log10(ratio)


_EVERYDAY = {
    "kg": ("lbm", 0.45359237),
    "kg*m^2": ("slug*ft^2", 1.3558179483314004),
    "kg*m": ("slug*ft", 4.4482216152605),
    "m": ("ft", 0.3048),
    "N": ("lbf", 4.4482216152605),
    "rad/s": ("Hz", 2.0 * math.pi),
    "rad": ("deg", math.pi / 180.0),
    "1": ("%", 0.01),
    "m/s": ("ft/s", 0.3048),
    "1/m": ("1/ft", 1.0 / 0.3048),
}


def show(value: float, unit: str) -> str:
    """Return a value in SI with its everyday unit beside it: "16000 kg (35274 lbm)"."""
    if unit == "dB":
        return f"{decibel(value):.6g} dB"
    si = f"{value:.6g}" if unit == "1" else f"{value:.6g} {unit}"
    if unit not in _EVERYDAY:
        return si
    name, size = _EVERYDAY[unit]
    return f"{si} ({value / size:.5g} {name})"


def compared(difference: float, of: str, digits: int = 3) -> str:
    """Return the size of a relative difference in words: "4.2 %", beyond 100 % "7.21 times the predicted amplitude"."""
    size = abs(difference)
    return f"{100.0 * size:.{digits}g} %" if size <= 1.0 else f"{size:.{digits}g} times {of}"


@dataclass(frozen=True)
class Quantity:
    """The unit, range and meaning of a field; reads texts with units and, in Python, SI numbers and arrays.

    Args:
        unit: SI unit, "1" for a plain number, "dB" for an amplitude ratio written in dB.
        symbol: the field's letter in the paper.
        meaning: one line for help, schema and report.
        above, least, below, most: the allowed range, exclusive and inclusive, in the SI unit.
        sequence: a list of quantities in place of one.
        hint: the likeliest cure where the range is broken.
        rate: of "rad/s", how fast something turns: hertz, which counts cycles, is refused.
    """

    unit: str
    symbol: str = ""
    meaning: str = ""
    above: float | None = None
    least: float | None = None
    below: float | None = None
    most: float | None = None
    sequence: bool = False
    hint: str = ""
    rate: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.with_info_plain_validator_function(self._read)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        text = {"type": "string"}
        one = {"anyOf": [{"type": "number"}, text]} if self.unit == "1" else text
        described = {
            "description": f"{self.meaning} [{self.unit}], {self.rule}. Write {example(self.unit, self.rate)}."
        }
        return {"type": "array", "items": one} | described if self.sequence else one | described

    @property
    def rule(self) -> str:
        """The allowed range in words."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        values = [
            (self.above, ">"),
            (self.least, ">="),
            (self.below, "<"),
            (self.most, "<="),
        ]
        if self.unit == "dB":
            values = [(None if v is None else float(decibel(v)) if v > 0 else None, sign) for v, sign in values]
        parts = [f"{sign} {value:.6g}{unit}" for value, sign in values if value is not None]
        return "must be " + " and ".join(parts) if parts else "must be finite"

    def _read(self, value: Any, info: ValidationInfo) -> Real:
        from_file = bool(info.context and info.context.get("file"))
        if self.sequence:
            if isinstance(value, str) or not np.iterable(value):
                raise refusal((), "must be a list", f"write [{example(self.unit).split(' or ')[0]}, ...]")
            read = np.array([self._item(k, v, from_file) for k, v in enumerate(value)], dtype=float)
        elif isinstance(value, np.ndarray) and not from_file:
            if value.dtype.kind not in "iuf":
                raise refusal((), f"is an array of {value.dtype}", "give an array of real numbers in SI units")
            read = np.asarray(value, dtype=float).copy()
        else:
            single = self._one(value, from_file)
            self._check(single)
            return single
        if not self.sequence:
            self._check(read)
        read.setflags(write=False)
        return read

    def _item(self, index: int, value: Any, from_file: bool) -> float:
        """Read one item of a list; its error says which."""
        try:
            single = self._one(value, from_file)
            self._check(single)
        except PydanticCustomError as error:
            words = error.context or {}
            raise refusal((index,), words["rule"], words["cure"]) from None
        return single

    def _one(self, value: Any, from_file: bool) -> float:
        if isinstance(value, str):
            if from_file and self.unit == "1" and _NUMBER.fullmatch(value.strip()):
                raise refusal((), "is a text", f"write the number without quotation marks, as in {value.strip()}")
            try:
                return parse(value, self.unit, self.rate)
            except UnitError as error:
                raise refusal((), error.rule, error.cure) from None
        if isinstance(value, bool | complex) or not isinstance(value, int | float | np.integer | np.floating):
            raise refusal((), "is not a number", f"write {example(self.unit, self.rate)}")
        if (isinstance(value, int) and abs(value) > 10**300) or not math.isfinite(value):
            raise refusal((), "must be finite", f"write {example(self.unit, self.rate)}")
        if from_file and self.unit != "1":
            unit = {"rad/s": "deg/s or rad/s" if self.rate else "rad/s or Hz", "rad": "deg or rad"}.get(
                self.unit, self.unit
            )
            raise refusal((), "has no unit", f'write it with its unit, as in "{value} {unit.split()[0]}" ({unit})')
        return float(value)

    def _check(self, value: Real) -> None:
        bad = not np.all(np.isfinite(value))
        bad |= self.above is not None and not np.all(value > self.above)
        bad |= self.least is not None and not np.all(value >= self.least)
        bad |= self.below is not None and not np.all(value < self.below)
        bad |= self.most is not None and not np.all(value <= self.most)
        if bad:
            sign = np.any(np.asarray(value) < 0.0) and max(self.above or 0.0, self.least or 0.0) >= 0.0
            raise refusal((), self.rule, self.hint or ("drop the sign" if sign else "give a value in this range"))


def refusal(key: tuple[str | int, ...], rule: str, cure: str) -> PydanticCustomError:
    """Return the error a noun's own check raises; `key` is the field below the noun that breaks the rule."""
    return PydanticCustomError("quantity", "{rule}. Cure: {cure}.", {"key": key, "rule": rule, "cure": cure})
