"""What pydantic says of a document, in the words of the one error form: key, value, rule and cure."""

import difflib
import json
import re
from typing import Any

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from sloshpy.autopilot import Actuator, Autopilot, DigitalFilter, Filter
from sloshpy.case import Case, Criteria
from sloshpy.damping import ConstantDamping, PowerDamping, SumDamping, TableDamping
from sloshpy.errors import Problem
from sloshpy.files.places import Path, Places
from sloshpy.units import Quantity, example
from sloshpy.vehicle import Aerodynamics, Engine, FlexibleMode, ModeShape, ModeSlope, SloshMass, Vehicle
from sloshpy.vehicle.slosh_mass import NAME

LAWS: dict[str, type[BaseModel]] = {
    "constant": ConstantDamping,
    "power": PowerDamping,
    "table": TableDamping,
    "sum": SumDamping,
}
_LIST_OF_LAWS = '"constant", "power", "table" or "sum"'
_NOUNS: dict[Path, type[BaseModel]] = {
    (): Case,
    ("vehicle",): Vehicle,
    ("tank",): SloshMass,
    ("autopilot",): Autopilot,
    ("autopilot", "filter"): Filter,
    ("autopilot", "digital_filter"): DigitalFilter,
    ("autopilot", "actuator"): Actuator,
    ("criteria",): Criteria,
    ("flexible_mode",): FlexibleMode,
    ("flexible_mode", "gimbal"): ModeShape,
    ("flexible_mode", "gyro"): ModeSlope,
    ("flexible_mode", "rate_gyro"): ModeSlope,
    ("flexible_mode", "accelerometer"): ModeShape,
    ("engine",): Engine,
    ("aerodynamics",): Aerodynamics,
}
# tables of their own in a file that are fields of the vehicle
OF_THE_VEHICLE = {
    "tank": "tanks",
    "flexible_mode": "flexible_modes",
    "engine": "engine",
    "aerodynamics": "aerodynamics",
}
_NOT_IN_A_FILE: dict[Path, set[str]] = {(): {"source"}, ("vehicle",): set(OF_THE_VEHICLE.values())}
_IN_A_FILE_TOO: dict[Path, set[str]] = {(): set(OF_THE_VEHICLE), ("tank",): {"tank_file", "mode"}}
_LARGEST_VALUE = 80  # characters of a value shown


def file_path(location: Path) -> Path:
    """Return the path in the file of a place in the nouns: vehicle.tanks is [[tank]], names of laws are no keys."""
    own = [key for key, field in OF_THE_VEHICLE.items() if location[:2] == ("vehicle", field)]
    if own:
        location = (own[0], *location[2:])
    path: list[str | int] = []
    for step in location:
        below_a_law = path[-1:] == ["damping"] or (path[-2:-1] == ["of"] and isinstance(path[-1], int))
        if not (below_a_law and step in LAWS):
            path.append(step)
    return tuple(path)


def words_of(path: Path, document: Any) -> str:
    """Return a path as a reader would say it: tank "LOX" frequency, autopilot filter 2 numerator."""
    words: list[str] = []
    node = document
    for step in path:
        node = step_into(node, step)
        if isinstance(step, str):
            words.append(step if re.fullmatch(r"[A-Za-z0-9_-]{1,64}", step) else json.dumps(step[:64]))
        elif words in (["tank"], ["flexible_mode"]) and _is_name(step_into(node, "name")):
            words.append(f'"{node["name"]}"')
        else:
            words.append(str(step + 1))
    return " ".join(words)


def _is_name(name: Any) -> bool:
    return isinstance(name, str) and re.match(NAME, name) is not None and "\n" not in name


def value_at(path: Path, places: Places) -> str:
    """Return a value as written in the file, on one line and cut where it is long."""
    place = places.at.get(path)
    text = " ".join(place.text.split()) if place else ""
    return text if len(text) <= _LARGEST_VALUE else text[: _LARGEST_VALUE - 3] + "..."


def noun_at(path: Path, document: Any) -> type[BaseModel] | None:
    """Return the class whose fields are the keys of the table at a path."""
    if "damping" in path and path[0] == "tank":
        law = _at(document, path)
        return LAWS.get(law.get("law", "")) if isinstance(law, dict) and isinstance(law.get("law"), str) else None
    words = tuple(step for step in path if isinstance(step, str))
    return ModeShape if words[:2] == ("flexible_mode", "tank") and len(words) == 3 else _NOUNS.get(words)


def keys_at(path: Path, document: Any) -> list[str]:
    """Return the keys that the table at a path may have in a file."""
    noun = noun_at(path, document)
    if noun is None:
        return ["law"] if "damping" in path else []
    names = {field.alias or name for name, field in noun.model_fields.items()}
    words = tuple(step for step in path if isinstance(step, str))
    names = (names - _NOT_IN_A_FILE.get(words, set())) | _IN_A_FILE_TOO.get(words, set())
    return sorted(names | ({"file"} if noun is TableDamping else set()))


