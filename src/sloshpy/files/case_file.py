"""A case file: TOML text in, a Case out, or everything that is wrong with it, each with its line."""

import hashlib
import os
import tomllib
from pathlib import Path as FilePath
from typing import Any

from pydantic import ValidationError

from sloshpy.case import Case, Source
from sloshpy.errors import InputError, Problem
from sloshpy.files.places import Path, Places, find_places
from sloshpy.files.tables import as_written, read_damping_table
from sloshpy.files.tank_in_case import read_tank_files
from sloshpy.files.text_file import beside, read_text
from sloshpy.files.toml_text import Found, in_file_order, once, parse_toml
from sloshpy.files.wording import OF_THE_VEHICLE, keys_at, nearest, problem_of, step_into, value_at, words_of


def read_case(path: str | os.PathLike[str]) -> Case:
    """Read a case file and return its vehicle, autopilot and criteria.

    Args:
        path: a TOML file; quantities are texts with their unit.

    Returns:
        The case; its source holds the file's name, the hash of its bytes and the values as written.

    Raises:
        InputError: with every fault of the file, in file order.
    """
    raw, text = read_text(path, "case file")
    file = os.fspath(path)
    places = find_places(text)
    document = parse_toml(text, file, places)
    given = _given(document, places)
    found = _unsupported(document, places)
    of_tanks, notes = read_tank_files(document, FilePath(file).parent, places, given)
    found += of_tanks + _read_tables(document, FilePath(file).parent, places, given)
    case, faults = _validate(document, places)
    found = once(found + faults)
    if found or case is None:
        raise InputError(*in_file_order(found, file, places))
    digest = hashlib.sha256(raw).hexdigest()
    source = Source(file=FilePath(file).name, sha256=digest, given=given, notes=tuple(notes))
    return case.model_copy(update={"source": source})


def _unsupported(document: dict[str, Any], places: Places) -> Found:
    """Take what this version does not model out of the document and say so."""
    found: Found = []

    def refuse(path: Path, rule: str, cure: str) -> None:
        found.append((path, Problem(key=words_of(path, document), value=value_at(path, places), rule=rule, cure=cure)))

    if "source" in document:
        refuse(("source",), "is an unknown key", nearest("source", keys_at((), {})))
        del document["source"]
    vehicle = document.get("vehicle")
    for key, field in OF_THE_VEHICLE.items():
        if isinstance(vehicle, dict) and field in vehicle:
            header = f"[[{key}]]" if key != field else f"[{key}]"
            refuse(("vehicle", field), "is an unknown key", f"write it under its own header {header}")
            del vehicle[field]
    tanks = document.get("tank", [])
    if tanks == []:
        refuse(("tank",), "no slosh mass to assess", "add a tank under the header [[tank]]")
        document.pop("tank", None)
    return found


def _read_tables(document: dict[str, Any], folder: FilePath, places: Places, given: dict[str, str]) -> Found:
    """Put the columns of every damping table's file into its law, in place; return what is wrong with them."""
    found: Found = []
    tanks = document.get("tank", [])
    for j, tank in enumerate(tanks if isinstance(tanks, list) else []):
        law = tank.get("damping") if isinstance(tank, dict) else None
        several = law.get("of") if isinstance(law, dict) and law.get("law") == "sum" else None
        laws: list[tuple[Path, Any]] = [(("tank", j, "damping"), law)]
        laws += [
            (("tank", j, "damping", "of", k), part)
            for k, part in enumerate(several if isinstance(several, list) else [])
        ]
        for path, one in laws:
            if isinstance(one, dict) and one.get("law") == "table" and "file" in one:
                found += _read_table((*path, "file"), one, folder, document, places, given)
    return found


