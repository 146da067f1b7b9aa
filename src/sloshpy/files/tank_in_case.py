"""Tanks of a case that name a tank file in place of slosh mass, station, frequency and, where it has it, damping."""

import hashlib
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from sloshpy.errors import InputError, OutsideValidity, Problem
from sloshpy.files.places import Path, Places
from sloshpy.files.tank_file import read_tank
from sloshpy.files.text_file import beside
from sloshpy.files.toml_text import Found
from sloshpy.files.wording import value_at, words_of
from sloshpy.tank import SloshModes, Tank, TankDamping, slosh_masses, tank_damping
from sloshpy.units import UnitError, parse

GIVEN = ("slosh_mass", "station", "frequency", "hinge_station", "pendulum_length")
_STAND_IN = {
    "slosh_mass": "1e-3 kg",
    "station": "1 m",
    "frequency": "1 rad/s",
    "damping": {"law": "constant", "ratio": 0.01},
}
_NO_DAMPING = "add damping here, or kinematic_viscosity or damping_floor to the tank file"
_ROUNDED = 5e-3  # relative: half a unit in the third digit of a radius, at most
_SAME = 1e-3  # relative: accelerations that differ by less are not worth a word


def read_tank_files(
    document: dict[str, Any], folder: FilePath, places: Places, given: dict[str, str]
) -> tuple[Found, list[str]]:
    """Put the slosh mass of every tank file into its tank, in place; return what is wrong and what to note."""
    found: Found = []
    notes: list[str] = []
    tanks = document.get("tank", [])
    for j, entry in enumerate(tanks if isinstance(tanks, list) else []):
        if not isinstance(entry, dict):
            continue
        path: Path = ("tank", j, "tank_file")
        if "tank_file" not in entry:
            continue
        file, mode = entry.pop("tank_file"), entry.pop("mode", 1)
        try:
            beside_it = [key for key in GIVEN if key in entry]
            if beside_it:
                raise _Refusal(f"stands beside {beside_it[0]}", "give the slosh mass either here or by the tank file")
            if isinstance(mode, bool) or not isinstance(mode, int) or not 1 <= mode <= 12:
                path = ("tank", j, "mode")
                raise _Refusal("must be a whole number from 1 to 12", "write mode = 2 for the second slosh mass")
            table = _beside(file, folder)
            tank = _read(table)
            modes, told = _slosh(tank, mode, _acceleration(document))
        except _Refusal as refusal:
            key, value = words_of(path, document), value_at(path, places)
            entry |= _STAND_IN | {key: entry[key] for key in _STAND_IN if key in entry}
            found.append((path, Problem(key=key, value=value, rule=refusal.rule, cure=refusal.cure)))
            continue
        except InputError as error:
            entry |= _STAND_IN | {key: entry[key] for key in ("damping",) if key in entry}
            found += [(path, problem) for problem in error.problems]
            continue
        name = entry.get("name", tank.name)
        n = mode - 1
        assert modes.station is not None
        entry["slosh_mass"] = f"{float(modes.slosh_mass[n])!r} kg"
        entry["station"] = f"{float(modes.station[n])!r} m"
        entry["frequency"] = f"{float(modes.frequency[n])!r} rad/s"
        other = _other_radius(entry, modes.section.radius)
        if other is not None:
            where_radius: Path = ("tank", j, "radius")
            key, value = words_of(where_radius, document), value_at(where_radius, places)
            found.append((where_radius, Problem(key=key, value=value, rule=other, cure="leave it out")))
        entry.setdefault("radius", f"{modes.section.radius!r} m")
        damping = tank_damping(modes, mode)
        notes += [f"{name}: {note}" for note in [*told, *modes.reasons, *_damped(entry, damping)]]
        if "damping" not in entry:
            where: Path = ("tank", j, "damping")
            rule = "is missing, and the tank file gives none" + "".join(f": {why}" for why in damping.reasons)
            found.append((where, Problem(key=words_of(where, document), value="", rule=rule, cure=_NO_DAMPING)))
            entry["damping"] = _STAND_IN["damping"]
        given[f"tank.{name}.tank_file sha256"] = hashlib.sha256(table.read_bytes()).hexdigest()
    return found, notes


