"""What speaks for and against a case: one verdict and its reasons, worst first."""

from dataclasses import dataclass, field

import numpy as np

from sloshpy.assess.assessment import TankReview
from sloshpy.case import Case
from sloshpy.damping.validity import NO_RADIUS, words_on_radius
from sloshpy.dynamics import Poles
from sloshpy.dynamics.poles import NEUTRAL
from sloshpy.limit_cycle import Cycle
from sloshpy.stability import Margins
from sloshpy.units import Array

HEAVY_SLOSH = 0.05  # mass-matrix margin below which the slosh model itself is doubtful


@dataclass(frozen=True, kw_only=True)
class _Findings:
    """What speaks for and against a case: no verdict, failures, cautions, what was met and what is told."""

    invalid: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)
    cautions: list[str] = field(default_factory=list)
    met: list[str] = field(default_factory=list)
    told: list[str] = field(default_factory=list)


def judge(
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
            _judge_radius(all_, case, one, tanks)
        if one.stable and one.tvc_amplitude > case.criteria.tvc_amplitude:
            limit = np.degrees(case.criteria.tvc_amplitude)
            all_.failed.append(f"the loop as given has a {one}, more than {limit:.3g} deg")
        elif one.stable:
            all_.told.append(f"the loop as given runs into a {one}")
        else:
            leaves = "grows away from an" if one.tank else "holds the vehicle only within an"
            all_.told.append(f"the loop as given {leaves} {one}")
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
    other, wanted = other_minima(found, tanks), case.criteria.disc_margin
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
                f"slosh, and in its band with at most {angle} deg of engine, {sign} {limit:.3g} deg"
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


def _judge_radius(all_: _Findings, case: Case, cycle: Cycle, tanks: tuple[TankReview, ...]) -> None:
    """Hold every tank to its radius in a cycle of the loop as given."""
    told = _told_on_radius(case, tanks)
    for name, (words, beyond) in cycle.on_radius(case).items():
        if beyond:
            all_.invalid.append(f"as given, {name}: {words}")
        elif words and not told[name][0]:
            all_.cautions.append(f"as given, {name}: caution: {words}")
    for mass, tank in zip(case.vehicle.tanks, tanks, strict=True):
        if mass.radius is None and not any(NO_RADIUS in reason for reason in tank.limit_cycle.reasons):
            all_.cautions.append(f"as given, {tank.name}: {NO_RADIUS}")


def _told_on_radius(case: Case, tanks: tuple[TankReview, ...]) -> dict[str, tuple[str, bool]]:
    """Return what each tank's own limit cycle says already of its radius."""
    told = {}
    for mass, tank in zip(case.vehicle.tanks, tanks, strict=True):
        amplitude = tank.limit_cycle.worst_slosh_amplitude
        told[tank.name] = words_on_radius(amplitude, float(mass.radius)) if mass.radius is not None else ("", False)
    return told


def _judge_coupled(all_: _Findings, case: Case, tanks: tuple[TankReview, ...]) -> None:
    """Hold every tank to its radius in the cycles that another tank's margin leads to."""
    told = _told_on_radius(case, tanks)
    for tank in tanks:
        with_it = f"degraded by the margin of {tank.name}, all tanks coupled"
        for one in (cycle for cycle in tank.limit_cycle.coupled if cycle.stable):
            for name, (words, beyond) in one.on_radius(case).items():
                if beyond and not told[name][1]:
                    all_.invalid.append(f"{name}: {with_it}: {words}")
                elif not told[name][0]:
                    all_.cautions.append(f"{name}: caution: {with_it}: {words}")


def other_minima(found: Margins, tanks: int) -> Array:
    """Return the disc margins of the minima that belong to no tank, inf in the place of the rest."""
    shared = found.related(*range(tanks))
    return np.where(shared | ~np.isfinite(found.minima.value), np.inf, found.minima.value)
