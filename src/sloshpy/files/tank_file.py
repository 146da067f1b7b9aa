"""A tank file: TOML text in, a Tank out, or everything that is wrong with it, each with its line."""

import os
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from sloshpy.errors import InputError, Problem
from sloshpy.files.places import Path, Places, find_places
from sloshpy.files.tables import Kind, as_written, read_columns
from sloshpy.files.text_file import beside, read_text
from sloshpy.files.toml_text import Found, in_file_order, once, parse_toml
from sloshpy.files.wording import nearest, step_into, value_at, words_of
from sloshpy.tank import Annulus, Capsule, Cone, Contour, Cylinder, Liquid, Ring, Sphere, Spheroid, Tank, Toroid
from sloshpy.units import Quantity, example

CONTOUR = Kind(
    what="contour",
    columns={"z": "m", "r": "m", "z_inner": "m", "r_inner": "m"},
    cure='write the header "z [m], r [m]", and z_inner [m], r_inner [m] for an inner wall',
    optional=frozenset({"z_inner", "r_inner"}),
)
SHAPES: dict[str, type[BaseModel]] = {
    "cylinder": Cylinder,
    "capsule": Capsule,
    "sphere": Sphere,
    "spheroid": Spheroid,
    "cone": Cone,
    "annulus": Annulus,
    "toroid": Toroid,
    "contour": Contour,
}
_NOUNS: dict[Path, type[BaseModel]] = {(): Tank, ("liquid",): Liquid, ("baffle",): Ring}
_HOW: dict[Path, str] = {
    ("name",): 'add name = "..." at the top',
    ("fill",): 'add fill = "6.2 m", a depth, or fill = "62 %" of the volume',
    ("liquid",): 'add [liquid] with density = "1141 kg/m^3"',
    ("shape",): f"add [shape] with kind = one of {', '.join(SHAPES)}",
    ("shape", "kind"): f"name one of {', '.join(SHAPES)}",
}


def read_tank(path: str | os.PathLike[str]) -> Tank:
    """Read a tank file and return the tank: shape, fill, acceleration and liquid.

    Args:
        path: a TOML file; quantities are texts with their unit. A contour lies in a CSV file beside it, with the
            columns z and r and, for an inner wall, z_inner and r_inner, units in the header.

    Raises:
        InputError: with every fault of the file and of its contour, in file order.
    """
    _, text = read_text(path, "tank file")
    file = os.fspath(path)
    places = find_places(text)
    document = parse_toml(text, file, places)
    rows, found = _read_contour(document, FilePath(file).parent, places)
    tank, faults = _validate(document, places, rows)
    found = once(found + faults)
    if found or tank is None:
        raise InputError(*in_file_order(found, file, places))
    return tank


class _Rows:
    """The lines of a contour's file, for what is wrong with its points."""

    def __init__(self, file: str, lines: dict[str, list[int]]) -> None:
        self.file, self.lines = file, lines


def _read_contour(document: dict[str, Any], folder: FilePath, places: Places) -> tuple[_Rows | None, Found]:
    """Put the points of a contour's file into the shape, in place; return where they stand and what is wrong."""
    shape = document.get("shape")
    if not isinstance(shape, dict) or shape.get("kind") != "contour" or "file" not in shape:
        return None, []
    path: Path = ("shape", "file")
    file = shape.pop("file")

    def refuse(rule: str, cure: str) -> tuple[None, Found]:
        shape.update(z=["0 m", "1e3 m"], r=["0 m", "1 m"])  # valid stand-ins, so that only this fault is told
        return None, [(path, Problem(key=words_of(path, document), value=value_at(path, places), rule=rule, cure=cure))]

    if {"z", "r", "z_inner", "r_inner"} & set(shape):
        return refuse("stands beside z or r", "give the points either here or in the file")
    if not isinstance(file, str):
        return refuse("must be a text", 'write file = "contour.csv"')
    try:
        table = beside(file, folder)
    except ValueError as error:
        return refuse(str(error).replace("case file", "tank file"), "put the contour beside the tank file")
    try:
        columns, rows, numbers = read_columns(table, CONTOUR)
    except InputError as error:
        first = error.problems[0]
        _, here = refuse(first.rule, first.cure)
        return None, here if first.line is None else [(path, problem) for problem in error.problems]
    lines = {column.name: [row.line for row in rows[1:]] for column in columns}
    shape.update({name: as_written(np.array(values)) for name, values in numbers.items()})
    return _Rows(os.fspath(table), lines), []