def _other_radius(entry: dict[str, Any], surface: float) -> str | None:
    """Return what is wrong with a radius that is not that of the tank file's surface, in m; None where it is."""
    try:
        given = parse(entry["radius"], "m")
    except (UnitError, KeyError, AttributeError, TypeError):
        return None  # absent, or told elsewhere
    if abs(given / surface - 1.0) <= _ROUNDED:
        return None
    return f"is not {surface:.5g} m, the radius of the tank file's free surface"


def _damped(entry: dict[str, Any], damping: TankDamping) -> list[str]:
    """Put the tank file's damping into a tank that has none of its own, in place; return what to note of it."""
    if "damping" in entry:
        return ["damping as the case gives it, not by the formulas of the tank file"] if damping.known else []
    if not damping.known:
        return []
    parts: list[dict[str, Any]] = []
    if damping.constant is not None:
        parts.append({"law": "constant", "ratio": damping.constant})
    if damping.baffles is not None:
        law = damping.baffles.law
        slope, end = f"{law.slope!r} 1/m^{law.exponent:g}", f"{law.largest_amplitude!r} m"
        parts.append({"law": "power", "slope": slope, "exponent": law.exponent, "largest_amplitude": end})
    entry["damping"] = parts[0] if len(parts) == 1 else {"law": "sum", "of": parts}
    return list(damping.sources)


class _Refusal(Exception):
    """What is wrong with a tank file's place in the case: rule and cure."""

    def __init__(self, rule: str, cure: str) -> None:
        self.rule, self.cure = rule, cure
        super().__init__(rule)


def _beside(file: Any, folder: FilePath) -> FilePath:
    if not isinstance(file, str):
        raise _Refusal("must be a text", 'write tank_file = "lox.toml"')
    try:
        return beside(file, folder)
    except ValueError as error:
        raise _Refusal(str(error), "put the tank file beside the case file or below its folder") from None


def _read(table: FilePath) -> Tank:
    try:
        tank = read_tank(table)
    except InputError as error:
        first = error.problems[0]
        if first.line is None:
            raise _Refusal(first.rule, first.cure) from None
        raise
    if tank.bottom_station is None:
        raise _Refusal("names a tank file without bottom_station", 'add bottom_station = "4 m" to the tank file')
    return tank


def _slosh(tank: Tank, mode: int, acceleration: float | None) -> tuple[SloshModes, list[str]]:
    """Return the slosh masses at the case's own acceleration and what to say of the tank file's."""
    told = []
    a = tank.acceleration if acceleration is None else acceleration
    if abs(a / tank.acceleration - 1.0) > _SAME:
        told.append(
            f"slosh at the case's acceleration of {a:.5g} m/s^2, not the tank file's {tank.acceleration:.5g} m/s^2"
        )
    fields = {name: getattr(tank, name) for name in Tank.model_fields}
    try:
        modes = slosh_masses(Tank(**fields | {"acceleration": a, "modes": max(mode, tank.modes)}))
    except OutsideValidity as error:
        raise _Refusal(f"has no slosh masses: {error}", "give slosh_mass, station and frequency") from None
    if not np.isfinite(modes.spring_height[mode - 1]):
        raise _Refusal(f"has no slosh mass in mode {mode}", "leave this tank out")
    return modes, told


def _acceleration(document: dict[str, Any]) -> float | None:
    """Return (F - D)/M of the case, None where the vehicle cannot be read: that is told elsewhere."""
    vehicle = document.get("vehicle")
    if not isinstance(vehicle, dict):
        return None
    try:
        thrust, mass = parse(vehicle["thrust"], "N"), parse(vehicle["mass"], "kg")
        drag = parse(vehicle["drag"], "N") if "drag" in vehicle else 0.0
    except (UnitError, KeyError, AttributeError, TypeError):
        return None
    return (thrust - drag) / mass if mass > 0.0 and thrust > drag else None
