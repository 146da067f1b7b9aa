"""The whole review of one case: margins, danger zone, required damping, limit cycles, and one verdict with reasons."""

import functools
import json
import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.damping.validity import words_on_radius
from sloshpy.dynamics import Poles, closed_loop_poles, open_loop
from sloshpy.dynamics.poles import NEUTRAL
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle import Cycle, LimitCycle, limit_cycles, predict_limit_cycle
from sloshpy.stability import (
    DangerZone,
    Margins,
    RequiredDamping,
    danger_zone,
    joint_damping,
    loop_margins,
    required_damping,
)
from sloshpy.stability.folding import folding
from sloshpy.stability.margins import in_unit
from sloshpy.units import Array, Real

if TYPE_CHECKING:
    import xarray as xr

HEAVY_SLOSH = 0.05  # mass-matrix margin below which the slosh model itself is doubtful


@dataclass(frozen=True, kw_only=True)
class TankReview:
    """What was found for one tank; angles in rad, lengths in m, frequencies in rad/s.

    damping_ratio: at which the loop was read. limit_cycle: with the other tanks where all meet the margin together.
    disc_margin, omega: the tank's own, signed; inf and nan where no minimum of the disc margin belongs to it.
    """

    name: str
    damping_ratio: float
    disc_margin: float
    omega: float
    zone: DangerZone
    limit_cycle: LimitCycle

    @functools.cached_property
    def required(self) -> RequiredDamping:
        """Neutral and required damping with the other tanks at small amplitude; found when first asked for."""
        case = self.limit_cycle.case
        return self.limit_cycle.required if len(case.vehicle.tanks) == 1 else required_damping(case, self.name)


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """The review of one case; `reasons` are worst first.

    verdict: "pass", "fail", or "invalid" where the model supports no verdict.
    cycles: limit cycles of the loop as given; None where one sinusoid predicts none (a reason says so).
    read_at: how the damping of the loop properties was chosen, in words.
    other_disc_margin: least disc margin that belongs to no tank; inf where there is none.
    """

    case: Case
    verdict: str
    reasons: tuple[str, ...]
    read_at: str
    poles: Poles
    margins: Margins
    tanks: tuple[TankReview, ...]
    cycles: tuple[Cycle, ...] | None
    other_disc_margin: float

    @property
    def worst_tvc_amplitude(self) -> float:
        """Greatest engine amplitude of the tanks' limit cycles, rad; nan where no number is supported for one."""
        amplitudes = [t.limit_cycle.worst_tvc_amplitude for t in self.tanks if t.limit_cycle.band.size]
        return float(np.max(amplitudes)) if amplitudes else 0.0

    def __str__(self) -> str:
        m = self.margins
        lines = [f"{self.verdict.upper()}  {self.case.name}", *(f"  - {reason}" for reason in self.reasons), ""]
        if not m.trusted:
            return "\n".join(lines[:-1])
        state = "NEUTRAL" if m.neutral else "stable" if m.stable else "UNSTABLE"
        lines.append(f"Loop ({self.read_at}): {state}, nichols disc margin {float(m.nichols_disc_margin):+.4f}")
        lines.append(str(self.poles))
        lines += m.lines()
        lines.append("")
        for tank in self.tanks:
            lines += [str(tank.zone), tank.limit_cycle.summary()]
        lines += [str(cycle) for cycle in self.cycles or ()]
        return "\n".join(lines)

    def to_json(self) -> str:
        """Return the review as one JSON object in SI units; null where not applicable."""
        return json.dumps(_plain(self._contract()), indent=1, allow_nan=False)

    def _contract(self) -> dict[str, Any]:
        m, p, hertz = self.margins, self.poles, 2.0 * np.pi
        loop: dict[str, Any] = dict.fromkeys(("stable", "modes", "disc_margin", "minima", "crossings"))
        if m.trusted:
            loop = {
                "stable": bool(m.stable),
                "modes": [
                    {
                        "name": name,
                        "kind": kind,
                        "tank": tank,
                        "frequency_hz": value.imag / hertz,
                        "damping_ratio": ratio,
                        "growth_rate": value.real,
                        "time_to_double": double,
                    }
                    for value, name, kind, tank, ratio, double in zip(
                        p.value, p.name, p.kind, p.tank, p.damping_ratio, p.time_to_double, strict=True
                    )
                ],
                "disc_margin": {
                    "value": float(m.nichols_disc_margin),
                    "frequency_hz": m.minima.omega[0] / hertz,
                    "mode": m.groups[int(m.mode(m.minima)[0])],
                },
                "minima": [
                    {"disc_margin": v, "frequency_hz": w / hertz, "mode": group} for w, v, group in m.listed(m.minima)
                ],
                "crossings": [
                    {
                        "kind": "gain",
                        "frequency_hz": w / hertz,
                        "margin_db": None,
                        "margin_deg": in_unit(v, "deg"),
                        "mode": g,
                    }
                    for w, v, g in m.listed(m.gain_crossings)
                ]
                + [
                    {
                        "kind": "phase",
                        "frequency_hz": w / hertz,
                        "margin_db": in_unit(v, "dB"),
                        "margin_deg": None,
                        "mode": g,
                    }
                    for w, v, g in m.listed(m.phase_crossings)
                ],
            }
        cycles = None
        if self.cycles is not None:
            cycles = [_cycle(cycle) for cycle in self.cycles]
        head = {"name": self.case.name, "verdict": self.verdict, "reasons": list(self.reasons)}
        tanks = [_tank(tank, m.trusted) | (_UNKNOWN if m.folded else {}) for tank in self.tanks]
        return head | loop | {"tanks": tanks, "limit_cycles": cycles}

    def to_dataset(self) -> "xr.Dataset":
        """Return the margins of the review as an xarray Dataset; verdict and reasons are its attributes."""
        return self.margins.to_dataset().assign_attrs(
            case=self.case.name, verdict=self.verdict, reasons=list(self.reasons)
        )


