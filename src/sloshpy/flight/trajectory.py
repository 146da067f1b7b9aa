"""A flight: phases between events, each a batch of cases along time. Nothing reaches across an event."""

import functools
import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sloshpy.batch import case_shape, for_each
from sloshpy.case import Case
from sloshpy.damping import AnyDamping, small_amplitude_ratio
from sloshpy.errors import OutsideValidity
from sloshpy.flight.events import Event, event_between
from sloshpy.stability.between import between
from sloshpy.units import Array

REFERENCE_SHARE = 0.1  # of the tank radius: the spring-mass holds to 10-15 % of it


@dataclass(frozen=True, kw_only=True)
class Phase:
    """A stretch of flight between two events: the vehicle changes in it without a jump.

    time: (T,), s, increasing, T >= 2; the first lies just after an event, the last just before one.
    case: vehicle, autopilot and criteria, numbers as floats or with the leading axis (T,).
    laws: (T, n_tanks), damping laws where they change with time (a fill above a baffle); () where the case's hold.
    fill: (T, n_tanks), parts of the tanks' volumes, nan where unknown; None where none is known.
    notes: what was done on the way that a reader should know. schedules: key of each quantity that follows a schedule,
    and where it stands, in words. case_file: "" for a case made in Python.
    """

    name: str
    time: Array
    case: Case
    laws: tuple[tuple[AnyDamping, ...], ...] = ()
    fill: Array | None = None
    notes: tuple[str, ...] = ()
    schedules: tuple[tuple[str, str], ...] = ()
    case_file: str = ""

    def __post_init__(self) -> None:
        t = np.array(self.time, dtype=float)
        if t.ndim != 1 or len(t) < 2 or not np.all(np.isfinite(t)) or not np.all(np.diff(t) > 0.0):
            raise ValueError(f"phase {self.name}: time must be two or more finite, increasing values")
        if case_shape(self.case) not in {(), t.shape}:
            raise ValueError(f"phase {self.name}: {len(t)} times, but the case has the shape {case_shape(self.case)}")
        if self.laws and [len(row) for row in self.laws] != len(t) * [len(self.tanks)]:
            raise ValueError(f"phase {self.name}: laws are wanted for {len(t)} times and {len(self.tanks)} tanks")
        fill = np.full((len(t), len(self.tanks)), np.nan) if self.fill is None else np.array(self.fill, dtype=float)
        if fill.shape != (len(t), len(self.tanks)):
            raise ValueError(f"phase {self.name}: fill has the shape {fill.shape}")
        for name, array in (("time", t), ("fill", fill)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if not self.tanks:
            raise ValueError(f"phase {self.name}: no tank: there is no slosh to assess")
        vehicle = self.case.vehicle  # one array at least, so that a phase that does not change is a batch too
        whole = vehicle.model_copy(update={"mass": np.broadcast_to(np.asarray(vehicle.mass, dtype=float), t.shape)})
        object.__setattr__(self, "case", self.case.model_copy(update={"vehicle": whole}))

    @property
    def tanks(self) -> tuple[str, ...]:
        """Names of the tanks."""
        return tuple(tank.name for tank in self.case.vehicle.tanks)

    @functools.cached_property
    def cases(self) -> tuple[Case, ...]:
        """The single case at each time, (T,), with the damping laws of that time."""
        found = tuple(for_each(lambda case: case, self.case))
        if not self.laws:
            return found
        return tuple(_damped(case, row) for case, row in zip(found, self.laws, strict=True))

    @functools.cached_property
    def small_damping(self) -> Array:
        """Each tank's damping at small amplitude, (T, n_tanks)."""
        rows = [[small_amplitude_ratio(tank.damping) for tank in case.vehicle.tanks] for case in self.cases]
        return np.array(rows).reshape(len(self.time), len(self.tanks))

    @functools.cached_property
    def reference_amplitude(self) -> Array:
        """A tenth of the tank radius or where the damping data end before, (T, n_tanks), m; nan without a radius."""
        rows = [[_reference(case, j) for j in range(len(self.tanks))] for case in self.cases]
        return np.array(rows).reshape(len(self.time), len(self.tanks))

    @functools.cached_property
    def available_damping(self) -> Array:
        """Each tank's damping at the reference amplitude, (T, n_tanks); at small amplitude where there is none."""
        found = self.small_damping.copy()
        for k, case in enumerate(self.cases):
            for j, tank in enumerate(case.vehicle.tanks):
                amplitude = self.reference_amplitude[k, j]
                if np.isfinite(amplitude):
                    found[k, j] = float(tank.damping.ratio(max(amplitude, tank.damping.smallest_amplitude)))
        return found

    def place(self, time: float) -> tuple[int, float]:
        """Return the interval that holds a time and the part of it that has passed.

        Raises:
            OutsideValidity: a time outside the phase.
        """
        if not self.time[0] <= time <= self.time[-1]:
            raise OutsideValidity(
                f"{time:g} s lies outside phase {self.name}, from {self.time[0]:g} to {self.time[-1]:g} s"
            )
        k = int(np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 2))
        return k, float((time - self.time[k]) / (self.time[k + 1] - self.time[k]))

    def at(self, time: float) -> Case:
        """Return the case at a time within the phase, every number linear between its neighbours, the earlier laws."""
        k, part = self.place(time)
        if part in (0.0, 1.0):
            return self.cases[k + int(part)]
        return between(self.cases[k], self.cases[k + 1], part)


