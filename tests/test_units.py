"""Texts with units become the right SI numbers, and what could be misread is refused."""

import math
from typing import Annotated

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from sloshpy.units import Quantity, UnitError, parse, show


@pytest.mark.parametrize(
    ("text", "unit", "si"),
    [
        ("202328 lbf", "N", 202328 * 4.4482216152605),
        ("900 kN", "N", 9e5),
        ("1 lbm", "kg", 0.45359237),
        ("1 lb", "kg", 0.45359237),
        ("6.6e5 slug*ft^2", "kg*m^2", 6.6e5 * 14.593902937206362 * 0.3048**2),
        ("6.6e5 slug-ft^2", "kg*m^2", 6.6e5 * 14.593902937206362 * 0.3048**2),
        ("6.6e5 slug-ft²", "kg*m^2", 6.6e5 * 14.593902937206362 * 0.3048**2),
        ("9e5 kg·m²", "kg*m^2", 9e5),
        ("9e5 kg*m**2", "kg*m^2", 9e5),
        ("1 ft-lbf*s^2", "kg*m^2", 1.3558179483314004),
        ("100 in", "m", 2.54),
        ("0.5 Hz", "rad/s", math.pi),
        ("1 cycle/s", "rad/s", 2 * math.pi),
        ("60 rpm", "rad/s", 2 * math.pi),
        ("180 deg/s", "rad/s", math.pi),
        ("2 rad/s", "rad/s", 2.0),
        ("30 deg", "rad", math.pi / 6),
        ("30°", "rad", math.pi / 6),
        ("5 mrad", "rad", 0.005),
        ("4.8 %", "1", 0.048),
        ("0.048", "1", 0.048),
        ("6 dB", "dB", 10**0.3),
        ("-20 dB", "dB", 0.1),
        ("0.1 1/m", "1/m", 0.1),
        ("10 %/m", "1/m", 0.1),
        ("0.1 1/m^0.5", "1/m^0.5", 0.1),
        ("1.2 g_0", "m/s^2", 1.2 * 9.80665),
        ("20 ms", "s", 0.02),
        ("  -3.5e-1   m ", "m", -0.35),
    ],
)
def test_a_text_with_its_unit_is_read_in_si(text: str, unit: str, si: float) -> None:
    assert parse(text, unit) == pytest.approx(si, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "unit", "rule", "cure"),
    [
        ("5 1/s", "rad/s", "does not say whether it is cyclic or angular", 'write "2 rad/s" or "0.32 Hz"'),
        ("1 Hz", "1/s", "is a frequency", 'write "1 1/s"'),
        ("5 Hz", "s", "is a frequency, must be a time", 'write "0.14 s" or "20 ms"'),
        ("100 lb", "N", "is a mass, must be a force", "did you mean lbf? lb and lbm are masses"),
        ("100 lbf", "kg", "is a force, must be a mass", "did you mean lbm? lbf is a force"),
        ("1 g", "m/s^2", "is a mass, must be an acceleration", "did you mean g_0? g is a gram"),
        ('100 "', "m", "has a quotation mark for a unit", "write in or ft, as in 100 in"),
        ("100 '", "m", "has a quotation mark for a unit", "write in or ft, as in 100 in"),
        ("6", "dB", "must be in dB", 'write the gain as in "6 dB"; a ratio k is 20 log10(k) dB'),
        ("1e300 dB", "dB", "is out of range", 'write the gain as in "6 dB"'),
        ("3 dB", "1", "is on a logarithmic scale or one with an offset", 'write 0.048 or "4.8 %"'),
        ("3 deg", "1", "is an angle or a frequency, must be a plain number", 'write 0.048 or "4.8 %"'),
        ("0.1", "rad", "has no unit", 'write "0.5 deg" or "5 mrad"'),
        ("1 %", "rad", "is not an angle", 'write "0.5 deg" or "5 mrad"'),
        ("9e5", "kg", "has no unit", 'write "16000 kg" or "35274 lbm"'),
        ("3 m", "kg", "is a length, must be a mass", 'write "16000 kg" or "35274 lbm"'),
        ("1,5 m", "m", "is not one plain number", "write a decimal point and no thousands separator"),
        ("1_0 m", "m", "is not one plain number", "write a decimal point and no thousands separator"),
        ("1.0D+03 m", "m", "has a Fortran exponent", "write e in place of D, as in 1.0e3"),
        ("６ m", "m", "must start with a number", 'write "9 m" or "29.5 ft"'),
        ("nan m", "m", "must start with a number", 'write "9 m" or "29.5 ft"'),
        ("1e999 m", "m", "must be finite", 'write "9 m" or "29.5 ft"'),
        ("1 lbff", "N", 'has the unknown unit "lbff"', 'did you mean lbf? Write "900 kN" or "202328 lbf"'),
        ("1 m^9^9^9", "m", 'has the unknown unit "m^9^9^9"', 'write "9 m" or "29.5 ft"'),
        ("1 m/0", "m", 'has the unknown unit "m/0"', 'write "9 m" or "29.5 ft"'),
        ("1 (((m", "m", 'has the unknown unit "(((m"', 'write "9 m" or "29.5 ft"'),
    ],
)
def test_a_text_that_could_be_misread_is_refused_with_its_rule_and_cure(
    text: str, unit: str, rule: str, cure: str
) -> None:
    with pytest.raises(UnitError) as caught:
        parse(text, unit)
    assert (caught.value.rule, caught.value.cure) == (rule, cure)


@given(st.text(max_size=40), st.sampled_from(["m", "kg", "rad/s", "rad", "1", "dB", "1/m^0.5"]))
def test_any_text_after_a_number_is_a_number_or_a_unit_error(tail: str, unit: str) -> None:
    try:
        told: object = parse("1 " + tail, unit)
    except UnitError as error:
        told = (error.rule, error.cure)
    assert isinstance(told, float) or (isinstance(told, tuple) and all(told))


def test_a_list_says_which_of_its_items_is_wrong() -> None:
    lengths: TypeAdapter[object] = TypeAdapter(Annotated[object, Quantity("m", least=0.0, sequence=True)])
    with pytest.raises(ValidationError) as caught:
        lengths.validate_python(["1 m", "2 m", "-3 m"])
    assert caught.value.errors()[0]["ctx"]["key"] == (2,)
    np.testing.assert_array_equal(lengths.validate_python(["1 m", 2]), [1.0, 2.0])


def test_an_integer_beyond_every_float_is_not_finite() -> None:
    number: TypeAdapter[float] = TypeAdapter(Annotated[float, Quantity("1")])
    with pytest.raises(ValidationError, match="must be finite"):
        number.validate_python(10**400)


def test_a_value_is_shown_with_its_everyday_unit_beside_it() -> None:
    assert show(16000.0, "kg") == "16000 kg (35274 lbm)"
    assert show(math.pi, "rad/s") == "3.14159 rad/s (0.5 Hz)"
    assert show(10**0.3, "dB") == "6 dB"
