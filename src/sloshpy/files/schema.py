"""The JSON schemas of case and tank files, for completion and checks in an editor; plain enough for draft 4."""

from typing import Any

from sloshpy.case import Case, Criteria
from sloshpy.files.wording import OF_THE_VEHICLE
from sloshpy.tank import Tank
from sloshpy.units import decibel

Schema = dict[str, Any]

_DRAFT = "http://json-schema.org/draft-04/schema#"
_DROPPED = {"discriminator", "default", "title"}  # not of draft 4, or in SI numbers where a text is due


def case_schema() -> Schema:
    """Return the JSON schema of a case file: keys, units, meanings and ranges, without references."""
    raw = Case.model_json_schema(by_alias=True)
    schema: Schema = _plain(raw, raw.pop("$defs"))
    keys = schema["properties"]
    keys.pop("source")
    parts = {key: keys["vehicle"]["properties"].pop(field) for key, field in OF_THE_VEHICLE.items()}
    tanks = parts.pop("tank")
    keys |= parts
    keys["vehicle"]["required"] = ["mass", "inertia", "cg", "thrust"]
    keys["tank"] = tanks | {"minItems": 1}
    whole, fraction = {"required": ["frequency", "damping"]}, {"required": ["numerator", "denominator"]}
    keys["autopilot"]["properties"]["actuator"]["oneOf"] = [whole, fraction]
    _or_a_tank_file(tanks["items"])
    for key, default in _criteria_defaults().items():
        keys["criteria"]["properties"][key]["default"] = default
    laws = tanks["items"]["properties"]["damping"]["oneOf"]
    for law in [*laws, *_of_sum(laws)]:
        _as_in_a_file(law)
    order = ["name", "vehicle", "tank", *parts, "autopilot", "criteria"]
    return {
        "$schema": _DRAFT,
        "title": "slosh case",
        "description": "A launch vehicle with its slosh masses, its autopilot and the criteria for accepting them.",
        "type": "object",
        "properties": {key: keys[key] for key in order},
        "required": ["name", "vehicle", "tank", "autopilot"],
        "additionalProperties": False,
    }


def tank_schema() -> Schema:
    """Return the JSON schema of a tank file: keys, units, meanings and ranges, without references."""
    raw = Tank.model_json_schema()
    schema: Schema = _plain(raw, raw.pop("$defs"))
    keys = schema["properties"]
    level = 'depth above the lowest point, "6.2 m", or part of the volume, "62 %"; what leaves no surface is refused'
    keys["fill"] = {"type": "string", "description": level}
    for shape in keys["shape"]["oneOf"]:
        shape["required"] = ["kind", *shape["required"]]
        if "z" in shape["properties"]:
            _or_points_in_a_file(shape)
    return {
        "$schema": _DRAFT,
        "title": "slosh tank",
        "description": "A tank of revolution with its liquid, fill and axial acceleration.",
        "type": "object",
        "properties": keys,
        "required": schema["required"],
        "additionalProperties": False,
    }


def _or_points_in_a_file(contour: Schema) -> None:
    """Let a contour's points stand in a file of their own, in place."""
    contour["required"] = ["kind"]
    contour["oneOf"] = [{"required": ["z", "r"]}, {"required": ["file"]}]
    contour["properties"]["file"] = {
        "type": "string",
        "description": "CSV file beside the tank file, in place of z, r, z_inner and r_inner; header: z [m], r [m], "
        "and z_inner [m], r_inner [m] for an inner wall",
    }


def _plain(node: Any, definitions: Schema, named: bool = False) -> Any:
    """Return a schema with every reference written out; `named`: this table's keys are names of fields."""
    if isinstance(node, list):
        return [_plain(one, definitions) for one in node]
    if not isinstance(node, dict):
        return node
    if "$ref" in node:
        target = definitions[node["$ref"].removeprefix("#/$defs/")]
        node = target | {key: value for key, value in node.items() if key != "$ref"}
    if "const" in node:
        node = {key: value for key, value in node.items() if key != "const"} | {"enum": [node["const"]]}
    choices = [one for one in node.get("anyOf", []) if one != {"type": "null"}]
    if "anyOf" in node and len(choices) == 1:  # optional: a TOML file has no null
        node = {key: value for key, value in node.items() if key != "anyOf"} | choices[0]
        return _plain(node, definitions)
    return {
        key: _plain(value, definitions, named=key == "properties")
        for key, value in node.items()
        if named or key not in _DROPPED
    }


def _of_sum(laws: list[Schema]) -> list[Schema]:
    return [law for one in laws if "of" in one["properties"] for law in one["properties"]["of"]["items"]["oneOf"]]


def _as_in_a_file(law: Schema) -> None:
    """Change, in place, what a law's file form has and its noun has not: units beside the exponent, a table's file."""
    keys = law["properties"]
    law["required"] = sorted({*law.get("required", []), "law"})
    if "slope" in keys:
        meaning = "damping ratio at an amplitude of 1 m [1/m^exponent], must be > 0"
        keys["slope"] = {"type": "string", "description": f'{meaning}. Write "0.1 1/m" (exponent 1) or "0.1 1/m^0.5".'}
    if "amplitude" in keys:
        law["required"] = ["law"]
        law["oneOf"] = [{"required": ["amplitude", "ratio"]}, {"required": ["file"]}]
        keys["file"] = {
            "type": "string",
            "description": "CSV file beside the case file, in place of amplitude and ratio; "
            "header: amplitude [m], ratio [%]",
        }


def _or_a_tank_file(tank: Schema) -> None:
    """Let a tank be a spring-mass, a pendulum, or name a tank file, in place."""
    spring, pendulum = ["slosh_mass", "station", "frequency"], ["slosh_mass", "hinge_station", "pendulum_length"]
    tank["required"] = [key for key in tank["required"] if key not in {*spring, "damping"}]
    tank["oneOf"] = [{"required": keys} for keys in (spring, pendulum, ["tank_file"])]
    tank["anyOf"] = [{"required": [key]} for key in ("damping", "tank_file")]
    tank["properties"]["tank_file"] = {
        "type": "string",
        "description": "tank file beside the case file, in place of slosh_mass, station and frequency, and of damping "
        "where it gives viscosity, ring baffles or a floor",
    }
    tank["properties"]["mode"] = {"type": "number", "description": "which slosh mass of the tank file; default 1"}


def _criteria_defaults() -> Schema:
    """Return the defaults of the criteria as they are written in a file."""
    criteria = Criteria()
    return {
        "gain_margin": f"{float(decibel(criteria.gain_margin)):.6g} dB",
        "phase_margin": f"{criteria.phase_margin:.9g} rad",
        "disc_margin": criteria.disc_margin,
        "limit_cycle_disc_margin": criteria.limit_cycle_disc_margin,
        "tvc_amplitude": f"{criteria.tvc_amplitude:.9g} rad",
    }