def assess(case: Case, damping: Real | None = None, amplitude: Real | None = None) -> Assessment:
    """Review one case by the paper's method and return the verdict with everything it rests on.

    Loop properties (poles, margins, crossings) hold at the given damping or amplitude, by default at each tank's small
    amplitude; required damping and limit cycles come from each tank's law.

    Args:
        case: one vehicle with at least one tank, its autopilot and criteria.
        damping: slosh damping ratios, one for all tanks or one for each.
        amplitude: slosh amplitudes in m, likewise.

    Raises:
        OutsideValidity: an amplitude beyond a tank's damping data, where the loop has no known damping.
    """
    single(case, "assess")
    if not case.vehicle.tanks:
        raise ValueError("no tank: there is no slosh to assess")
    loop = open_loop(case, damping, amplitude)
    found, poles = loop_margins(loop, case.criteria), closed_loop_poles(loop)
    folded = folding(found)
    if folded is not None and not folded.tolerated:
        found = replace(found, folded=True)
    others = joint_damping(case)
    tanks = tuple(_review(case, j, loop.damping, found, others) for j in range(len(case.vehicle.tanks)))
    cycles: tuple[Cycle, ...] | None = None
    unsupported = ""
    try:
        cycles = None if found.folded else limit_cycles(case)
    except OutsideValidity as error:
        unsupported = str(error)
    verdict, reasons = _verdict(case, found, poles, tanks, cycles, unsupported)
    if folded is not None:  # without a model that holds there is nothing else to say
        reasons = (str(folded),) if found.folded else (*reasons, str(folded))
    return Assessment(
        case=case,
        verdict=verdict,
        reasons=reasons,
        read_at=_read_at(case, loop.damping, damping, amplitude),
        poles=poles,
        margins=found,
        tanks=tanks,
        cycles=cycles,
        other_disc_margin=float(np.min(_other_minima(found, len(tanks)))),
    )


def _review(case: Case, tank: int, damping: Array, found: Margins, others: Array) -> TankReview:
    margin, omega = found.slosh_disc_margin(tank)
    cycle = predict_limit_cycle(case, tank, others)
    return TankReview(
        name=case.vehicle.tanks[tank].name,
        damping_ratio=float(damping[tank]),
        disc_margin=float(margin),
        omega=float(omega),
        zone=danger_zone(case, tank),
        limit_cycle=cycle,
    )


@dataclass(frozen=True, kw_only=True)
class _Findings:
    """What speaks for and against a case: no verdict, failures, cautions, what was met and what is told."""

    invalid: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)
    cautions: list[str] = field(default_factory=list)
    met: list[str] = field(default_factory=list)
    told: list[str] = field(default_factory=list)


