"""Closed-loop modes followed along a parameter or a flight: who takes part in each, and where tanks trade modes.

Two modes whose frequencies approach do not cross: they veer, and each leaves with the other's shape. "The damping of
mode 1" is then one tank's before and another's after.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.case import Case
from sloshpy.dynamics.loop import open_loop
from sloshpy.stability.between import single_cases
from sloshpy.stability.follow import Link, Station, followed, station
from sloshpy.stability.veering import Veering, exchanges
from sloshpy.units import Array, ComplexArray, IntArray, Real

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, kw_only=True)
class ModeTracks:
    """The modes of a loop along a parameter; branch n keeps its number however its shape changes.

    parameter: (P,). pole: (P, N), rad/s, nan where a branch is not there (two real poles that have become a pair, a
    pole of the delay). label: what takes part most in branch n at point p, label[p][n], "" where it is not there.
    participation: (P, N, n_tanks), share of each tank's slosh. damping: (P, n_tanks), slosh damping ratios.
    veering: modes that exchange tanks. unresolved: intervals in which some mode could not be followed, and why; its
    branch ends there and another begins.
    """

    cases: tuple[Case, ...]
    name: str
    unit: str
    parameter: Array
    damping: Array
    pole: ComplexArray
    label: tuple[tuple[str, ...], ...]
    participation: Array
    veering: tuple[Veering, ...]
    unresolved: tuple[tuple[float, float, str], ...]

    @property
    def tanks(self) -> tuple[str, ...]:
        """Names of the tanks."""
        return tuple(tank.name for tank in self.cases[0].vehicle.tanks)

    @property
    def f_hz(self) -> Array:
        """Frequencies in Hz, (P, N)."""
        return np.asarray(self.pole.imag / (2.0 * np.pi))

    @property
    def damping_ratio(self) -> Array:
        """-Re s / |s|, (P, N)."""
        return np.asarray(-self.pole.real / np.maximum(np.abs(self.pole), 1e-300))

    @property
    def slosh(self) -> tuple[int, ...]:
        """Branches that are some tank's at some point."""
        own = {f"{tank} slosh" for tank in self.tanks}
        return tuple(n for n in range(self.pole.shape[1]) if any(row[n] in own for row in self.label))

    @property
    def window(self) -> tuple[float, float]:
        """Frequencies worth showing, Hz: those of the slosh branches and a little about them."""
        own = self.f_hz[:, list(self.slosh)] if self.slosh else self.f_hz
        known = own[np.isfinite(own)]
        low, high = float(np.min(known)), float(np.max(known))
        margin = max(0.08 * (high - low), 0.02 * high)
        return low - margin, high + margin

    def runs(self, n: int) -> list[tuple[str, int, int]]:
        """Return the stretches of branch n of one label: the label, its first point and the point where it ends.

        A stretch reaches to the next one's first point, so that drawn stretches leave no hole.
        """
        names = [row[n] for row in self.label]
        found, start = [], 0
        for p in range(1, len(names) + 1):
            if p == len(names) or names[p] != names[start]:
                last = p if p < len(names) and names[p] else p - 1
                if names[start]:
                    found.append((names[start], start, last))
                start = p
        return found

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        first, last = self.parameter[[0, -1]]
        count = f"{self.pole.shape[1]} modes, {len(self.parameter)} cases"
        lines = [f"{count} along {self.name} from {first:.4g} to {last:.4g}{unit}"]
        for v in self.veering:
            one, other = (n + 1 for n in v.modes)
            lines.append(
                f"  modes {one} and {other} exchange tanks ({' and '.join(v.tanks)}) "
                f"between {self.name} = {v.start:.4g} and {v.end:.4g}{unit}; gap {v.gap_hz:.4f} Hz at {v.at:.4g}{unit}"
            )
        for start, end, reason in self.unresolved:
            lines.append(f"  unresolved between {self.name} = {start:.4g} and {end:.4g}{unit}: {reason}")
        lines.append(f"  {'mode':>4s} {'Hz':>19s} {'damping':>21s} {'least':>10s}  of")
        lines += [self._line(n) for n in range(self.pole.shape[1])]
        return "\n".join(lines)

    def _line(self, n: int) -> str:
        there = np.flatnonzero(np.isfinite(self.pole[:, n]))
        a, b = int(there[0]), int(there[-1])
        ratio, f = 100.0 * self.damping_ratio[:, n], self.f_hz[:, n]
        who = list(dict.fromkeys(self.label[p][n] for p in there))
        part = (
            ""
            if len(there) == len(self.parameter)
            else f", from {self.parameter[a]:.4g} to {self.parameter[b]:.4g} only"
        )
        least = np.min(ratio[there])
        return (
            f"  {n + 1:4d} {f[a]:8.4f} to {f[b]:7.4f} {ratio[a]:8.3f} to {ratio[b]:7.3f} % {least:+8.3f} %  "
            f"{', then '.join(who)}{part}"
        )

    def to_dataset(self) -> "xr.Dataset":
        """Return the branches as an xarray Dataset over the parameter; real and imaginary parts apart."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        axes = ["point", "mode"]
        return xr.Dataset(
            {
                "growth": (axes, self.pole.real, {"units": "1/s"}),
                "omega": (axes, self.pole.imag, {"units": "rad/s"}),
                "damping_ratio": (axes, self.damping_ratio, {"units": "1"}),
                "label": (axes, [list(row) for row in self.label]),
                "participation": ([*axes, "tank"], self.participation, {"units": "1"}),
                "slosh_damping": (["point", "tank"], self.damping, {"units": "1"}),
            },
            coords={
                "parameter": ("point", self.parameter, {"units": self.unit or "1", "long_name": self.name}),
                "mode": np.arange(1, self.pole.shape[1] + 1),
                "tank": list(self.tanks),
            },
            attrs={
                "exchanges": "; ".join(f"{v.modes[0] + 1} and {v.modes[1] + 1}" for v in self.veering),
                "unresolved": "; ".join(f"{a:g} to {b:g}" for a, b, _ in self.unresolved),
            },
        )


def track_modes(
    cases: Case | Sequence[Case],
    parameter: Array,
    damping: Real | None = None,
    name: str = "parameter",
    unit: str = "",
) -> ModeTracks:
    """Follow the closed-loop poles along a parameter and flag the modes that exchange tanks.

    Args:
        cases: a batch with one leading axis, or single cases in order.
        parameter: (P,), increasing: what the cases stand at, as a time or a tank's frequency; only read, never set.
        damping: slosh damping ratios, one for all tanks, (n_tanks,) or (P, n_tanks); default: each case's laws at
            small amplitude.
        name, unit: of the parameter, for the text and the plot.

    Raises:
        ValueError: not one axis, another number of cases than of parameters, or a parameter that does not increase.
    """
    single = single_cases(cases)
    x = np.asarray(parameter, dtype=float)
    if x.shape != (len(single),) or not np.all(np.diff(x) > 0.0) or not np.all(np.isfinite(x)):
        raise ValueError(f"the parameter must be {len(single)} finite, increasing values, one for each case")
    if len({tuple(t.name for t in case.vehicle.tanks) for case in single}) > 1:
        raise ValueError("the cases must have the same tanks in the same order")
    xi = _dampings(single, damping)
    stations = [station(case, ratio) for case, ratio in zip(single, xi, strict=True)]
    links = [followed(a, b) for a, b in pairwise(stations)]
    branch = _branches(stations, links)
    label = tuple(
        tuple(s.poles.name[s.kept[k]] if k >= 0 else "" for k in row) for s, row in zip(stations, branch, strict=True)
    )
    return ModeTracks(
        cases=single,
        name=name,
        unit=unit,
        parameter=x,
        damping=xi,
        pole=np.array([np.where(row >= 0, s.value[row], np.nan) for s, row in zip(stations, branch, strict=True)]),
        label=label,
        participation=np.array([_tank_shares(s, row) for s, row in zip(stations, branch, strict=True)]),
        veering=exchanges(x, stations, label),
        unresolved=tuple((float(x[k]), float(x[k + 1]), link.reason) for k, link in enumerate(links) if link.reason),
    )


def _dampings(cases: Sequence[Case], damping: Real | None) -> Array:
    """Return the slosh damping ratios of each case, (P, n_tanks)."""
    if damping is None:
        return np.array([open_loop(case).damping for case in cases])
    given = np.asarray(damping, dtype=float)
    if given.ndim == 2 and len(given) != len(cases):
        raise ValueError(f"damping has {len(given)} rows for {len(cases)} cases")
    rows = given if given.ndim == 2 else [given] * len(cases)
    return np.array([open_loop(case, row).damping for case, row in zip(cases, rows, strict=True)])


def _branches(stations: Sequence[Station], links: Sequence[Link]) -> IntArray:
    """Return which pole of each station stands on each branch, (P, N), -1 where none.

    Slosh first, then by rising frequency at the first point; branches that begin later come last.
    """
    first = stations[0]
    order = sorted(
        range(len(first.value)), key=lambda k: (first.poles.tank[first.kept[k]] is None, first.value[k].imag)
    )
    rows: list[dict[int, int]] = [dict(enumerate(order))]
    count = len(order)
    for s, link in zip(stations[1:], links, strict=True):
        row = {n: link.pairs[k] for n, k in rows[-1].items() if k in link.pairs}
        for k in sorted(set(range(len(s.value))) - set(row.values()), key=lambda k: s.value[k].imag):
            row[count] = k
            count += 1
        rows.append(row)
    return np.array([[row.get(n, -1) for n in range(count)] for row in rows])


def _tank_shares(s: Station, row: IntArray) -> Array:
    """Return the share of each tank's slosh in the poles of a row, (N, n_tanks), nan where there is none."""
    column = [s.poles.groups.index(f"{t.name} slosh") for t in s.case.vehicle.tanks]
    shares = s.poles.participation[s.kept][:, column]
    return np.asarray(np.where((row >= 0)[:, None], shares[row], np.nan))
