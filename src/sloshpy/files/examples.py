"""The shipped example cases, tanks, records, flights and dispersions, copied to where the user works."""

import os
from importlib.resources import files
from pathlib import Path

from sloshpy.errors import InputError, Problem
from sloshpy.files.wording import nearest
from sloshpy.files.write import write_whole


def example_names() -> list[str]:
    """Return the names of the shipped example cases."""
    folder = files("sloshpy") / "data"
    return sorted(file.name.removesuffix(".toml") for file in folder.iterdir() if file.name.endswith(".toml"))


def example_tank_names() -> list[str]:
    """Return the names of the shipped example tanks."""
    folder = files("sloshpy") / "data" / "tanks"
    return sorted(file.name.removesuffix(".toml") for file in folder.iterdir() if file.name.endswith(".toml"))


def example_dispersion_names() -> list[str]:
    """Return the names of the shipped example dispersions."""
    folder = files("sloshpy") / "data" / "dispersions"
    return sorted(file.name.removesuffix(".toml") for file in folder.iterdir() if file.name.endswith(".toml"))


def example_record_names() -> list[str]:
    """Return the names of the shipped records of tests, which are synthetic."""
    folder = files("sloshpy") / "data" / "records"
    return sorted(file.name.removesuffix(".csv") for file in folder.iterdir() if file.name.endswith(".csv"))


def example_flight_names() -> list[str]:
    """Return the names of the shipped flights; each has a folder of its own for its tables, cases and tanks."""
    folder = files("sloshpy") / "data" / "flights"
    return sorted(file.name.removesuffix(".toml") for file in folder.iterdir() if file.name.endswith(".toml"))


def write_example(name: str, folder: str | os.PathLike[str]) -> Path:
    """Copy a shipped example case, tank, record, flight or dispersion into a folder and return its path.

    A flight brings a folder of its own name with its tables, cases and tanks.

    Raises:
        InputError: no example of this name, no such folder, or the file is there already.
    """
    tanks, records, flights = example_tank_names(), example_record_names(), example_flight_names()
    dispersions = example_dispersion_names()
    names = [*example_names(), *tanks, *records, *flights, *dispersions]
    if name not in names:
        raise InputError(
            Problem(key="example", value=name, rule=f"is none of {', '.join(names)}", cure=nearest(name, names))
        )
    target = Path(folder) / (f"{name}.csv" if name in records else f"{name}.toml")
    if not target.parent.is_dir():
        raise InputError(
            Problem(key="folder", value=str(folder), rule="does not exist", cure="make it or name another")
        )
    own = target.with_suffix("")
    for there in (target, own) if name in flights else (target,):
        if there.exists():
            raise InputError(
                Problem(
                    key="example", value=str(there), rule="is there already", cure="remove it or name another folder"
                )
            )
    data = files("sloshpy") / "data"
    places = {"tanks": tanks, "records": records, "flights": flights, "dispersions": dispersions}
    place = next((data / folder for folder, known in places.items() if name in known), data)
    if name in flights:
        own.mkdir()
        for file in sorted((place / name).iterdir(), key=lambda file: file.name):
            write_whole(own / file.name, file.read_bytes())
    write_whole(target, (place / target.name).read_bytes())
    return target
