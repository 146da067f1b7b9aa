"""Margins of one loop, one row for each mode: the first table an engineer asks for."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.poles import NEUTRAL
from sloshpy.dynamics.states import system_matrix
from sloshpy.errors import OutsideValidity
from sloshpy.stability.distance import disk_guarantee
from sloshpy.stability.margins import Margins, margins
from sloshpy.stability.mode_margins import ModeMargins, Reading, mode_margins
from sloshpy.units import Real

if TYPE_CHECKING:
    import xarray as xr

COLUMNS = {
    "gain_up": "1",
    "gain_down": "1",
    "gain_needed": "1",
    "phase_lag": "rad",
    "phase_lead": "rad",
    "delay": "s",
    "nichols": "1",
    "modulus": "1",
    "disk": "1",
    "peak": "1",
}
ENDS = {"modulus": 1.0, "disk": 2.0}  # where |L| -> 0: the value where no minimum of the curve is less


def decibels(ratio: float) -> float:
    """Return an amplitude ratio in dB; -inf for 0."""
    with np.errstate(divide="ignore"):
        return float(20.0 * np.log10(ratio))


def _known(value: float, how: str) -> str:
    return format(value, how) if np.isfinite(value) else "-"


def _lobe(row: ModeMargins) -> str:
    if np.isinf(row.peak.value):
        return "undamped"
    return f"{_known(decibels(row.peak.value), '+.1f')} {_known(np.degrees(row.peak_phase), '6.0f'):>6s}"


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of the printed table; "-" where nothing limits the mode."""

    name: str
    unit: str
    width: int
    text: Callable[[ModeMargins], str]
    when: str = "always"


SHOWN = (
    Column(name="gain up", unit="dB", width=7, when="stable", text=lambda r: _known(decibels(r.gain_up.value), "+.2f")),
    Column(name="down", unit="dB", width=7, when="stable", text=lambda r: _known(decibels(r.gain_down.value), "+.2f")),
    Column(
        name="needed", unit="dB", width=7, when="unstable", text=lambda r: _known(decibels(r.gain_needed.value), "+.2f")
    ),
    Column(name="lag", unit="deg", width=6, when="stable", text=lambda r: _known(np.degrees(r.phase_lag.value), ".1f")),
    Column(
        name="lead", unit="deg", width=6, when="stable", text=lambda r: _known(np.degrees(r.phase_lead.value), ".1f")
    ),
    Column(name="delay", unit="s", width=7, when="stable", text=lambda r: _known(r.delay.value, ".4g")),
    Column(name="nichols", unit="", width=8, text=lambda r: _known(r.nichols.value, ".4f")),
    Column(name="at", unit="Hz", width=7, text=lambda r: _known(r.nichols.omega / (2.0 * np.pi), ".4f")),
    Column(name="modulus", unit="", width=7, when="stable", text=lambda r: _known(r.modulus.value, ".4f")),
    Column(name="disk", unit="", width=7, when="stable", text=lambda r: _known(r.disk.value, ".4f")),
    Column(name="lobe's peak", unit="dB    deg", width=12, text=_lobe),
)


