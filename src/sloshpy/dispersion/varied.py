"""A case with draws put in the place of its inputs: the number of the case is the first axis of every varied field."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import BaseModel

from sloshpy.autopilot import Actuator, Autopilot, Filter
from sloshpy.batch import case_shape
from sloshpy.case import Case
from sloshpy.dispersion.dispersion import Dispersion, Nonlinear
from sloshpy.units import Array, Quantity, Real
from sloshpy.vehicle import Aerodynamics, Engine, FlexibleMode, SloshMass, Vehicle

DAMPING = "damping"  # of a tank: its law times a factor
_PENDULUM = {"station", "frequency"}  # follow from hinge and length where a tank is a pendulum
_SPRING = {"hinge_station", "pendulum_length"}
_NOUNS: dict[str, type[BaseModel]] = {
    "vehicle": Vehicle,
    "tank": SloshMass,
    "flexible_mode": FlexibleMode,
    "engine": Engine,
    "aerodynamics": Aerodynamics,
    "autopilot": Autopilot,
}
RUN = {  # of a nonlinear campaign, not of the case
    "initial_slosh": Quantity("m", above=0.0, most=100.0),
    "gust_speed": Quantity("m/s", least=-1e3, most=1e3),
    "gust_start": Quantity("s", least=0.0, most=1e5),
    "gust_duration": Quantity("s", above=0.0, most=1e5),
}
_LAGS = {"actuator", "filter"}  # of the autopilot: such cases are asked one by one
_SCALE = Quantity("1", meaning="of every pole and zero", above=0.0)
_ALONE = {"radius"}  # carry axes, but change no answer of a campaign


@dataclass(frozen=True, kw_only=True)
class Input:
    """Where a parameter goes: the noun, which of several (None: there is one), the field, and its unit and range."""

    noun: str
    names: tuple[str, ...] | None
    field: str
    quantity: Quantity | None  # None: a tank's damping, a factor only


def find_input(case: Case, text: str) -> Input:
    """Return where an input such as "tank.LOX.frequency" stands in a case.

    Raises:
        ValueError: with the rule that the text breaks and the cure, parted by a line end.
    """
    steps = re.fullmatch(r"([a-z_]+)(?:\.(.+))?\.([a-z_]+)", text)
    if text.startswith("run."):
        field = text.removeprefix("run.")
        if field not in RUN:
            raise ValueError(f"a run has no input {field} that can vary\nit has {', '.join(RUN)}")
        return Input(noun="run", names=None, field=field, quantity=RUN[field])
    if steps is not None and steps.group(1) in _LAGS:
        return _find_lag(case, *steps.groups())
    if steps is None or steps.group(1) not in _NOUNS:
        raise ValueError(f'names no input\nwrite "vehicle.mass", "tank.LOX.frequency"; tables: {", ".join(_NOUNS)}')
    noun, which, field = steps.groups()
    several = noun in {"tank", "flexible_mode"}
    names: tuple[str, ...] | None = None
    if several:
        names = _chosen(case, noun, which)
    elif noun == "autopilot" and which is not None and which.partition(".")[0] in _LAGS:
        raise ValueError(f'has one part too many\nwrite "{text.removeprefix("autopilot.")}"')
    elif which is not None:
        raise ValueError(f'has too many parts\nwrite "{noun}.{field}"')
    elif noun in {"engine", "aerodynamics"} and getattr(case.vehicle, noun) is None:
        raise ValueError(f"the case has no [{noun}]\nadd it to the case or leave the input out")
    if noun == "tank" and field == DAMPING:
        return Input(noun=noun, names=names, field=field, quantity=None)
    quantity = _quantities(_NOUNS[noun]).get(field)
    if quantity is None:
        known = sorted({*_quantities(_NOUNS[noun]), *({DAMPING} if noun == "tank" else set())} - _ALONE)
        raise ValueError(f"{noun} has no input {field} that can vary\nit has {', '.join(known)}")
    found = Input(noun=noun, names=names, field=field, quantity=quantity)
    for tank in case.vehicle.tanks if noun == "tank" else ():
        follows = _SPRING if tank.pendulum_length is None else _PENDULUM
        if names is not None and tank.name in names and field in follows:
            other = _PENDULUM if tank.pendulum_length is None else _SPRING
            raise ValueError(f"{tank.name} is given in the other form\nvary {' or '.join(sorted(other))}")
    if any(v is None for v in nominal(case, found)):
        raise ValueError("is not given in the case\ngive it there first")
    return found


def _find_lag(case: Case, noun: str, which: str | None, field: str) -> Input:
    """Return an actuator's frequency or damping, or the frequency of filters: a factor of all their poles and zeros."""
    pilot = case.autopilot
    if noun == "filter":
        there = [str(k + 1) for k in range(len(pilot.filter))]
        if not there:
            raise ValueError("the case has no [[autopilot.filter]]\nadd one to the case or leave the input out")
        if which not in {*there, "*"}:
            raise ValueError('names no filter of the case\nwrite "filter.1.frequency", or "filter.*.frequency" for all')
        if field != "frequency":
            raise ValueError(f"a filter has no input {field} that can vary\nit has frequency")
        return Input(noun=noun, names=tuple(there) if which == "*" else (str(which),), field=field, quantity=_SCALE)
    if which is not None:
        raise ValueError(f'has too many parts\nwrite "{noun}.{field}"')
    if pilot.actuator is None:
        raise ValueError("the case has no actuator\nadd it to the case or leave the input out")
    known = ("frequency",) if pilot.actuator.frequency is None else ("frequency", "damping")
    if field not in known:
        raise ValueError(f"this actuator has no input {field} that can vary\nit has {', '.join(known)}")
    own = _SCALE if pilot.actuator.frequency is None else _ACTUATOR[field]
    return Input(noun=noun, names=None, field=field, quantity=own)


