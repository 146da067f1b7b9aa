"""What a campaign keeps of each simulated flight: greatest slosh and engine angle, when, what is left at the end."""

from dataclasses import replace

import numpy as np

from sloshpy.damping.validity import VALID_SHARE_OF_RADIUS
from sloshpy.dispersion.dispersion import Dispersion
from sloshpy.dispersion.rows import Column
from sloshpy.flight.trajectory import Phase
from sloshpy.units import Array

STEPPED = 1e-4  # in parts of a limit, which the step of a simulation leaves


def flown_tanks(dispersion: Dispersion) -> tuple[str, ...]:
    """Return the names of all tanks of a flight, in the order in which they appear."""
    return tuple(dict.fromkeys(tank for phase in dispersion.phases for tank in phase.tanks))


def radii(phase: Phase, tank: str) -> Array:
    """Return the radius of a tank at each time of a phase, (T,), m; nan where none is given."""
    found = [next(t for t in case.vehicle.tanks if t.name == tank).radius for case in phase.cases]
    return np.array([np.nan if one is None else float(one) for one in found])


def with_radius(dispersion: Dispersion, tank: str) -> bool:
    """Whether a tank's radius is known at every time of the flight that has the tank."""
    own = [phase for phase in dispersion.phases if tank in phase.tanks]
    return not any(np.any(np.isnan(radii(phase, tank))) for phase in own)


def flown_columns(dispersion: Dispersion) -> tuple[Column, ...]:
    """Return the columns of a simulated flight: of all of it, then the greatest about each time of each phase."""
    most = dispersion.case.criteria.tvc_amplitude
    found: list[Column] = []
    for t in flown_tanks(dispersion):
        found += [
            Column(name=f"slosh_peak.{t}", unit="m", meaning="greatest of the flight", worst=1),
            Column(name=f"slosh_peak_time.{t}", unit="s", meaning="of flight, of its greatest slosh"),
            Column(name=f"slosh_end.{t}", unit="m", meaning="in the last swing, half peak to peak", worst=1),
        ]
        if with_radius(dispersion, t):
            found.append(
                Column(
                    name=f"slosh_radius.{t}",
                    unit="1",
                    meaning="greatest slosh over the tank radius; the spring-mass holds to the limit",
                    worst=1,
                    limit=VALID_SHARE_OF_RADIUS,
                    tolerance=STEPPED * VALID_SHARE_OF_RADIUS,
                )
            )
    engine = Column(name="engine_peak", unit="rad", meaning="greatest of the flight", worst=1)
    found += [
        replace(engine, limit=most, tolerance=STEPPED * most),
        Column(name="engine_peak_time", unit="s", meaning="of flight, of the greatest engine angle"),
        Column(name="engine_end", unit="rad", meaning="in the last swing, half peak to peak", worst=1),
    ]
    return (*found, *_moments(dispersion, engine))


def _moments(dispersion: Dispersion, engine: Column) -> list[Column]:
    """Return the greatest about each time, in the order of `Dispersion.flight`: tanks of its phase, then the engine."""
    found, k = [], 0
    for phase in dispersion.phases:
        for t in phase.time:
            meaning = f"greatest about {t:g} s, {phase.name}"
            own = [Column(name=f"slosh_peak.{name}", unit="m", meaning="", worst=1) for name in phase.tanks]
            found += [replace(c, name=f"{c.name}[{k}]", moment=k, meaning=meaning) for c in (*own, engine)]
            k += 1
    return found


def flown_notes(dispersion: Dispersion) -> list[str]:
    """Return what a reader of a campaign of simulated flights has to know."""
    begins = ", ".join(f"{run[0].time[0]:g} s" for run in dispersion.stretches)
    notes = [
        f"each draw is one flight, simulated from {begins} on, each time from its initial slosh, all else at rest; "
        "peaks hold that slosh and what it and the gust ask of the engine"
    ]
    notes += [str(event) for event in dispersion.events if not event.carries]
    bare = [tank for tank in flown_tanks(dispersion) if not with_radius(dispersion, tank)]
    if bare:
        notes.append(f"not checked: slosh of {', '.join(bare)} against the tank radius, of which 10-15 % is valid")
    return notes