def problem_of(error: ErrorDetails, document: Any, places: Places) -> tuple[Path, Problem] | None:
    """Return the path and the words of one error of pydantic, or None for one that only follows from another."""
    context = error.get("ctx", {})
    kind = error["type"]
    if kind == "default_factory_not_called":
        return None
    path = file_path((*error["loc"], *context.get("key", ())))
    if kind == "too_short" and _at(document, path):
        return None  # its items are wrong, not missing
    if kind.startswith("union_tag") and isinstance(_at(document, path), dict):
        path = (*path, "law")
    rule, cure = (
        (context["rule"], context["cure"]) if kind == "quantity" else _rule_and_cure(kind, path, document, error)
    )
    return path, Problem(key=words_of(path, document), value=value_at(path, places), rule=rule, cure=cure)


def _rule_and_cure(kind: str, path: Path, document: Any, error: ErrorDetails) -> tuple[str, str]:
    key = str(path[-1]) if path else ""
    context = error.get("ctx", {})
    if kind == "missing":
        return "is missing", how_to_write(path, document)
    if kind == "extra_forbidden":
        return "is an unknown key", nearest(key, keys_at(path[:-1], document))
    if kind == "union_tag_not_found":
        return "is missing", f"name the law of damping: {_LIST_OF_LAWS}"
    if kind == "union_tag_invalid":
        laws = list(LAWS) if "of" not in path else [law for law in LAWS if law != "sum"]
        return "is not a law of damping", nearest(str(context.get("tag", "")), laws)
    if kind == "string_pattern_mismatch":
        longest = 100 if path == ("name",) else 64
        return (
            f"must be 1 to {longest} letters, digits, spaces, _ . or -, the first a letter or digit",
            "rename it",
        )
    if kind == "string_type":
        return "must be a text", "write it in quotation marks"
    if kind == "too_short":
        return "must not be empty", "give at least one"
    if kind in {"model_type", "model_attributes_type", "dict_type", "dataclass_type"}:
        if key == "damping":
            return "must be a table", 'write { law = "constant", ratio = 0.01 } or another law'
        return "must be a table", "its keys are " + ", ".join(keys_at(path, document))
    if kind in {"tuple_type", "list_type"}:
        if path in {("tank",), ("flexible_mode",), ("autopilot", "filter"), ("autopilot", "digital_filter")}:
            return "must be an array of tables", f"write its header as [[{'.'.join(map(str, path))}]]"
        return "must be a list", "write it in [ ]"
    return error["msg"][:1].lower() + error["msg"][1:], "see the JSON schema of the case file"


def nearest(key: str, keys: list[str]) -> str:
    """Return the cure for an unknown name: the nearest valid one, or all of them."""
    close = difflib.get_close_matches(key.lower(), keys, n=1)
    return f'did you mean "{close[0]}"?' if close else f"the names here are {', '.join(keys)}"


def how_to_write(path: Path, document: Any) -> str:
    """Return the cure for a missing key: a line to write."""
    key = str(path[-1])
    noun = noun_at(path[:-1], document)
    if path == ("name",):
        return 'add name = "..." at the top'
    if len(path) == 1:
        return f"add [{key}] with " + ", ".join(keys_at(path, document))
    if key == "damping" and path[0] == "tank":
        return 'add damping = { law = "constant", ratio = 0.01 } or another law'
    if noun is PowerDamping and key == "slope":
        return 'add slope = "0.1 1/m"'
    if path[:1] == ("flexible_mode",) and key in {"gimbal", "gyro"}:
        shape = 'deflection = 1.0, slope = "-0.08 1/m"' if key == "gimbal" else 'slope = "0.05 1/m"'
        return f"add {key} = {{ {shape} }}"
    field = next((f for n, f in noun.model_fields.items() if (f.alias or n) == key), None) if noun else None
    quantity = next((m for m in field.metadata if isinstance(m, Quantity)), None) if field else None
    if quantity is None:
        return f'add {key} = "..."' if key == "name" else f"add {key} = [...]"
    one = example(quantity.unit).split(" or ")[0]
    return f"add {key} = [{one}, ...]" if quantity.sequence else f"add {key} = {one}"


def step_into(node: Any, step: str | int) -> Any:
    """Return what a key or an index leads to in plain values, None where it leads nowhere."""
    if isinstance(node, dict):
        return node.get(step)
    if isinstance(node, list) and isinstance(step, int) and step < len(node):
        return node[step]
    return None


def _at(node: Any, path: Path) -> Any:
    for step in path:
        node = step_into(node, step)
    return node