_ACTUATOR = {"frequency": Quantity("rad/s", above=0.0), "damping": Quantity("1", above=0.0, most=10.0)}


def varies_lags(dispersion: Dispersion) -> bool:
    """Whether actuator or filters vary."""
    return any(p.input.partition(".")[0] in _LAGS for p in dispersion.parameters)


def stands_in(case: Case, text: str) -> bool:
    """Return whether a case has an input: of a flight's moments, not every one has every tank."""
    try:
        find_input(case, text)
    except ValueError:
        return False
    return True


def _chosen(case: Case, noun: str, which: str | None) -> tuple[str, ...]:
    """Return the names of the tanks or modes that an input means."""
    there = [x.name for x in (case.vehicle.tanks if noun == "tank" else case.vehicle.flexible_modes)]
    if not there:
        raise ValueError(f"the case has no [[{noun}]]\nadd one to the case or leave the input out")
    if which == "*":
        return tuple(there)
    if which not in there:
        raise ValueError(f'names no {noun} of the case\nwrite "{noun}.{there[0]}...." or "{noun}.*...."')
    return (which,)


def _quantities(noun: type[BaseModel]) -> dict[str, Quantity]:
    """Return the fields of a noun that may carry leading axes, with unit and range."""
    found = {}
    for name, field in noun.model_fields.items():
        arguments = getattr(field.annotation, "__args__", ())
        kinds = [field.annotation, *arguments, *(getattr(a, "__origin__", None) for a in arguments)]
        metadata = [*field.metadata, *(m for a in arguments for m in getattr(a, "__metadata__", ()))]
        quantity = next((m for m in metadata if isinstance(m, Quantity)), None)
        if quantity is not None and not quantity.sequence and any(k in (Real, Array) for k in kinds):
            found[name] = quantity
    return {name: q for name, q in found.items() if name not in _ALONE}


def nominal(case: Case, found: Input, run: Nonlinear | None = None) -> list[Real | None]:
    """Return the values of an input, one for each tank or mode that it means, or that of the run."""
    if found.noun == "run":
        return [getattr(run, found.field, None)]
    if found.quantity is _SCALE:
        return [1.0 for _ in found.names or ("",)]
    v = case.vehicle
    holders: dict[str, Any] = {
        "vehicle": [v],
        "autopilot": [case.autopilot],
        "actuator": [case.autopilot.actuator],
        "engine": [v.engine],
        "aerodynamics": [v.aerodynamics],
        "tank": [t for t in v.tanks if found.names and t.name in found.names],
        "flexible_mode": [f for f in v.flexible_modes if found.names and f.name in found.names],
    }
    if found.quantity is None:
        return [1.0 for _ in holders[found.noun]]
    return [getattr(holder, found.field) for holder in holders[found.noun]]


@dataclass(frozen=True, kw_only=True)
class Varied:
    """A batch of cases, case numbers on the first axis, and what multiplies each tank's damping, (N, ..., n_tanks).

    run: numbers of the runs that vary, (N,) each.
    """

    case: Case
    damping_factor: Array
    run: dict[str, Array]


def varied(dispersion: Dispersion, draws: Array) -> Varied:
    """Return the case with draws (N, parameters) in place of its inputs; each noun proves itself as from a file.

    Axes of the template, such as times of a flight, follow the case numbers. Where the thrust varies and the vectored
    thrust does not, it keeps its part of the thrust: that is how the engines are arranged. Draws of actuator or filters
    are put in one at a time, N = 1.

    Raises:
        ValidationError: some draw makes no sound vehicle or autopilot.
    """
    template = dispersion.case
    depth = len(case_shape(template))
    factor = np.ones((len(draws), *(1,) * depth, len(template.vehicle.tanks)))
    return _put_in(dispersion, [draw.reshape(-1, *(1,) * depth) for draw in draws.T], factor)


