"""Slosh masses along a flight: a table of fill and acceleration to a table of all that the plant needs."""

import functools
import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from sloshpy.errors import OutsideValidity
from sloshpy.tank.contour_doubt import Doubt, doubt_of
from sloshpy.tank.shapes import Contour
from sloshpy.tank.slosh_masses import SloshModes, slosh_masses
from sloshpy.tank.tank import Fill, Tank
from sloshpy.tank.tank_damping import TankDamping, tank_damping
from sloshpy.units import Array

if TYPE_CHECKING:
    import xarray as xr

_OF_MODES = {
    "kappa": "1/m",
    "frequency": "rad/s",
    "slosh_mass": "kg",
    "spring_height": "m",
    "hinge_height": "m",
    "wave_per_displacement": "1",
    "error_estimate": "1",
}
_OF_TANK = {
    "liquid_mass": "kg",
    "liquid_cg_height": "m",
    "fixed_mass": "kg",
    "fixed_mass_height": "m",
    "fixed_mass_inertia": "kg m^2",
    "rigid_lid_inertia": "kg m^2",
    "rigid_lid_error": "1",
    "fixed_inertia_error": "1",
}


_DOUBTED = 9  # depths of a history at which the doubt about a contour is found
_OF_DAMPING = {"wall_damping": "1", "constant_damping": "1", "ring_coefficient": "m^-1/2", "ring_amplitude": "m"}


