"""Events between phases, and whether an oscillation goes on across one: the same vehicle and liquid on both sides."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from sloshpy.case import Case
from sloshpy.dynamics import open_loop

SAME_MASS = 2e-3  # of the vehicle: digits of a table; a stage that leaves is far more
SAME_SLOSH = 1e-2  # of a slosh mass and of its station: another tank model of the same liquid
INSTANT = 1e-6  # s, between the end of a phase and the start of the next


@dataclass(frozen=True, kw_only=True)
class Event:
    """Where one phase gives way to the next.

    start, end: s, of the gap between them; the same where there is none. before, after: names of the phases.
    changes: what is another thing after it, in words. barriers: why no oscillation is carried across; () where it is.
    """

    start: float
    end: float
    before: str
    after: str
    changes: tuple[str, ...]
    barriers: tuple[str, ...]

    @property
    def carries(self) -> bool:
        """Whether slosh, attitude, bending and engine are the same just before and just after."""
        return not self.barriers

    def __str__(self) -> str:
        what = f" ({'; '.join(self.changes)})" if self.changes else ""
        fate = "an oscillation goes on" if self.carries else f"no oscillation is carried: {'; '.join(self.barriers)}"
        return f"{self.end:g} s, {self.before} to {self.after}{what}: {fate}"

    def told(self) -> dict[str, Any]:
        """Return the event by its own names, for a JSON object."""
        return {
            "time": self.end,
            "gap": self.end - self.start,
            "before": self.before,
            "after": self.after,
            "changes": list(self.changes),
            "carries": self.carries,
            "barriers": list(self.barriers),
        }


def event_between(before: str, last: tuple[float, Case], after: str, first: tuple[float, Case]) -> Event:
    """Return the event between the last time and case of a phase and the first of the next."""
    (start, one), (end, other) = last, first
    return Event(
        start=start,
        end=end,
        before=before,
        after=after,
        changes=tuple(_changes(one, other)),
        barriers=tuple(_barriers(end - start, one, other)),
    )


def _barriers(gap: float, one: Case, other: Case) -> list[str]:
    """Return why the state does not go over, the plainest first."""
    found = [f"{gap:g} s lie between the phases, of which nothing is known"] if gap > INSTANT else []
    v, w = one.vehicle, other.vehicle
    names, later = [t.name for t in v.tanks], [t.name for t in w.tanks]
    if names != later:
        found.append(f"the tanks are {', '.join(names)} before and {', '.join(later)} after")
    if _apart(v.mass, w.mass) > SAME_MASS:
        found.append(f"the mass goes from {float(v.mass):.6g} to {float(w.mass):.6g} kg: something leaves")
    if names == later:
        for t, u in zip(v.tanks, w.tanks, strict=True):
            if max(_apart(t.slosh_mass, u.slosh_mass), _apart(t.station, u.station)) > SAME_SLOSH:
                found.append(f"the slosh mass of {t.name} is another one")
    modes, bending = ([(m.name, float(m.generalized_mass)) for m in x.flexible_modes] for x in (v, w))
    if modes != bending:
        found.append("the bending modes are others")
    if v.engine != w.engine or one.autopilot.actuator != other.autopilot.actuator:
        found.append("the engine or its actuator is another one")
    if one.autopilot.sample_time is not None or other.autopilot.sample_time is not None:
        found.append("a sampler works on one side at least")
    if not found:
        p, q = open_loop(one).plant, open_loop(other).plant
        if (p.groups, p.velocity_only, p.guided) != (q.groups, q.velocity_only, q.guided):
            found.append("the drift of the vehicle counts on one side alone (air, guidance)")
    return found


def _changes(one: Case, other: Case) -> list[str]:
    """Return what is switched, in words with its numbers."""
    v, w, a, b = one.vehicle, other.vehicle, one.autopilot, other.autopilot
    pairs = (
        ("mass", v.mass, w.mass, 1.0, "kg"),
        ("thrust", v.thrust, w.thrust, 1e-3, "kN"),
        ("attitude gain", a.attitude_gain, b.attitude_gain, 1.0, ""),
        ("rate gain", a.rate_gain, b.rate_gain, 1.0, "s"),
        ("extra gain", a.gain, b.gain, 1.0, ""),
        ("delay", a.delay, b.delay, 1e3, "ms"),
    )
    found = [
        f"{name} {scale * float(x):.4g} to {scale * float(y):.4g} {unit}".rstrip()
        for name, x, y, scale, unit in pairs
        if _apart(x, y) > SAME_MASS
    ]
    return found + (["other filters"] if a.filter != b.filter else [])


def _apart(x: Any, y: Any) -> float:
    """Return the difference of two numbers over the greater one."""
    most = max(abs(float(np.asarray(x))), abs(float(np.asarray(y))))
    return abs(float(np.asarray(x)) - float(np.asarray(y))) / most if most else 0.0