def _verdict(
    case: Case,
    found: Margins,
    poles: Poles,
    tanks: tuple[TankReview, ...],
    cycles: tuple[Cycle, ...] | None,
    unsupported: str,
) -> tuple[str, tuple[str, ...]]:
    """Return the verdict and its reasons: no verdict, failures, cautions, then what was met."""
    all_ = _Findings()
    if not found.trusted:
        all_.invalid.append(
            "WITNESS: closed-loop poles and the encirclement count disagree on stability; no margin is given"
        )
    _judge_loop(all_, case, found, poles, len(tanks))
    _judge_tanks(all_, case, tanks)
    for one in cycles or ():
        if one.stable:
            far = one.on_radius(case).items()
            all_.invalid.extend(f"as given, {name}: {words}" for name, (words, beyond) in far if beyond)
        if one.stable and one.tvc_amplitude > case.criteria.tvc_amplitude:
            limit = np.degrees(case.criteria.tvc_amplitude)
            all_.failed.append(f"the loop as given has a {one}, more than {limit:.3g} deg")
        else:
            all_.told.append(f"the loop as given {'runs into a' if one.stable else 'grows away from an'} {one}")
    if unsupported:
        all_.invalid.append(unsupported)
    verdict = "invalid" if all_.invalid and not all_.failed else "fail" if all_.failed else "pass"
    if not found.trusted:
        verdict = "invalid"
    first = (*all_.failed, *all_.invalid) if verdict == "fail" else (*all_.invalid, *all_.failed)
    rest = (*all_.told, *all_.cautions)
    told = (*all_.met, *rest) if verdict == "pass" else (*first, *rest, *all_.met)
    return verdict, tuple(dict.fromkeys(told))  # two tanks may have the same to say


def _judge_loop(all_: _Findings, case: Case, found: Margins, poles: Poles, tanks: int) -> None:
    """Judge the modes that are no slosh, their disc margin, and slosh that nothing damps."""
    axis = NEUTRAL * float(np.max(found.source.plant.tank_frequency))
    laws = {tank.name: tank.damping for tank in case.vehicle.tanks}
    for value, name, kind, own in zip(poles.value, poles.name, poles.kind, poles.tank, strict=True):
        if kind == "slosh" and own is not None and abs(value.real) <= axis and np.isinf(laws[own].amplitude(1e-9)):
            all_.failed.append(
                f"{name} is neutral and has no damping at any amplitude: once moved it never comes to rest"
            )
        if kind == "slosh" or value.real < -axis:
            continue
        on_axis = value.real <= axis
        what = (
            "is neutral: its pole lies on the imaginary axis"
            if on_axis
            else f"is unstable: it grows at {value.real:.4g} 1/s"
            if np.isfinite(value)
            else "is not known: no pole of the loop is found near that of its approximation"
        )
        all_.failed.append(f"{name} mode {what}")
    other, wanted = _other_minima(found, tanks), case.criteria.disc_margin
    if np.min(other) < wanted:
        all_.failed.append(f"{_told_of(found, other)}, needs {wanted:g}")
    slosh = np.where(np.isinf(other), found.minima.value, np.inf)
    if found.stable and np.min(slosh, initial=np.inf) < wanted:
        all_.told.append(
            f"{_told_of(found, slosh)} with the damping given, below {wanted:g}: "
            "the limit cycle at degraded margins decides"
        )


def _told_of(found: Margins, value: Array) -> str:
    """Return the least of some values of the minima in words."""
    k = int(np.argmin(value))
    mode, where = found.groups[int(found.mode(found.minima)[k])], found.minima.omega[k] / (2.0 * np.pi)
    return f"{mode}: disc margin {value[k]:.3f} at {where:.4f} Hz"


def _judge_tanks(all_: _Findings, case: Case, tanks: tuple[TankReview, ...]) -> None:
    """Judge each tank's limit cycle, and say what its data leave open."""
    for tank in tanks:
        cycle = tank.limit_cycle
        target = {None: all_.invalid, False: all_.failed, True: all_.met}[cycle.acceptable]
        if np.isfinite(cycle.tvc_amplitude[1]) and cycle.acceptable is not None:
            worst, limit = np.degrees(cycle.worst_tvc_amplitude), np.degrees(cycle.tvc_limit)
            sign, angle = "<=" if worst <= limit else ">", f"{worst:.3f}" if worst <= 90.0 else "more than 90"
            target.append(
                f"{tank.name}: degraded by its whole margin it cycles with {cycle.worst_slosh_amplitude:.4g} m of "
                f"slosh and {angle} deg of engine, {sign} {limit:.3g} deg"
            )
            all_.cautions.extend(f"{tank.name}: {reason}" for reason in cycle.reasons)
        else:
            target.extend(f"{tank.name}: {reason}" for reason in cycle.reasons)
    _judge_coupled(all_, case, tanks)
    heavy = float(case.vehicle.mass_matrix_margin)
    if heavy < HEAVY_SLOSH:
        all_.cautions.append(f"caution: the mass matrix is nearly indefinite (1 - m/M - m l^2/I = {heavy:.3g})")
    all_.cautions.extend(case.source.notes if case.source is not None else ())
    for mass in case.vehicle.tanks:
        if mass.damping.smallest_amplitude > 0.0:
            all_.cautions.append(
                f"caution: {mass.name}: the damping data start at {mass.damping.smallest_amplitude:g} m; "
                "the loop at small amplitude was read there"
            )


