"""What a campaign keeps of each case: its numbers, with the limits of the criteria."""

from dataclasses import replace

import numpy as np

from sloshpy.case import Case
from sloshpy.dispersion.dispersion import Dispersion, Linear
from sloshpy.dispersion.flown_columns import STEPPED, flown_columns
from sloshpy.dispersion.rows import Column
from sloshpy.dispersion.verdict import VERDICT

MARGINAL = 1e-6  # of a disc margin, and in parts of the engine's limit: nearer, rounding elsewhere decides
NEUTRAL = 1e-9  # likewise of a growth, in parts of the fastest slosh


def columns_of(dispersion: Dispersion) -> tuple[Column, ...]:
    """Return what is kept of each case, the verdict last; of a flight first what is of all of it, then every moment."""
    if dispersion.flight and not isinstance(dispersion.analysis, Linear):
        return (*flown_columns(dispersion), VERDICT)
    if dispersion.flight:
        return (*worst_columns(dispersion), *_moment_columns(dispersion), VERDICT)
    how = dispersion.analysis
    if isinstance(how, Linear):
        return (*_linear_columns(dispersion.case, how), VERDICT)
    return (*_nonlinear_columns(dispersion.case), VERDICT)


def worst_columns(dispersion: Dispersion) -> tuple[Column, ...]:
    """Return the columns of the worst moment of a flight that is asked for its margins."""
    found: dict[str, Column] = {}
    for moment in dispersion.flight:
        for column in _linear_columns(moment.case, _question(dispersion)):
            found.setdefault(column.name, replace(column, meaning=f"worst of the flight; {column.meaning}"))
    when = Column(name="disc_margin_time", unit="s", meaning="of flight, of the least disc margin")
    return (*found.values(), when)


def _question(dispersion: Dispersion) -> Linear:
    how = dispersion.analysis
    assert isinstance(how, Linear)
    return how


def _moment_columns(dispersion: Dispersion) -> list[Column]:
    return [
        replace(column, name=f"{column.name}[{k}]", limit=None, moment=k, meaning=f"{moment.time:g} s, {moment.phase}")
        for k, moment in enumerate(dispersion.flight)
        for column in _linear_columns(moment.case, _question(dispersion))
    ]


def _engine(case: Case, name: str, meaning: str, tolerance: float) -> Column:
    most = case.criteria.tvc_amplitude
    return Column(name=name, unit="rad", meaning=meaning, worst=1, limit=most, tolerance=tolerance * most)


def _linear_columns(case: Case, how: Linear) -> list[Column]:
    read, least = "where the dampings are read", case.criteria.disc_margin
    fastest = max((float(np.max(tank.frequency)) for tank in case.vehicle.tanks), default=1.0)
    found = [
        Column(name="disc_margin", unit="1", meaning=f"signed, {read}", worst=-1, limit=least, tolerance=MARGINAL),
        Column(
            name="growth",
            unit="1/s",
            meaning=f"greatest growth of a pole {read}",
            worst=1,
            limit=0.0,
            tolerance=NEUTRAL * fastest,
        ),
    ]
    for tank in case.vehicle.tanks if how.required else ():
        t = tank.name
        found += [
            Column(name=f"required_damping.{t}", unit="1", meaning="of the tank, for the disc margin", worst=1),
            Column(name=f"slosh.{t}", unit="m", meaning="amplitude at which its law gives that", worst=1),
            _engine(case, f"engine.{t}", "engine amplitude in that oscillation", MARGINAL),
        ]
    return found


def _nonlinear_columns(case: Case) -> list[Column]:
    found = []
    for tank in case.vehicle.tanks:
        t = tank.name
        found += [
            Column(name=f"slosh_amplitude.{t}", unit="m", meaning="settled, half peak to peak", worst=1),
            Column(name=f"slosh_peak.{t}", unit="m", meaning="greatest of the run", worst=1),
        ]
    return [
        *found,
        _engine(case, "engine_amplitude", "settled, half peak to peak", STEPPED),
        Column(name="engine_peak", unit="rad", meaning="greatest of the run", worst=1),
        Column(name="engine_omega", unit="rad/s", meaning="frequency of the settled engine"),
    ]