def _read_table(
    path: Path, law: dict[str, Any], folder: FilePath, document: dict[str, Any], places: Places, given: dict[str, str]
) -> Found:
    file = law.pop("file")

    def refuse(rule: str, cure: str) -> Found:
        # a stand-in that is valid, so that only this fault of the law is told
        law["amplitude"], law["ratio"] = ["0 m", "1 m"], [0.0, 0.0]
        return [(path, Problem(key=words_of(path, document), value=value_at(path, places), rule=rule, cure=cure))]

    if "amplitude" in law or "ratio" in law:
        return refuse("stands beside amplitude or ratio", "give the table either here or in the file")
    if not isinstance(file, str):
        return refuse("must be a text", 'write file = "decay.csv"')
    try:
        table = beside(file, folder)
    except ValueError as error:
        return refuse(str(error), "put the table beside the case file or below its folder")
    try:
        amplitude, ratio = read_damping_table(table)
    except InputError as error:
        first = error.problems[0]
        here = refuse(first.rule, first.cure)
        return here if first.line is None else [(path, problem) for problem in error.problems]
    law["amplitude"], law["ratio"] = as_written(amplitude), ratio.tolist()
    given[_given_key(path, document) + " sha256"] = hashlib.sha256(table.read_bytes()).hexdigest()
    return []


def _validate(document: dict[str, Any], places: Places) -> tuple[Case | None, Found]:
    """Return the case, or what pydantic says in our words."""
    nouns = dict(document)
    vehicle = nouns.get("vehicle")
    parts = {field: nouns.pop(key) for key, field in OF_THE_VEHICLE.items() if key in nouns}
    if parts:  # they are read also where the rest of the vehicle cannot be
        nouns["vehicle"] = (vehicle if isinstance(vehicle, dict) else {}) | parts
    try:
        return Case.model_validate(nouns, context={"file": True}), []
    except ValidationError as error:
        faults = [problem_of(one, document, places) for one in error.errors(include_url=False)]
    found: Found = []
    for fault in faults:
        if fault is None:
            continue
        path, problem = fault
        if path[:1] == ("vehicle",) and not isinstance(vehicle, dict):
            rule = "is missing" if vehicle is None else "must be a table"
            cure = "add [vehicle] with " + ", ".join(keys_at(("vehicle",), document))
            path = ("vehicle",)
            problem = Problem(key="vehicle", value=value_at(path, places), rule=rule, cure=cure)
        found.append((path, _other_tank(path, problem, document, places)))
    return None, found


def _other_tank(path: Path, problem: Problem, document: dict[str, Any], places: Places) -> Problem:
    """Return the problem of a tank's name that is taken, with the line of the tank that has it."""
    if not (len(path) == 3 and path[2] == "name" and problem.rule.startswith("is the name of tank")):
        return problem
    names = [str(tank.get("name", "")).casefold() for tank in document["tank"]]
    first = places.at[("tank", names.index(names[int(path[1])]), "name")]
    return Problem(
        key=problem.key,
        value=problem.value,
        rule=f"is the name of the tank in line {first.line} too",
        cure="rename one",
    )


def _given(document: dict[str, Any], places: Places) -> dict[str, str]:
    """Return every value as written, by dotted key: {"vehicle.mass": "16000 kg", "tank.LOX.frequency": "2 rad/s"}."""
    given: dict[str, str] = {}
    lists: set[Path] = set()
    tables = {path[:end] for path in places.at for end in range(len(path)) if isinstance(path[end], str)}
    for path, place in places.at.items():
        if any(path[:end] in lists for end in range(len(path))) or not place.text:
            continue
        if path in tables and not place.text.startswith("["):
            continue  # an inline table: its keys follow
        if place.text.startswith("["):
            value = tomllib.loads(f"value = {place.text}")["value"]
            if value and all(isinstance(part, dict) for part in value):
                continue  # likewise a list of them
            lists.add(path)
        given[_given_key(path, document)] = _unquoted(place.text)
    return given


def _given_key(path: Path, document: Any) -> str:
    words: list[str] = []
    node = document
    for step in path:
        node = step_into(node, step)
        name = step_into(node, "name") if words in (["tank"], ["flexible_mode"]) else None
        words.append(step if isinstance(step, str) else str(name or step + 1))
    return ".".join(words)


def _unquoted(text: str) -> str:
    value = tomllib.loads(f"value = {text}")["value"]
    return value if isinstance(value, str) else " ".join(text.split())
