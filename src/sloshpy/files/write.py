"""A Case back to a case file, in SI units, so that what was changed in Python can be kept, shared and read again."""

import math
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from sloshpy.autopilot import Autopilot
from sloshpy.case import Case, Criteria
from sloshpy.damping import ConstantDamping, DampingLaw, PowerDamping, SumDamping, TableDamping
from sloshpy.errors import InputError, Problem
from sloshpy.files.tables import as_written
from sloshpy.units import Quantity, Real, decibel, parse
from sloshpy.vehicle import FlexibleMode, SloshMass, Vehicle


def write_case(case: Case, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Write a case as a case file that reads back to an equal case.

    Every number is written with all its digits in SI units, gains in dB; a damping table is written out in full.
    The source of the case is not written: the new file is its own source. The file appears whole or not at all.

    Args:
        case: a single case; a batch (fields with leading axes) has no file.
        path: the file to write, beside which a file of another name stands for a moment.
        overwrite: replace a file that is there.

    Returns:
        The path of the file.

    Raises:
        InputError: the file is there already, cannot be written, or the case is a batch.
    """
    path = Path(path)
    text = case_text(case)
    if path.exists() and not overwrite:
        raise InputError(
            Problem(
                key="case file",
                value=str(path),
                rule="is there already",
                cure="name another file or say overwrite=True",
            )
        )
    write_whole(path, text.encode())
    return path


def write_whole(path: Path, data: bytes) -> None:
    """Write a file so that it appears whole or not at all."""
    new = None
    try:
        handle, new = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        os.chmod(new, 0o644)
        os.replace(new, path)
    except OSError as error:
        if new is not None:
            Path(new).unlink(missing_ok=True)
        raise InputError(
            Problem(key="file", value=str(path), rule=f"cannot be written ({error.strerror})", cure="check the folder")
        ) from None


def case_text(case: Case) -> str:
    """Return the text of a case file."""
    lines = [f'name = "{case.name}"', "", *_table("[vehicle]", case.vehicle, Vehicle)]
    for tank in case.vehicle.tanks:
        lines += ["[[tank]]", f'name = "{tank.name}"', *_table("", _as_given(tank), SloshMass)[:-1]]
        lines += [f"damping = {_law(tank.damping)}", ""]
    for mode in case.vehicle.flexible_modes:
        lines += ["[[flexible_mode]]", f'name = "{mode.name}"', *_table("", mode, FlexibleMode)[:-1]]
        shapes = {key: getattr(mode, key) for key in ("gimbal", "gyro", "rate_gyro", "accelerometer")}
        lines += [f"{key} = {_inline(shape)}" for key, shape in shapes.items() if shape is not None]
        lines += [f'tank."{name}" = {_inline(shape)}' for name, shape in mode.tank.items()] + [""]
    for key, part in (("engine", case.vehicle.engine), ("aerodynamics", case.vehicle.aerodynamics)):
        if part is not None:
            lines += _table(f"[{key}]", part, type(part))
    autopilot = case.autopilot
    lines += _table("[autopilot]", autopilot, Autopilot)
    if autopilot.actuator is not None:
        lines += _table("[autopilot.actuator]", autopilot.actuator, type(autopilot.actuator))[:-1]
        fraction = {"numerator": autopilot.actuator.numerator, "denominator": autopilot.actuator.denominator}
        lines += [f"{key} = {_list(x)}" for key, x in fraction.items() if x is not None] + [""]
    filters = [("filter", f) for f in autopilot.filter] + [("digital_filter", f) for f in autopilot.digital_filter]
    for key, filter_ in filters:
        lines += [f"[[autopilot.{key}]]", f"numerator = {_list(filter_.numerator)}"]
        lines += [f"denominator = {_list(filter_.denominator)}", ""]
    lines += _table("[criteria]", case.criteria, Criteria)
    return "\n".join(lines).rstrip() + "\n"


def _table(header: str, noun: BaseModel, kind: type[BaseModel]) -> list[str]:
    """Return the lines of a noun's quantities; its other fields are written by hand."""
    lines = [header] if header else []
    for name, field in kind.model_fields.items():
        value = getattr(noun, name)
        quantity = next((m for m in _metadata(field.metadata, field.annotation) if isinstance(m, Quantity)), None)
        if quantity is not None and value is not None:
            lines.append(f"{name} = {_number(value, quantity.unit, name)}")
    return [*lines, ""]


def _as_given(tank: SloshMass) -> SloshMass:
    """Return a pendulum without the spring-mass that follows from it: a file holds one form."""
    if tank.pendulum_length is None:
        return tank
    return tank.model_copy(update={"station": None, "frequency": None})


def _inline(noun: BaseModel) -> str:
    return "{ " + ", ".join(_table("", noun, type(noun))[:-1]) + " }"


def _metadata(metadata: list[object], annotation: object) -> list[object]:
    """Return the metadata of a field, also of one that may be None."""
    return metadata + [m for choice in getattr(annotation, "__args__", ()) for m in getattr(choice, "__metadata__", ())]


def _number(value: Any, unit: str, name: str) -> str:
    if np.ndim(value) > 0:
        raise InputError(
            Problem(
                key=name,
                value=f"an array of shape {np.shape(value)}",
                rule="has no place in a case file",
                cure="write one case of the batch",
            )
        )
    if unit == "1":
        return _digits(value)
    return f'"{_gain(float(value))}"' if unit == "dB" else f'"{_digits(value)} {unit}"'


def _digits(value: float) -> str:
    """Return the shortest digits that read back to the same number: 16000, 0.14."""
    return repr(float(value)).removesuffix(".0")


def _gain(ratio: float) -> str:
    """Return an amplitude ratio in dB, in the shortest text that reads back to it (or to its nearest neighbour)."""
    gain_db = float(decibel(ratio))
    tries = [f"{gain_db:.{digits}g} dB" for digits in range(1, 18)]
    tries += [f"{math.nextafter(gain_db, way)!r} dB" for way in (math.inf, -math.inf)]
    return min(tries, key=lambda text: abs(parse(text, "dB") - ratio))


def damping_line(law: DampingLaw) -> str:
    """Return the line of a case file that gives a tank this damping."""
    return f"damping = {_law(law)}"


def _law(law: DampingLaw) -> str:
    match law:
        case ConstantDamping():
            return f'{{ law = "constant", ratio = {_digits(law.constant_ratio)} }}'
        case PowerDamping(exponent=p):
            unit = "1/m" if p == 1.0 else f"1/m^{p:g}"
            end = "" if law.holds_to is None else f', largest_amplitude = "{_digits(law.holds_to)} m"'
            return f'{{ law = "power", slope = "{_digits(law.slope)} {unit}", exponent = {_digits(p)}{end} }}'
        case TableDamping():
            amplitude = ", ".join(f'"{text}"' for text in as_written(law.tested_amplitude))
            return f'{{ law = "table", amplitude = [{amplitude}], ratio = {_list(law.tested_ratio.tolist())} }}'
        case SumDamping():
            return f'{{ law = "sum", of = [{", ".join(_law(part) for part in law.of)}] }}'
    raise TypeError(f"{type(law).__name__} has no form in a case file")


def _list(values: Sequence[Real]) -> str:
    return "[" + ", ".join(_digits(float(x)) for x in values) + "]"
