"""The JSON schemas describe case and tank files: they take the examples and refuse what the reader refuses."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from good_case import GOOD, POWER

from sloshpy.errors import InputError
from sloshpy.files import case_schema, read_tank, tank_schema

DATA = Path(__file__).parents[2] / "src" / "sloshpy" / "data"
_TYPES: dict[str, Any] = {"object": dict, "array": list, "string": str, "number": (int, float)}
_TYPES |= {"integer": int}
_KNOWN = {"$schema", "title", "description", "default", "type", "properties", "required", "additionalProperties"}
_KNOWN |= {"items", "minItems", "pattern", "enum", "anyOf", "oneOf", "minimum", "maximum"}


def _fits(value: Any, schema: dict[str, Any]) -> bool:
    """Return whether a value fits a schema, for the words of draft 4 that ours uses; any other word fails."""
    assert set(schema) <= _KNOWN, set(schema) - _KNOWN
    if schema.get("type") == "boolean":
        return isinstance(value, bool)
    if "type" in schema and (not isinstance(value, _TYPES[schema["type"]]) or isinstance(value, bool)):
        return False
    if "enum" in schema and value not in schema["enum"]:
        return False
    if not schema.get("minimum", -1e300) <= (value if isinstance(value, int) else 0) <= schema.get("maximum", 1e300):
        return False
    if "pattern" in schema and not re.search(schema["pattern"], value):
        return False
    if "anyOf" in schema and not any(_fits(value, one) for one in schema["anyOf"]):
        return False
    if "oneOf" in schema and sum(_fits(value, one) for one in schema["oneOf"]) != 1:
        return False
    if isinstance(value, list):
        return len(value) >= schema.get("minItems", 0) and all(_fits(one, schema.get("items", {})) for one in value)
    if isinstance(value, dict):
        keys = schema.get("properties", {})
        if not set(schema.get("required", [])) <= set(value):
            return False
        if schema.get("additionalProperties", True) is False and not set(value) <= set(keys):
            return False
        return all(_fits(one, keys.get(key, {})) for key, one in value.items())
    return True


@pytest.mark.parametrize("file", sorted(DATA.glob("*.toml")), ids=lambda path: path.name)
def test_the_schema_takes_the_shipped_examples(file: Path) -> None:
    assert _fits(tomllib.loads(file.read_text()), case_schema())
    assert file.read_text().startswith("#:schema ./slosh-case.schema.json\n")


@pytest.mark.parametrize(
    "law",
    [
        POWER,
        '{ law = "power", slope = "0.1 1/m", largest_amplitude = "0.3 m" }',
        '{ law = "table", file = "d.csv" }',
        '{ law = "table", amplitude = ["0 m", "1 m"], ratio = [0, "1 %"] }',
        '{ law = "sum", of = [{ law = "constant", ratio = "1 %" }, { law = "table", file = "d.csv" }] }',
    ],
)
def test_the_schema_takes_every_law_of_damping(law: str) -> None:
    assert _fits(tomllib.loads(GOOD.replace(POWER, law)), case_schema())


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"16000 kg"', "16000"),
        ('mass = "16000 kg"\n', ""),
        ('thrust = "900 kN"', 'thrust = "900 kN"\ntanks = []'),
        ("[criteria]", '[source]\nfile = "x"\n[criteria]'),
        ("[criteria]", "[criterai]"),
        ('"LOX"', '"<script>"'),
        (POWER, '{ law = "power", slope = 0.1 }'),
        (POWER, '{ law = "power", slope = "0.1 1/m", largest_amplitude = 0.3 }'),
        (POWER, '{ law = "cubic" }'),
        (POWER, '{ law = "table" }'),
        (POWER, '{ law = "table", file = "d.csv", amplitude = ["0 m"], ratio = [0] }'),
        (POWER, '{ law = "sum", of = [] }'),
        ("numerator = [1.0]", "numerator = []"),
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(old: str, new: str) -> None:
    assert old in GOOD
    assert not _fits(tomllib.loads(GOOD.replace(old, new, 1)), case_schema())


def test_the_schema_is_plain_and_tells_units() -> None:
    schema = case_schema()
    text = json.dumps(schema)
    assert "$ref" not in text
    assert "$defs" not in text
    assert "[kg], must be > 0 kg" in schema["properties"]["vehicle"]["properties"]["mass"]["description"]
    assert "vectored_thrust" not in schema["properties"]["vehicle"]["required"]
    assert schema["properties"]["criteria"]["properties"]["gain_margin"]["default"] == "6 dB"


def test_the_schema_asks_for_damping_unless_a_tank_file_is_named() -> None:
    bare = GOOD.replace(f"damping = {POWER}\n", "")
    own = 'slosh_mass = "1000 kg"\nstation = "9 m"\nfrequency = "2 rad/s"\n'
    assert bare != GOOD
    assert own in bare
    assert not _fits(tomllib.loads(bare), case_schema())
    assert _fits(tomllib.loads(bare.replace(own, 'tank_file = "lox.toml"\n', 1)), case_schema())


TANK = """\
name = "LOX"
fill = "62 %"
acceleration = "12 m/s^2"
modes = 2
liquid = { density = "1141 kg/m^3" }
shape = { kind = "contour", z = ["0 m", "0 m", "4 m"], r = ["0 m", "1 m", "1 m"], straight = true }
[[baffle]]
height = "2 m"
width = "0.2 m"
"""


def test_the_schema_takes_the_shipped_tanks_and_a_contour_in_a_file() -> None:
    for file in DATA.rglob("tanks/*.toml"):
        assert _fits(tomllib.loads(file.read_text(encoding="utf-8")), tank_schema())
    assert _fits(tomllib.loads(TANK), tank_schema())
    points = re.search(r'z = .*"\]', TANK)
    assert points is not None
    assert _fits(tomllib.loads(TANK.replace(points[0], 'file = "c.csv", resolution = "1 mm"')), tank_schema())
    text = json.dumps(tank_schema())
    assert "$ref" not in text
    assert "$defs" not in text
    assert "[m], must be > 0 m" in tank_schema()["properties"]["baffle"]["items"]["properties"]["width"]["description"]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"62 %"', "0.62"),
        ('"62 %"', '{ depth = "2 m" }'),
        ('acceleration = "12 m/s^2"\n', ""),
        ("modes = 2", "modes = 0"),
        ("modes = 2", "modes = 2.5"),
        ("modes = 2", "mode = 2"),
        ('kind = "contour"', 'kind = "sphere"'),
        ('kind = "contour", ', ""),
        ('z = ["0 m", "0 m", "4 m"], ', ""),
        ("z = [", 'file = "c.csv", z = ['),
        ("straight = true", 'straight = "maybe"'),
        ('density = "1141 kg/m^3"', 'viscosity = "1e-6 m^2/s"'),
        ('height = "2 m"\n', ""),
        ('width = "0.2 m"', "width = 0.2"),
    ],
)
def test_the_tank_schema_refuses_what_the_reader_refuses(tmp_path: Path, old: str, new: str) -> None:
    assert old in TANK
    text = TANK.replace(old, new, 1)
    assert not _fits(tomllib.loads(text), tank_schema())
    (tmp_path / "tank.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError):
        read_tank(tmp_path / "tank.toml")