@dataclass(frozen=True, kw_only=True)
class MarginTable:
    """Margins by mode: aerodynamic, rigid body, slosh of each tank, bending modes.

    growing: open-loop poles in the right half-plane: as often the curve must go round -1, counter-clockwise.
    case, source: what the table was made from.
    """

    rows: tuple[ModeMargins, ...]
    growing: int
    case: Case
    source: Margins

    @property
    def stable(self) -> bool:
        """Whether the loop is stable beyond rounding; if not, it has no margins."""
        return bool(self.source.stable) and not bool(self.source.neutral)

    @property
    def shown(self) -> tuple[Column, ...]:
        """The columns worth printing: an unstable loop has no margins."""
        return tuple(c for c in SHOWN if c.when in ("always", "stable" if self.stable else "unstable"))

    def row(self, mode: str) -> ModeMargins:
        """Return the row of a mode by its name, as "LOX slosh"."""
        return next(row for row in self.rows if row.mode == mode)

    def least(self, column: str) -> tuple[str, Reading]:
        """Return the mode that limits the loop in a column, as "delay", and its reading; of "gain_down" the greatest.

        Every minimum stands in some row; where none is less, the curve's end at 0 counts for "modulus" and "disk".
        """
        sign = -1.0 if column == "gain_down" else 1.0
        row = min(self.rows, key=lambda row: sign * getattr(row, column).value)
        reading: Reading = getattr(row, column)
        end = ENDS.get(column, np.inf)
        return ("", Reading(end, np.nan)) if reading.value > end else (row.mode, reading)

    def __str__(self) -> str:
        shown = self.shown
        wide = max(len(row.mode) for row in self.rows)
        lines = [
            f"  {'':{wide}s} " + " ".join(f"{text:>{c.width}s}" for c, text in zip(shown, texts, strict=True))
            for texts in ([c.name for c in shown], [c.unit for c in shown])
        ]
        for row in self.rows:
            cells = " ".join(f"{c.text(row):>{c.width}s}" for c in shown)
            lines.append(f"  {row.mode:{wide}s} {cells}  {row.label}".rstrip())
        return "\n".join([*self.verdict(), *(line.rstrip() for line in lines)])

    def verdict(self) -> list[str]:
        """Return what holds for the loop as a whole, in one or two lines."""
        m = self.source
        lines = []
        if self.growing:
            poles = "pole grows" if self.growing == 1 else "poles grow"
            lines.append(
                f"{self.growing} {poles} in the broken loop: it is stable only with enough gain"
                + (", see gain down" if m.stable else "")
            )
        if m.neutral:
            return ["NEUTRAL: no margin is left", *lines]
        if not m.stable:
            return [f"UNSTABLE, grows at {float(m.growth):.4g} 1/s: an unstable loop has no margins", *lines]
        words = ["stable"]
        mode, delay = self.least("delay")
        if np.isfinite(delay.value):
            words.append(f"delay margin {delay.value:.4g} s ({mode})")
        alpha = self.least("disk")[1].value
        gain, phase = disk_guarantee(alpha)
        safe = f"stays stable within {decibels(gain):.2f} dB, or within {np.degrees(phase):.1f} deg"
        return ["; ".join([*words, f"disk margin {alpha:.4f}: {safe}"]), *lines]

    def to_dataset(self) -> "xr.Dataset":
        """Return the table as an xarray Dataset over the modes; each value with the frequency where it is read."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        data: dict[str, object] = {
            "label": ("mode", [row.label for row in self.rows]),
            "peak_phase": ("mode", [row.peak_phase for row in self.rows], {"units": "rad"}),
        }
        for name, unit in COLUMNS.items():
            data[name] = ("mode", [getattr(row, name).value for row in self.rows], {"units": unit})
            data[f"{name}_omega"] = ("mode", [getattr(row, name).omega for row in self.rows], {"units": "rad/s"})
        return xr.Dataset(
            data,
            coords={"mode": [row.mode for row in self.rows], "kind": ("mode", [row.kind for row in self.rows])},
            attrs={"stable": int(self.stable), "open_loop_growing_poles": self.growing},
        )


def margin_table(case: Case, damping: Real | None = None, amplitude: Real | None = None) -> MarginTable:
    """Return the margins of a case by mode, at given slosh damping or amplitude (default: small amplitude).

    A crossing or a minimum belongs to the mode whose frequency its neutral frequency follows most (`Points.share`). Of
    a vehicle that the air makes unstable, the points at which a falling gain loses the rigid body are a row of their
    own. The least of each column over the rows is the loop's.

    Args:
        case: one vehicle and autopilot, no batch.
        damping: slosh damping ratios, one for all tanks or one for each.
        amplitude: slosh amplitudes in m, likewise.

    Raises:
        OutsideValidity: poles and encirclement count disagree, so that nothing is known.
    """
    single(case, "margin_table")
    found = margins(case, damping, amplitude)
    if not found.trusted:
        raise OutsideValidity("poles and encirclement count disagree on stability: no margin is shown")
    growing = _growing(found.source)
    return MarginTable(rows=mode_margins(found, growing), growing=growing, case=case, source=found)


def _growing(loop: Loop) -> int:
    """Count poles of the broken loop in the right half-plane; those at the origin, which attitude has, are none."""
    poles = np.linalg.eigvals(system_matrix(loop, closed=False)[0])
    size = np.abs(poles)
    slow = 0.0 if loop.plant.velocity_only else 1e-4 * np.min(loop.plant.tank_frequency, initial=float(np.max(size)))
    return int(np.sum((poles.real > NEUTRAL * size) & (size > slow)))