@dataclass(frozen=True, kw_only=True)
class FillHistory:
    """The slosh masses of one tank and the damping of the first at several fills, (P,) points; nan where there is none.

    rows: the result at each point, None where there is none; reason: why, "" elsewhere. time: (P,), s, or None.
    depth: (P,), m. acceleration: (P,), m/s^2.
    """

    tank: Tank
    rows: tuple[SloshModes | None, ...]
    reason: tuple[str, ...]
    time: Array | None
    acceleration: Array

    @property
    def depth(self) -> Array:
        """Depth above the lowest point, (P,), m."""
        return np.array([np.nan if row is None else row.section.depth for row in self.rows])

    @property
    def fraction(self) -> Array:
        """Part of the tank's volume, (P,)."""
        whole = self.tank.volume
        return np.array([np.nan if row is None else row.section.volume / whole for row in self.rows])

    def of_modes(self, name: str) -> Array:
        """Return a quantity of the slosh masses, such as "slosh_mass", (P, n_modes)."""
        nothing = np.full(self.tank.modes, np.nan)
        return np.array([nothing if row is None else getattr(row, name) for row in self.rows])

    def of_tank(self, name: str) -> Array:
        """Return a quantity of the whole liquid, such as "fixed_mass", (P,)."""
        return np.array([np.nan if row is None else getattr(row, name) for row in self.rows])

    @functools.cached_property
    def damping(self) -> tuple[TankDamping | None, ...]:
        """Damping of the first slosh mass at each point, (P,)."""
        return tuple(None if row is None else tank_damping(row) for row in self.rows)

    def of_damping(self, name: str) -> Array:
        """Return a quantity of the damping, (P,), nan where no formula gives it.

        wall_damping; constant_damping: of wall or floor, at any amplitude; ring_coefficient c of c A^(1/2) by ring
        baffles, A the slosh-mass displacement in m, and ring_amplitude, to which that holds.
        """
        found = np.full(len(self.rows), np.nan)
        for k, one in enumerate(self.damping):
            if one is None:
                continue
            wall, rings = one.wall, one.baffles
            given = {
                "wall_damping": None if wall is None else wall.ratio,
                "constant_damping": one.constant,
                "ring_coefficient": None if rings is None else rings.law.slope,
                "ring_amplitude": None if rings is None else rings.largest_amplitude,
            }[name]
            found[k] = np.nan if given is None else given
        return found

    def __str__(self) -> str:
        missing = [k for k, row in enumerate(self.rows) if row is None]
        lines = [f"{self.tank.name}: {len(self.rows)} rows, {len(missing)} without slosh masses"]
        lines += [f"  - row {k + 1}: {self.reason[k]}" for k in missing[:5]]
        lines += [f"  - and {len(missing) - 5} more"] if len(missing) > 5 else []
        doubtful = [(k, row.reasons) for k, row in enumerate(self.rows) if row is not None and row.reasons]
        if doubtful:
            k, reasons = doubtful[0]
            more = f", and of {len(doubtful) - 1} more" if len(doubtful) > 1 else ""
            lines += [f"  - of row {k + 1}{more}: {reason}" for reason in reasons]
        lines.append(
            f"  {'time s':>9s} {'full':>8s} {'depth m':>9s} {'Hz':>8s} {'mass kg':>10s} {'spring m':>9s} {'error':>7s}"
        )
        there = [k for k in range(len(self.rows)) if k not in missing]
        shown = there if len(there) <= 12 else [there[k] for k in np.linspace(0, len(there) - 1, 12).astype(int)]
        for k in shown:
            row = self.rows[k]
            assert row is not None
            time = f"{self.time[k]:9.2f}" if self.time is not None else " " * 9
            lines.append(
                f"  {time} {100.0 * self.fraction[k]:6.2f} % {row.section.depth:9.4f} {row.f_hz[0]:8.4f} "
                f"{row.slosh_mass[0]:10.5g} {row.spring_height[0]:9.4f} {row.error_estimate[0]:7.0e}"
            )
        if shown != there:
            lines.append(f"  ({len(there) - len(shown)} rows not shown)")
        return "\n".join(lines)

    def to_json(self) -> str:
        """Return one JSON object in SI units: each point as of one tank with its damping, or null with a reason."""
        times = [None] * len(self.rows) if self.time is None else self.time.tolist()
        tanks = [
            None if row is None or damping is None else row.to_dict() | damping.to_dict()
            for row, damping in zip(self.rows, self.damping, strict=True)
        ]
        points = [
            {"time": t, "acceleration": float(a), "reason": reason, "tank": one}
            for t, a, reason, one in zip(times, self.acceleration, self.reason, tanks, strict=True)
        ]
        return json.dumps({"name": self.tank.name, "points": points}, indent=1)

    def to_dataset(self) -> "xr.Dataset":
        """Return the table as an xarray Dataset over the points and the modes."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        data: dict[str, Any] = {
            "depth": ("point", self.depth, {"units": "m"}),
            "fraction": ("point", self.fraction, {"units": "1"}),
            "acceleration": ("point", self.acceleration, {"units": "m/s^2"}),
        }
        data |= {name: ("point", self.of_tank(name), {"units": unit}) for name, unit in _OF_TANK.items()}
        data |= {name: (["point", "mode"], self.of_modes(name), {"units": unit}) for name, unit in _OF_MODES.items()}
        data |= {name: ("point", self.of_damping(name), {"units": unit}) for name, unit in _OF_DAMPING.items()}
        if self.tank.bottom_station is not None:
            station = self.tank.bottom_station + self.of_modes("spring_height")
            data["station"] = (["point", "mode"], station, {"units": "m"})
        data["reason"] = ("point", list(self.reason))
        data["damping"] = ("point", ["" if one is None else "; ".join(one.sources) for one in self.damping])
        coords: dict[str, Any] = {"mode": np.arange(1, self.tank.modes + 1)}
        if self.time is not None:
            coords["time"] = ("point", self.time, {"units": "s"})
        return xr.Dataset(data, coords=coords, attrs={"tank": self.tank.name})


def slosh_masses_history(
    tank: Tank,
    fill: Sequence[str | float | Fill] | Array,
    acceleration: float | Sequence[float] | Array | None = None,
    time: Sequence[float] | Array | None = None,
) -> FillHistory:
    """Return the slosh masses of a tank at each of several fills.

    A fill that leaves no free surface, or an acceleration that holds no liquid down, has no slosh masses: its row is
    nan and says why. What the points of a contour leave open is found at nine depths; between two of them counts the
    greater.

    Args:
        tank: shape, liquid, modes; its own fill is not used.
        fill: (P,), depths in m, or texts such as "62 %" and "6.2 m".
        acceleration: m/s^2, one or (P,); default: the tank's own.
        time: (P,), s, increasing; only carried along.

    Raises:
        ValueError: lengths that do not fit, or a time that does not increase.
    """
    count = len(fill)
    a = np.broadcast_to(np.asarray(tank.acceleration if acceleration is None else acceleration, dtype=float), (count,))
    t = None if time is None else np.asarray(time, dtype=float)
    if t is not None and (t.shape != (count,) or not np.all(np.diff(t) > 0.0)):
        raise ValueError(f"time must be {count} increasing values, one for each fill")
    shared = {name: getattr(tank, name) for name in Tank.model_fields if name not in {"fill", "acceleration"}}
    tanks: list[Tank | None] = []
    reasons: list[str] = []
    for one, a_k in zip(fill, a, strict=True):
        reason, filled = "", None
        try:
            level = one if isinstance(one, str | Fill) else float(one)
            filled = Tank(fill=level, acceleration=float(a_k), **shared)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            key = next((str(step) for step in (*first["loc"], *first.get("ctx", {}).get("key", ()))), "")
            reason = f"{key} {first.get('ctx', {}).get('rule', first['msg'])}"
        tanks.append(filled)
        reasons.append(reason)
    doubts = _doubts(tanks)
    rows: list[SloshModes | None] = [None] * count
    for k, filled in enumerate(tanks):
        try:
            rows[k] = None if filled is None else slosh_masses(filled, doubt=doubts[k])
        except OutsideValidity as error:
            reasons[k] = str(error)
    return FillHistory(tank=tank, rows=tuple(rows), reason=tuple(reasons), time=t, acceleration=np.array(a))


def _doubts(tanks: Sequence[Tank | None]) -> list[Doubt | None]:
    """Return what the points of a contour leave open at each fill: at some depths, and the greater of two between."""
    found: list[Doubt | None] = [None] * len(tanks)
    there = [k for k, tank in enumerate(tanks) if tank is not None and isinstance(tank.shape, Contour)]
    if len(there) <= _DOUBTED:
        return found
    depth = {k: tank.depth for k, tank in enumerate(tanks) if k in there and tank is not None}
    there.sort(key=lambda k: depth[k])
    # evenly far apart in depth, and both ends: the doubt is of the wall near the surface
    wanted = np.linspace(depth[there[0]], depth[there[-1]], _DOUBTED)
    at = sorted({int(np.argmin([abs(depth[k] - z) for k in there])) for z in wanted} | {0, len(there) - 1})
    known: dict[int, Doubt | None] = {}
    for place in at:
        tank = tanks[there[place]]
        assert tank is not None
        assert isinstance(tank.shape, Contour)
        try:
            known[place] = doubt_of(tank.shape, tank.section, tank.modes + 1, tank.modes)
        except OutsideValidity:
            known[place] = None  # the row will say so; its neighbours find their own
    for low, high in pairwise(at):
        a, b = known[low], known[high]
        for place in range(low, high + 1):
            own = known.get(place)
            found[there[place]] = own or (a.beside(b) if a and b else None)
    return found