def _judge_coupled(all_: _Findings, case: Case, tanks: tuple[TankReview, ...]) -> None:
    """Hold every tank to its radius in the cycles that another tank's margin leads to."""
    radius = {tank.name: tank.radius for tank in case.vehicle.tanks}
    told = {}  # what each tank's own limit cycle says already
    for tank in tanks:
        amplitude, R = tank.limit_cycle.worst_slosh_amplitude, radius[tank.name]
        told[tank.name] = words_on_radius(amplitude, float(R)) if R is not None else ("", False)
    for tank in tanks:
        with_it = f"degraded by the margin of {tank.name}, all tanks coupled"
        for one in (cycle for cycle in tank.limit_cycle.coupled if cycle.stable):
            for name, (words, beyond) in one.on_radius(case).items():
                if beyond and not told[name][1]:
                    all_.invalid.append(f"{name}: {with_it}: {words}")
                elif not told[name][0]:
                    all_.cautions.append(f"{name}: caution: {with_it}: {words}")


def _other_minima(found: Margins, tanks: int) -> Array:
    """Return the disc margins of the minima that belong to no tank, inf in the place of the rest."""
    shared = found.related(*range(tanks))
    return np.where(shared | ~np.isfinite(found.minima.value), np.inf, found.minima.value)


def _read_at(case: Case, used: Array, damping: Real | None, amplitude: Real | None) -> str:
    at = ", ".join(f"{t.name} {100 * xi:.3g} %" for t, xi in zip(case.vehicle.tanks, used, strict=True))
    how = (
        "damping given"
        if damping is not None
        else "at the amplitude given"
        if amplitude is not None
        else "small amplitude"
    )
    return f"{how}: {at}"


_UNKNOWN: dict[str, Any] = dict.fromkeys(
    ("neutral_damping", "required_damping", "required_damping_together", "shared_with", "limit_cycle")
)


def _tank(tank: TankReview, trusted: bool) -> dict[str, Any]:
    """Return one tank of the JSON object."""
    z, c, hertz = tank.zone, tank.limit_cycle, 2.0 * np.pi
    known = not z.reason
    return {
        "name": tank.name,
        "danger_zone": {
            "aft_m": z.aft if known else None,
            "forward_m": z.forward if known else None,
            "l_m": z.l,
            "inside": z.inside,
            "reason": z.reason or None,
        },
        "damping_ratio": tank.damping_ratio,
        "disc_margin": {
            "value": tank.disc_margin if trusted else None,
            "frequency_hz": tank.omega / hertz if trusted else None,
        },
        "neutral_damping": float(tank.required.neutral),
        "required_damping": float(tank.required.required),
        "required_damping_together": float(c.together.required),
        "shared_with": list(c.together.shared_with),
        "limit_cycle": {
            "required_damping": float(c.required.required),
            "band_hz": [np.min(c.band) / hertz, np.max(c.band) / hertz] if c.band.size else None,
            "slosh_amplitude_m": c.slosh_amplitude,
            "tvc_amplitude_rad": _pair(c.tvc_amplitude),
            "paper": {
                "slosh_amplitude_m": c.paper_slosh_amplitude,
                "tvc_amplitude_rad": _pair(c.paper_tvc_amplitude),
            },
            "gain_db": c.gain_db,
            "delay_s": c.delay,
            "frequency_hz": c.omega / hertz,
            "tvc_limit_rad": c.tvc_limit,
            "acceptable": c.acceptable,
            "coupled": [_cycle(cycle) for cycle in c.coupled],
        },
    }


def _cycle(cycle: Cycle) -> dict[str, Any]:
    return {
        "frequency_hz": cycle.omega / (2.0 * np.pi),
        "slosh_amplitude_m": cycle.slosh_amplitude,
        "tvc_amplitude_rad": cycle.tvc_amplitude,
        "stable": cycle.stable,
    }


def _pair(value: Array) -> list[float] | None:
    return [float(v) for v in value] if np.all(np.isfinite(value)) else None


def _plain(value: Any) -> Any:
    """Return a value made of JSON's own types; what is not finite becomes null."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_plain(v) for v in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value
