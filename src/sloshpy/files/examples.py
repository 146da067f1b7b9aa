"""The shipped example cases, tanks and dispersions, copied to where the user works."""

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


def write_example(name: str, folder: str | os.PathLike[str]) -> Path:
    """Copy a shipped example case, tank or dispersion into a folder and return its path.

    Raises:
        InputError: no example of this name, no such folder, or the file is there already.
    """
    folders = dict.fromkeys(example_tank_names(), "tanks") | dict.fromkeys(example_dispersion_names(), "dispersions")
    names = [*example_names(), *folders]
    if name not in names:
        raise InputError(
            Problem(key="example", value=name, rule=f"is none of {', '.join(names)}", cure=nearest(name, names))
        )
    target = Path(folder) / f"{name}.toml"
    if not target.parent.is_dir():
        raise InputError(
            Problem(key="folder", value=str(folder), rule="does not exist", cure="make it or name another")
        )
    if target.exists():
        raise InputError(
            Problem(key="example", value=str(target), rule="is there already", cure="remove it or name another folder")
        )
    data = files("sloshpy") / "data"
    write_whole(target, ((data / folders[name] if name in folders else data) / target.name).read_bytes())
    return target
