"""What is left for each mode of a loop: its crossings, minima and lobe; each column is another quantity.

Where a pole crosses the axis outwards is told by the slope of L at the crossing, whatever the other poles do. Raise the
gain by dk/k: ds = -1 / (d ln L / ds) dk/k, outwards where the phase falls with frequency. Add a lag: outwards where the
gain falls with frequency. Only such crossings limit a mode; at the others it returns.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sloshpy.dynamics.poles import NEUTRAL, closed_loop_poles, open_loop_poles
from sloshpy.dynamics.response import transfer
from sloshpy.stability.distance import (
    disk_guarantee,
    disk_margin,
    fine_curve,
    log_slope,
    modulus_margin,
    static_loop,
    valleys,
)
from sloshpy.stability.margins import AUDIBLE, RIGID, Margins, Points, mode_shares
from sloshpy.stability.nichols import nichols_disc_margin
from sloshpy.units import Array, BoolArray, ComplexArray

AERODYNAMIC = "aerodynamic"


class Reading(NamedTuple):
    """A value and the frequency in rad/s where it is read; nan where there is no frequency."""

    value: float
    omega: float


UNKNOWN = Reading(np.nan, np.nan)


@dataclass(frozen=True, kw_only=True)
class ModeMargins:
    """One mode's row. Margins and distances are nan where the loop is unstable, all but the signed `nichols`.

    kind: "aerodynamic", "rigid", "slosh", "flexible".
    label: "gain-stabilised": |L| < 1 over the whole lobe, so that no phase destabilises it; "phase-stabilised": above
    0 dB somewhere; "unstable": a pole of the mode grows; "neutral"; "no lobe": L does not show the mode; "": the rigid
    body, which has no lobe, or a lobe above 0 dB where another mode makes the loop unstable.
    gain_up, gain_down: ratios to which the loop gain may rise and fall until this mode grows; inf and 0 where no
    crossing within 40 dB limits it. gain_needed: of an unstable loop, the ratio nearest 1 at which a pole of this mode
    returns to the left half-plane; nan where none does.
    phase_lag, phase_lead: rad, 0 to 2 pi, the same at every frequency, until this mode grows; inf where none does it.
    delay: s, the extra delay until this mode grows.
    nichols: disc margin of eq 24, negative where the loop is unstable. modulus: |1 + L|. disk: alpha of skew 0. Each at
    the least of the local minima that belong to the mode; inf where none does.
    peak: |L| at the top of the lobe, with peak_phase in rad from -2 pi to 0; inf and nan on an undamped pole.
    """

    mode: str
    kind: str
    label: str
    gain_up: Reading = UNKNOWN
    gain_down: Reading = UNKNOWN
    gain_needed: Reading = UNKNOWN
    phase_lag: Reading = UNKNOWN
    phase_lead: Reading = UNKNOWN
    delay: Reading = UNKNOWN
    nichols: Reading = UNKNOWN
    modulus: Reading = UNKNOWN
    disk: Reading = UNKNOWN
    peak: Reading = UNKNOWN
    peak_phase: float = np.nan

    @property
    def disk_guarantee(self) -> tuple[float, float]:
        """Gain ratio (up; its inverse down) and phase in rad, each alone, that `disk` allows near this mode."""
        return disk_guarantee(self.disk.value)


@dataclass(frozen=True, kw_only=True)
class Marks:
    """Points on the curve of one loop: rad/s, what was found there, the mode it belongs to and d ln L / ds."""

    omega: Array
    value: Array
    mode: tuple[str, ...]
    slope: ComplexArray

    def of(self, mode: str, chosen: BoolArray | bool = True) -> list[Reading]:
        """Return the points of a mode, those chosen."""
        own = np.array([name == mode for name in self.mode], dtype=bool) & chosen
        return [Reading(float(self.value[k]), float(self.omega[k])) for k in np.flatnonzero(own)]


def mode_margins(found: Margins, growing: int) -> tuple[ModeMargins, ...]:
    """Return the rows of one loop; the aerodynamic one only where the broken loop grows because of the air.

    Args:
        found: margins of one loop.
        growing: poles of the broken loop in the right half-plane.
    """
    loop, divergent = found.source, growing > 0 and found.source.plant.velocity_only
    omega, curve = fine_curve(loop, found.criteria)
    static = static_loop(loop)

    def nichols(L: ComplexArray) -> Array:
        return nichols_disc_margin(L, found.criteria.gain_margin, found.criteria.phase_margin)

    def marks(points: tuple[Array, Array]) -> Marks:
        return _marks(found, divergent, static, float(omega[0]), *points)

    gain = marks(_listed(found.gain_crossings))
    phase = marks(_with_static_crossing(_listed(found.phase_crossings), static))
    minima, modulus, disk = (
        marks(valleys(loop, omega, curve, static, distance)) for distance in (nichols, modulus_margin, disk_margin)
    )
    stable = bool(found.stable)
    sound = stable and not bool(found.neutral)
    tops = _lobe_tops(found, omega, curve)
    names = [*([AERODYNAMIC] if divergent else []), RIGID, *found.groups[:-1]]
    kinds = {RIGID: "rigid", AERODYNAMIC: AERODYNAMIC} | dict.fromkeys(loop.plant.modes, "flexible")
    growth = _growth(found, divergent, phase)
    rows = []
    for mode in names:
        peak, peak_phase = tops.get(mode, (UNKNOWN, np.nan))
        row = ModeMargins(
            mode=mode,
            kind=kinds.get(mode, "slosh"),
            label=growth.get(mode) or ("" if mode in (RIGID, AERODYNAMIC) else _label(peak, sound)),
            nichols=_signed(_least(minima.of(mode)), stable),
            peak=peak,
            peak_phase=peak_phase,
            **(_limits(mode, gain, phase, modulus, disk) if sound else {"gain_needed": _needed(mode, phase)}),
        )
        rows.append(row)
    return tuple(rows)


def _limits(mode: str, gain: Marks, phase: Marks, modulus: Marks, disk: Marks) -> dict[str, Reading]:
    """Return what a stable loop leaves to one mode."""
    turn = 2.0 * np.pi
    falls, sinks = phase.slope.real < 0.0, gain.slope.imag > 0.0  # phase and gain, with frequency
    lag = [Reading(float(value % turn), w) for value, w in gain.of(mode, sinks)]
    lead = [Reading(float(-value % turn), w) for value, w in gain.of(mode, ~sinks)]
    down = [Reading(1.0 / ratio, w) for ratio, w in phase.of(mode, ~falls & (phase.value < 1.0))]
    fall = _least(down)
    return {
        "gain_up": _least(phase.of(mode, falls & (phase.value > 1.0))),
        "gain_down": Reading(1.0 / fall.value, fall.omega),
        "phase_lag": _least(lag),
        "phase_lead": _least(lead),
        "delay": _least([Reading(angle / w, w) for angle, w in lag]),
        "modulus": _least(modulus.of(mode)),
        "disk": _least(disk.of(mode)),
    }


def _needed(mode: str, phase: Marks) -> Reading:
    """Return the ratio nearest 1 at which a pole of the mode comes back; nan if none."""
    back = (phase.slope.real < 0.0) == (phase.value < 1.0)
    return min(phase.of(mode, back), key=lambda reading: abs(np.log(reading.value)), default=UNKNOWN)


def _least(readings: list[Reading]) -> Reading:
    return min(readings, default=Reading(np.inf, np.nan))


def _signed(reading: Reading, stable: bool) -> Reading:
    return reading if stable else Reading(-reading.value, reading.omega)


def _listed(points: Points) -> tuple[Array, Array]:
    known = np.isfinite(points.omega)
    return points.omega[known], points.value[known]


def _with_static_crossing(points: tuple[Array, Array], static: float) -> tuple[Array, Array]:
    """Add the crossing at zero frequency, where the attitude diverges without oscillation if the gain is too low."""
    if not (static < 0.0 and abs(np.log(-static)) < AUDIBLE):
        return points
    return np.append(points[0], 0.0), np.append(points[1], -1.0 / static)


def _marks(found: Margins, divergent: bool, static: float, least: float, omega: Array, value: Array) -> Marks:
    """Return points with the mode each belongs to; `least` is a frequency below every pole and zero, rad/s."""
    loop = found.source
    L = np.where(omega > 0.0, transfer(loop.along(), 1j * np.where(omega > 0.0, omega, least)).loop, static)
    slope = log_slope(loop, omega, least)
    owner = _owners(found, np.where(omega > 0.0, omega, least))
    # the rigid body is lost to the air where the gain is what is short, and raising it leads away from -1
    excess = np.abs(np.log(np.abs(L))) / np.log(found.criteria.gain_margin)
    low = divergent & (excess > np.abs(np.angle(-L)) / found.criteria.phase_margin) & (slope.real > 0.0)
    mode = tuple(AERODYNAMIC if name == RIGID and air else name for name, air in zip(owner, low, strict=True))
    return Marks(omega=omega, value=value, mode=mode, slope=slope)


def _owners(found: Margins, omega: Array) -> list[str]:
    """Return the group whose frequency the neutral loop follows most at each frequency."""
    share = mode_shares(found.source, np.zeros(len(omega), dtype=int), omega)
    return [found.groups[int(k)] for k in np.argmax(np.where(np.isnan(share), -np.inf, share), axis=-1)]


def _lobe_tops(found: Margins, omega: Array, curve: ComplexArray) -> dict[str, tuple[Reading, float]]:
    """Return |L| at the top of each mode's lobe and the phase there; a mode that owns no part of the curve has none."""
    from scipy.optimize import elementwise  # 0.4 s: only when margins are wanted

    loop, size = found.source, np.abs(curve)
    owner = np.array(_owners(found, omega))
    poles = open_loop_poles(loop)
    undamped = {
        name: float(p.imag)
        for p, name in zip(poles.value, poles.name, strict=True)
        if abs(p.real) <= NEUTRAL * abs(p) and p.imag > 0.0
    }
    tops = {}
    for mode in found.groups[:-1]:
        own = np.flatnonzero(owner == mode)
        if len(own) == 0:
            continue
        if mode in undamped:
            tops[mode] = Reading(np.inf, undamped[mode]), np.nan
            continue
        k = int(own[np.argmax(size[own])])
        w = float(omega[k])
        if 0 < k < len(omega) - 1 and size[k] > max(size[k - 1], size[k + 1]):
            found_top = elementwise.find_minimum(
                lambda w: -np.abs(transfer(loop.along(), 1j * w).loop),
                (omega[k - 1 : k], omega[k : k + 1], omega[k + 1 : k + 2]),
                tolerances={"xrtol": 1e-11, "frtol": 1e-15},
            )
            w = float(found_top.x[0])
        L = complex(transfer(loop, np.asarray(1j * w)).loop)
        tops[mode] = Reading(abs(L), w), float(np.angle(-L) - np.pi)
    return tops


def _label(peak: Reading, sound: bool) -> str:
    if np.isnan(peak.value):
        return "no lobe"
    if peak.value < 1.0:
        return "gain-stabilised"
    return "phase-stabilised" if sound else ""


def _growth(found: Margins, divergent: bool, phase: Marks) -> dict[str, str]:
    """Return the modes whose closed-loop pole grows or is neutral, in words."""
    poles = closed_loop_poles(found.source)
    words = {}
    for p, name in zip(poles.value, poles.name, strict=True):
        if not p.real >= -NEUTRAL * abs(p):
            continue
        mode = name if name in found.groups else RIGID
        # a rigid body that only a higher gain holds is the air's
        short = mode == RIGID and divergent and any(r.value > 1.0 for r in phase.of(AERODYNAMIC))
        words[AERODYNAMIC if short else mode] = "unstable" if p.real > NEUTRAL * abs(p) else "neutral"
    return words