def varied_once(dispersion: Dispersion, draw: Array) -> Varied:
    """Return the case with one draw (parameters,) in place of its inputs, its axes as they are; factors (n_tanks,).

    Raises:
        ValidationError: as in `varied`.
    """
    return _put_in(dispersion, list(draw), np.ones(len(dispersion.case.vehicle.tanks)))


def _put_in(dispersion: Dispersion, draws: list[Array], factor: Array) -> Varied:
    """Return the case with draws, one for each parameter, in its place; `factor` takes in those of the dampings."""
    template = dispersion.case
    changes: list[tuple[Input, Callable[[Real], Real]]] = []
    run: dict[str, Array] = {}
    for parameter, draw in zip(dispersion.parameters, draws, strict=True):
        found = find_input(template, parameter.input)
        if found.noun == "run":
            own, drawn_flat = getattr(dispersion.analysis, found.field), np.reshape(draw, -1)
            run[found.field] = own * drawn_flat if parameter.factor else drawn_flat
        elif found.quantity is None:
            for j, tank in enumerate(template.vehicle.tanks):
                if found.names is not None and tank.name in found.names:
                    factor[..., j] *= draw
        else:
            changes.append((found, _change(draw, parameter.factor)))
    return Varied(case=_rebuilt(template, changes), damping_factor=factor, run=run)


def _change(draw: Array, factor: bool) -> Callable[[Real], Real]:
    return lambda value: np.asarray(value * draw if factor else draw + 0.0 * np.asarray(value))


def _rebuilt(case: Case, changes: list[tuple[Input, Callable[[Real], Real]]]) -> Case:
    """Return a case with some fields changed, made anew so that every check is asked."""

    def fields(value: BaseModel, noun: str, name: str | None = None) -> dict[str, Any]:
        given = {k: getattr(value, k) for k in type(value).model_fields}
        for found, change in changes:
            if found.noun == noun and (found.names is None or name in found.names):
                given[found.field] = change(given[found.field])
        return given

    v = case.vehicle
    given = fields(v, "vehicle")
    if not any(f.noun == "vehicle" and f.field == "vectored_thrust" for f, _ in changes):
        part = np.asarray(v.vectored_thrust) / v.thrust
        given["vectored_thrust"] = given["thrust"] * part if np.any(part != 1.0) else given["thrust"]
    tanks = []
    for tank in v.tanks:
        own = fields(tank, "tank", tank.name)
        for name in _PENDULUM if tank.pendulum_length is not None else _SPRING:
            del own[name]
        tanks.append(SloshMass(**own))
    given["tanks"] = tuple(tanks)
    given["flexible_modes"] = tuple(type(mode)(**fields(mode, "flexible_mode", mode.name)) for mode in v.flexible_modes)
    for name in ("engine", "aerodynamics"):
        if (part := getattr(v, name)) is not None:
            given[name] = type(part)(**fields(part, name))
    autopilot = _with_lags(Autopilot(**fields(case.autopilot, "autopilot")), changes)
    return Case(name=case.name, vehicle=Vehicle(**given), autopilot=autopilot, criteria=case.criteria)


def _with_lags(pilot: Autopilot, changes: list[tuple[Input, Callable[[Real], Real]]]) -> Autopilot:
    """Return an autopilot whose actuator and filters are those of one draw."""
    given: dict[str, Any] = {k: getattr(pilot, k) for k in Autopilot.model_fields}
    filters, actuator = list(pilot.filter), pilot.actuator
    for found, change in changes:
        if found.noun == "filter":
            for name in found.names or ():
                k = int(name) - 1
                filters[k] = Filter(**_scaled(filters[k], float(np.squeeze(change(1.0)))))
        elif found.noun == "actuator" and actuator is not None:
            own = {k: getattr(actuator, k) for k in Actuator.model_fields}
            if found.quantity is _SCALE:
                own |= _scaled(actuator, float(np.squeeze(change(1.0))))
            else:
                drawn = np.squeeze(change(own[found.field]))
                own[found.field] = drawn if drawn.ndim else float(drawn)
            actuator = Actuator(**own)
    return Autopilot(**(given | {"filter": tuple(filters), "actuator": actuator}))


def _scaled(lag: Filter | Actuator, factor: float) -> dict[str, tuple[float, ...]]:
    """Return numerator and denominator with every root times a factor: s becomes s / factor."""
    found = {}
    for part in ("numerator", "denominator"):
        c = getattr(lag, part)
        found[part] = tuple(x / factor ** (len(c) - 1 - k) for k, x in enumerate(c))
    return found
