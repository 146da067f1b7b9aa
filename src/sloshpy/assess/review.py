"""The verb: everything that is found for one case, and the verdict on it."""

from dataclasses import replace

import numpy as np

from sloshpy.assess.assessment import Assessment, TankReview
from sloshpy.assess.verdict import judge, other_minima
from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.dynamics import closed_loop_poles, open_loop
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle import Cycle, limit_cycles, predict_limit_cycle
from sloshpy.stability import Margins, danger_zone, joint_damping, loop_margins
from sloshpy.stability.folding import folding
from sloshpy.units import Array, Real


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
    verdict, reasons = judge(case, found, poles, tanks, cycles, unsupported)
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
        other_disc_margin=float(np.min(other_minima(found, len(tanks)))),
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