@dataclass(frozen=True, kw_only=True)
class FileUsed:
    """A file that a flight was made from: its name as the flight file has it, what it is, its hash."""

    file: str
    what: str
    sha256: str


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """A flight in phases, in order of time; where one ends and the next begins is an event, analysed on both sides.

    files: what it was made from, the flight file first; () for a flight made in Python.
    """

    name: str
    phases: tuple[Phase, ...]
    files: tuple[FileUsed, ...] = ()

    def __post_init__(self) -> None:
        if not self.phases:
            raise ValueError("a flight has at least one phase")
        names = [phase.name for phase in self.phases]
        if len(set(names)) < len(names):
            raise ValueError("two phases have the same name")
        for one, other in zip(self.phases, self.phases[1:], strict=False):
            if other.time[0] < one.time[-1]:
                raise ValueError(f"phase {other.name} begins before phase {one.name} ends")

    @property
    def tanks(self) -> tuple[str, ...]:
        """Names of all tanks, in the order in which they appear."""
        return tuple(dict.fromkeys(tank for phase in self.phases for tank in phase.tanks))

    @property
    def count(self) -> int:
        """How many times there are in all; an event counts on both sides."""
        return sum(len(phase.time) for phase in self.phases)

    @property
    def events(self) -> tuple[float, ...]:
        """Times at which one phase gives way to the next, s."""
        return tuple(float(phase.time[0]) for phase in self.phases[1:])

    @functools.cached_property
    def crossings(self) -> tuple[Event, ...]:
        """The events, with what changes at each and whether an oscillation goes on across it."""
        return events_of(self.phases)

    def phase_at(self, time: float) -> Phase:
        """Return the phase that holds a time in s, at an event the one after it.

        Raises:
            OutsideValidity: no phase holds it.
        """
        holding = [phase for phase in self.phases if phase.time[0] <= time <= phase.time[-1]]
        if not holding:
            spans = ", ".join(f"{phase.time[0]:g} to {phase.time[-1]:g} s" for phase in self.phases)
            raise OutsideValidity(f"{time:g} s lies in no phase; they reach from {spans}")
        return holding[-1]

    def __iter__(self) -> Iterator[Phase]:
        return iter(self.phases)

    def __str__(self) -> str:
        lines = [f"{self.name}: {self.count} times in {len(self.phases)} phases"]
        for p in self.phases:
            lines.append(f"  {p.name}: {p.time[0]:g} to {p.time[-1]:g} s, {len(p.time)} times, {', '.join(p.tanks)}")
            lines += [f"    - {note}" for note in p.notes]
        return "\n".join(lines)


def events_of(phases: tuple[Phase, ...]) -> tuple[Event, ...]:
    """Return the event between each two phases that follow each other."""
    return tuple(
        event_between(one.name, (float(one.time[-1]), one.cases[-1]), two.name, (float(two.time[0]), two.cases[0]))
        for one, two in itertools.pairwise(phases)
    )


def _damped(case: Case, laws: tuple[AnyDamping, ...]) -> Case:
    tanks = tuple(tank.model_copy(update={"damping": law}) for tank, law in zip(case.vehicle.tanks, laws, strict=True))
    return case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"tanks": tanks})})


def _reference(case: Case, tank: int) -> float:
    one = case.vehicle.tanks[tank]
    return np.nan if one.radius is None else min(REFERENCE_SHARE * float(one.radius), one.damping.largest_amplitude)
