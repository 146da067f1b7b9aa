"""Options of the commands: their kinds, their texts read, and where figures go."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from sloshpy.case import Case
from sloshpy.dynamics import open_loop
from sloshpy.errors import InputError, Problem
from sloshpy.limit_cycle import liveliest_tank
from sloshpy.units import Array, UnitError, parse

CaseFile = Annotated[Path, Parameter(help="case file (TOML)")]
Output = Annotated[
    Path | None,
    Parameter(name=["-o", "--output"], help="figure file, format by suffix; default: a PNG beside the case"),
]
Damping = Annotated[
    str | None, Parameter(help="slosh damping: 4.8% for every tank, or LOX=4.8%,LH2=1%; default: by each tank's law")
]
Dampings = Annotated[str | None, Parameter(help="dampings to show, as in 1%,3%,4.8%; default: four telling ones")]
Amplitude = Annotated[
    str | None, Parameter(help="slosh amplitude at which each law is read: 0.2m, or LOX=0.2m,LH2=0.1m")
]
Tank = Annotated[str | None, Parameter(help="name of the tank; default: the first")]
LivelyTank = Annotated[
    str | None, Parameter(help="name of the tank; default: whose slosh grows fastest at small amplitude")
]


def figure_path(case: Path, output: Path | None, name: str) -> Path:
    """Return where a figure goes, settled before any work: beside the case as a PNG, or as asked."""
    path = case.with_name(f"{case.stem}-{name}.png") if output is None else output
    writable(case, path, {".png", ".svg", ".pdf"})
    return path


def writable(case: Path, path: Path, suffixes: set[str]) -> None:
    """Refuse a file that cannot be written, or must not be: of another format, in no folder, the case itself."""
    if path.is_dir():
        raise refused("output", path, "is a folder", "name a file in it")
    if path.suffix.lower() not in suffixes:
        raise refused("output", path, f"must end in {', '.join(sorted(suffixes))}", "name a file of that format")
    if not path.parent.is_dir():
        raise refused("output", path, "has no folder to stand in", "make the folder first")
    if path.exists() and path.samefile(case):
        raise refused("output", path, "is the case file itself", "name another file")


def refused(key: str, value: object, rule: str, cure: str) -> InputError:
    """Return the error of one option in the one form."""
    return InputError(Problem(key=key, value=str(value), rule=rule, cure=cure))


def save(axes: Any, path: Path) -> int:
    """Write a figure, name it, and return exit status 0."""
    from sloshpy import plots  # matplotlib: only when something is drawn

    plots.save_figure(axes, path)
    print(f"figure: {path}")
    return 0


def drawn(plot: str, result: Any, path: Path | None, quiet: bool) -> int:
    """Draw a result with the plot of that name and save it, where a figure is wanted; return exit status 0."""
    if path is None:
        return 0
    from sloshpy import plots  # matplotlib: only when something is drawn

    plots.save_figure(getattr(plots, plot)(result), path)
    if not quiet:
        print(f"figure: {path}")
    return 0


def read_at(case: Case, damping: str | None, amplitude: str | None) -> dict[str, Array]:
    """Return what the loop is read at, from the options."""
    if damping is not None and amplitude is not None:
        raise refused("--damping and --amplitude", "", "exclude each other", "give one of them")
    if damping is not None:
        return {"damping": damping_of(case, damping)}
    if amplitude is not None:
        texts = named(case, "--amplitude", amplitude)
        least = [tank.damping.smallest_amplitude for tank in case.vehicle.tanks]
        return {
            "amplitude": np.array(
                [quantity("--amplitude", t, "m") if t else a for t, a in zip(texts, least, strict=True)]
            )
        }
    return {}


def damping_of(case: Case, text: str) -> Array:
    """Return the damping ratio of each tank; one that is not named keeps its small-amplitude damping."""

    given = named(case, "--damping", text)
    return np.array(
        [ratio_of("--damping", t) if t else xi for t, xi in zip(given, open_loop(case).damping, strict=True)]
    )


def dampings_of(text: str | None) -> Array | None:
    """Return the dampings of a sweep, None for the default ones."""
    return None if text is None else np.array([ratio_of("--damping", part) for part in text.split(",")])


def named(case: Case, option: str, text: str) -> list[str]:
    """Return the text meant for each tank: one for all, or NAME=text,NAME=text; "" where a tank is not named."""
    names = [tank.name for tank in case.vehicle.tanks]
    if not text.strip():
        raise refused(option, text, "is empty", "leave the option out, or give it a value")
    if "=" not in text:
        return [text] * len(names)
    given: dict[str, str] = {}
    for part in text.split(","):
        name, _, value = (x.strip() for x in part.partition("="))
        if name not in names or not value or name in given:
            rule = "names no tank" if name not in names else "has no value" if not value else "names a tank twice"
            raise refused(option, part, rule, f"write {names[0]}=VALUE; tanks: {', '.join(names)}")
        given[name] = value
    return [given.get(name, "") for name in names]


def tank_of(case: Case, name: str | None) -> int:
    """Return the number of a tank by its name, the first without one."""
    names = [tank.name for tank in case.vehicle.tanks]
    if name is not None and name not in names:
        raise refused("--tank", name, "is no tank of the case", f"one of {', '.join(names)}")
    return 0 if name is None else names.index(name)


def lively_tank_of(case: Case, name: str | None) -> int:
    """Return the number of a tank by its name, without one that of the liveliest slosh mode."""
    return liveliest_tank(case) if name is None and case.vehicle.tanks else tank_of(case, name)


def ratio_of(option: str, text: str) -> float:
    """Return an option's damping ratio."""
    value = quantity(option, text, "1")
    if not 0.0 <= value <= 1.0:
        raise refused(option, text, "must be between 0 and 1", 'a percentage is "4.8%"')
    return value


def quantity(option: str, text: str, unit: str) -> float:
    """Return an option's quantity in SI; none of them may be negative (a gain in dB is a ratio here)."""
    try:
        value = parse(text, unit)
    except UnitError as error:
        raise refused(option, text, error.rule, error.cure) from None
    if value < 0.0:
        raise refused(option, text, "must be >= 0", "drop the sign")
    return value