def _validate(document: dict[str, Any], places: Places, rows: _Rows | None) -> tuple[Tank | None, Found]:
    try:
        return Tank.model_validate(document, context={"file": True}), []
    except ValidationError as error:
        faults = error.errors(include_url=False)
    found: Found = []
    for fault in faults:
        path, problem = _problem_of(fault, document, places)
        in_table = path[0:1] == ("shape",) and rows is not None and len(path) > 1 and path[1] in rows.lines
        if in_table and rows is not None:
            lines = rows.lines[str(path[1])]
            line = lines[min(int(path[2]), len(lines) - 1)] if len(path) > 2 else lines[-1]
            name = f"column {path[1]}"
            problem = Problem(key=name, value=problem.value, rule=problem.rule, cure=problem.cure).at(rows.file, line)
            path = ("shape", "file")
        found.append((path, problem))
    return None, found


def _problem_of(error: ErrorDetails, document: Any, places: Places) -> tuple[Path, Problem]:
    """Return the path and the words of one error of pydantic."""
    context = error.get("ctx", {})
    path: Path = (*error["loc"], *context.get("key", ()))
    if path[:1] == ("fill",):
        path = ("fill",)  # one text in a file
    if path[:1] == ("shape",) and len(path) > 1 and path[1] in SHAPES:
        path = ("shape", *path[2:])  # the kind is no key
    kind = error["type"]
    if kind.startswith("union_tag"):
        path = (*path, "kind")
    if kind == "quantity":
        rule, cure = context["rule"], context["cure"]
    else:
        rule, cure = _rule_and_cure(kind, path, document, error)
    return path, Problem(key=words_of(path, document), value=value_at(path, places), rule=rule, cure=cure)


def _rule_and_cure(kind: str, path: Path, document: Any, error: ErrorDetails) -> tuple[str, str]:
    key = str(path[-1]) if path else ""
    keys = sorted(_fields(path[:-1], document))
    if kind == "missing":
        return "is missing", _HOW.get(path) or _how_to_write(path, document)
    if kind == "extra_forbidden":
        return "is an unknown key", nearest(key, keys)
    if kind == "union_tag_not_found":
        if not isinstance(document.get("shape"), dict):
            return "must be a table", _HOW["shape",]
        return "is missing", _HOW["shape", "kind"]
    if kind == "union_tag_invalid":
        return "is no shape", nearest(str(error.get("ctx", {}).get("tag", "")), list(SHAPES))
    if path == ("modes",):
        return "must be a whole number from 1 to 12", "write modes = 2"
    if kind == "string_pattern_mismatch":
        if key == "kind":
            return "is no baffle", 'write kind = "ring"'
        return "must be 1 to 64 letters, digits, spaces, _ . or -, the first a letter or digit", "rename it"
    if kind == "string_type":
        return "must be a text", "write it in quotation marks"
    if kind in {"model_type", "model_attributes_type", "dict_type"}:
        return "must be a table", "its keys are " + ", ".join(sorted(_fields(path, document)))
    if kind in {"tuple_type", "list_type"}:
        return "must be an array of tables", f"write its header as [[{key}]]"
    if kind == "bool_type":
        return "must be true or false", f"write {key} = true"
    return error["msg"][:1].lower() + error["msg"][1:], "see the tank file in the README"


def _noun_at(path: Path, document: Any) -> type[BaseModel] | None:
    if path == ("shape",):
        kind = step_into(step_into(document, "shape"), "kind")
        return SHAPES.get(kind) if isinstance(kind, str) else None
    return _NOUNS.get(tuple(step for step in path if isinstance(step, str)))


def _fields(path: Path, document: Any) -> set[str]:
    noun = _noun_at(path, document)
    names = set(noun.model_fields) if noun else {"kind"}
    return names | ({"file"} if noun is Contour else set())


def _how_to_write(path: Path, document: Any) -> str:
    key = str(path[-1])
    noun = _noun_at(path[:-1], document)
    if noun is Contour:
        return 'add file = "contour.csv" with the columns z [m] and r [m]'
    quantity = next((m for m in noun.model_fields[key].metadata if isinstance(m, Quantity)), None) if noun else None
    return f"add {key} = {example(quantity.unit).split(' or ')[0] if quantity else '...'}"
