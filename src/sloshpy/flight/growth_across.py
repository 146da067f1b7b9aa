"""Growth of one slosh mode along a flight, carried across the events at which vehicle and liquid stay the same.

At an event the motion goes on and the loop is another one. Of the state x = Re(a r e^{j phi}) that the old mode leaves
the new mode of the same tank takes the part

    a | p e^{j phi} + q e^{-j phi} |,   p = l . r,  q = l . conj(r),

l the left vector of the new mode, scaled like its right one to the slosh of its own tank. phi, where in its swing the
event finds the slosh, no growth equation knows: the amplitude after it lies between a ||p| - |q|| and a (|p| + |q|),
and both are followed. What other modes take is not: the new loop damps it, or it grows by their own growth.
"""

from dataclasses import dataclass

import numpy as np

from sloshpy.errors import OutsideValidity
from sloshpy.flight.events import Event
from sloshpy.flight.growth_along import FlightGrowth, growth_along
from sloshpy.flight.mode_state import carried_state, mode_vectors
from sloshpy.flight.trajectory import Phase, Trajectory
from sloshpy.limit_cycle.branch import Mode
from sloshpy.limit_cycle.growth import follow
from sloshpy.units import Array

ROUNDS = 20  # of amplitude and damping made to agree; each gains about two digits
AGREED = 1e-9


@dataclass(frozen=True, kw_only=True)
class Carry:
    """What an event makes of an amplitude: least and greatest after it, m, by where in the swing it falls."""

    event: Event
    before: tuple[float, float]
    least: float
    greatest: float

    def __str__(self) -> str:
        changes = f" ({'; '.join(self.event.changes)})" if self.event.changes else ""
        low, high = self.least / self.before[0], self.greatest / self.before[1]
        return f"at {self.event.end:g} s{changes} the amplitude is taken over times {low:.4g} to {high:.4g}"


@dataclass(frozen=True, kw_only=True)
class CarriedGrowth:
    """The amplitude of one slosh mode along phases.

    parts, lower: for each phase the growth from the greatest and from the least amplitude that its event leaves; the
    same in the first. carries: of each event passed. ended: why it ends before the time asked for, else "".
    """

    parts: tuple[FlightGrowth, ...]
    lower: tuple[FlightGrowth, ...]
    carries: tuple[Carry, ...]
    ended: str

    @property
    def tank(self) -> str:
        """Name of the tank whose mode it is."""
        return self.parts[0].tank

    @property
    def phase(self) -> Phase:
        """The phase in which it begins."""
        return self.parts[0].phase

    @property
    def greatest(self) -> int:
        """Where the amplitude is greatest."""
        return int(np.argmax(self.amplitude))

    @property
    def time(self) -> Array:
        """Times, (S,), s; an event stands twice."""
        return np.concatenate([part.time for part in self.parts])

    @property
    def least(self) -> Array:
        """Least amplitude, (S,), m."""
        return np.concatenate([part.amplitude for part in self.lower])

    @property
    def amplitude(self) -> Array:
        """Greatest amplitude, (S,), m."""
        return np.concatenate([part.amplitude for part in self.parts])

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return least and greatest amplitude, m, at times in s; nan outside. An event's own time is before it."""
        least, most = np.full(np.shape(time), np.nan), np.full(np.shape(time), np.nan)
        for low, high in zip(reversed(self.lower), reversed(self.parts), strict=True):
            within = (time >= high.time[0]) & (time <= high.time[-1])
            for found, part in ((least, low), (most, high)):
                found[within] = np.exp(np.interp(time[within], part.time, np.log(part.amplitude)))
        return least, most

    def __str__(self) -> str:
        lines = [str(self.parts[0])]
        for carry, part in zip(self.carries, self.parts[1:], strict=True):
            lines += [str(carry), str(part)]
        return "\n".join([*lines, *([f"ends at {self.parts[-1].time[-1]:g} s: {self.ended}"] if self.ended else [])])


def growth_across(
    trajectory: Trajectory,
    tank: str | int = 0,
    amplitude: float = 0.01,
    start: float | None = None,
    end: float | None = None,
) -> CarriedGrowth:
    """Return the amplitude of a tank's slosh mode along a flight from one time on, as far as it is carried.

    Args:
        trajectory: phases whose times lie close enough that sigma is nearly linear between them.
        tank: name of the tank, or its number in the phase of the start.
        amplitude: at the start, m, > 0.
        start, end: s; default: begin and end of the flight. At an event the start lies after it.

    Raises:
        OutsideValidity: a start in no phase; what `growth_along` raises in the phase of the start.
    """
    phases = trajectory.phases
    t0 = float(phases[0].time[0]) if start is None else start
    t1 = float(phases[-1].time[-1]) if end is None else end
    n = phases.index(trajectory.phase_at(t0))
    if not t1 > t0:
        raise ValueError(f"wants an end after the start, has {t0:g} and {t1:g} s")
    first = growth_along(phases[n], tank, amplitude, t0, min(t1, float(phases[n].time[-1])))
    parts, lower, carries, ended = [first], [first], [], ""
    while t1 > parts[-1].time[-1] and n + 1 < len(phases) and not ended:
        event = trajectory.crossings[n]
        if not event.carries:
            ended = f"no oscillation is carried on: {'; '.join(event.barriers)}"
            break
        n += 1
        try:
            low, high = taken_over(lower[-1], phases[n], False), taken_over(parts[-1], phases[n], True)
            last = min(t1, float(phases[n].time[-1]))
            pair = [growth_along(phases[n], first.tank, a, None, last) for a in (low, high)]
        except OutsideValidity as error:
            ended = str(error)
            break
        before = float(lower[-1].amplitude[-1]), float(parts[-1].amplitude[-1])
        carries.append(Carry(event=event, before=before, least=low, greatest=high))
        lower.append(pair[0])
        parts.append(pair[1])
    return CarriedGrowth(parts=tuple(parts), lower=tuple(lower), carries=tuple(carries), ended=ended)


def taken_over(growth: FlightGrowth, after: Phase, greatest: bool) -> float:
    """Return the amplitude in m that the mode of the next phase takes over at its begin, greatest or least."""
    j, a = after.tanks.index(growth.tank), float(growth.amplitude[-1])
    old = mode_vectors(growth.phase.cases[-1], growth.finish, growth.phase.tanks.index(growth.tank))
    found = a
    for _ in range(ROUNDS):
        new = mode_vectors(after.cases[0], _mode_at(after, j, found), j)
        x = carried_state(old, new.loop)
        p, q = abs(complex(new.left @ x)), abs(complex(new.left @ np.conj(x)))
        share = p + q if greatest else abs(p - q)
        before, found = found, a * share
        if abs(found - before) <= AGREED * found:
            break
    return found


def _mode_at(phase: Phase, tank: int, amplitude: float) -> Mode:
    """Return a tank's mode at the begin of a phase."""
    modes = follow(phase.cases[0], tank, amplitude)
    if not modes or abs(modes[-1].amplitude / amplitude - 1.0) > 1e-9:
        raise OutsideValidity(
            f"{phase.tanks[tank]}: no mode at {amplitude:g} m and {phase.time[0]:g} s, just after an event: the "
            "damping data do not reach there, or another tank takes the mode over before"
        )
    return modes[-1]
