"""What is asked of cases: margins and required damping of each, or a nonlinear simulation; of flights the same."""

from dataclasses import replace

import numpy as np

from sloshpy.case import Case, Criteria
from sloshpy.damping.laws import small_amplitude_ratio
from sloshpy.dispersion.columns import columns_of, worst_columns
from sloshpy.dispersion.dispersion import Dispersion, Linear, Nonlinear, drawn
from sloshpy.dispersion.flown import flown
from sloshpy.dispersion.many_required import many_required
from sloshpy.dispersion.reasons import MOST_REASON, reason_of
from sloshpy.dispersion.rows import Rows, Status, failed, joined
from sloshpy.dispersion.varied import RUN, Varied, find_input, nominal, stands_in, varied, varies_lags
from sloshpy.dispersion.verdict import verdicts
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.response import transfer
from sloshpy.errors import OutsideValidity
from sloshpy.simulation import OneMinusCosine, simulate_ensemble
from sloshpy.simulation.ensemble import FLEXIBLE_STEP, GUST_STEPS, slosh_step
from sloshpy.stability import falls_short, loop_margins
from sloshpy.stability.touching import with_ratio
from sloshpy.units import Array

SPARE = 0.8  # of the ensemble's own step, for frequencies that follow from other inputs
STRETCH = 1.25  # of the ensemble's own step, beyond which a case is refused: 1e-4 of a limit cycle


def _with_verdict(dispersion: Dispersion, values: Array) -> Array:
    """Return rows with the verdict on each as their last number."""
    return np.concatenate([values, verdicts(columns_of(dispersion)[:-1], values)[:, None]], axis=1)


def answered(dispersion: Dispersion, seed: int, first: int, count: int) -> Rows:
    """Return the rows of some cases; what one case raises is that case's alone."""
    draws = drawn(dispersion, seed, first, count)
    if not dispersion.flight:
        return _asked(dispersion, draws, first)
    if isinstance(dispersion.analysis, Linear):
        return _along(dispersion, draws, first)
    return flown(dispersion, draws, first)


def _asked(dispersion: Dispersion, draws: Array, first: int) -> Rows:
    """Return the rows of one case under draws (N, parameters)."""
    count = len(draws)
    if count > 1 and varies_lags(dispersion):  # each is another loop
        return joined([_asked(dispersion, draws[k : k + 1], first + k) for k in range(count)])
    try:
        ask = _linear if isinstance(dispersion.analysis, Linear) else _nonlinear
        return ask(dispersion, varied(dispersion, draws), first, count)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:  # pydantic's and our own are ValueErrors
        if count == 1:
            return failed(first, len(columns_of(dispersion)), Status.FAILED, reason_of(error))
    half = count // 2
    return joined([_asked(dispersion, draws[:half], first), _asked(dispersion, draws[half:], first + half)])


def _along(dispersion: Dispersion, draws: Array, first: int) -> Rows:
    """Return the rows of a flight: every moment asked as a case of its own, under the same draws."""
    each, status = [], np.zeros(len(draws))
    reasons = [""] * len(draws)
    for moment in dispersion.flight:
        own = [k for k, p in enumerate(dispersion.parameters) if stands_in(moment.case, p.input)]
        at = replace(dispersion, case=moment.case, flight=(), parameters=tuple(dispersion.parameters[k] for k in own))
        rows = _asked(at, draws[:, own], first)
        each.append(dict(zip([c.name for c in columns_of(at)[:-1]], rows.values.T, strict=False)))
        for k in np.flatnonzero(rows.status != Status.OK):
            status[k] = rows.status[k]
            reasons[k] = reasons[k] or f"{moment.time:g} s, {moment.phase}: {rows.reasons[k]}"[:MOST_REASON]
    worst = []
    for column in worst_columns(dispersion)[:-1]:
        over = np.stack([found[column.name] for found in each if column.name in found])
        worst.append(np.max(over, axis=0) if column.worst > 0 else np.min(over, axis=0))  # nan where any is
    margin = np.stack([found["disc_margin"] for found in each])
    time = np.array([moment.time for moment in dispersion.flight])
    when = np.where(np.any(np.isnan(margin), axis=0), np.nan, time[np.argmin(margin, axis=0)])
    values = np.stack([*worst, when, *(x for found in each for x in found.values())], axis=-1)
    return Rows(first=first, values=_with_verdict(dispersion, values), status=status, reasons=tuple(reasons))


def _damping(dispersion: Dispersion, batch: Varied, amplitude: float | None) -> Array:
    """Return the damping ratios at which each case is read, (N, n_tanks)."""
    laws = [tank.damping for tank in dispersion.case.vehicle.tanks]
    read = [small_amplitude_ratio(x) if amplitude is None else float(x.ratio(amplitude)) for x in laws]
    for tank, xi in zip(dispersion.case.vehicle.tanks, read, strict=True):
        if not np.isfinite(xi):
            raise OutsideValidity(f"{amplitude:g} m is outside the damping data of {tank.name}")
    return np.asarray(np.array(read) * batch.damping_factor)


def _linear(dispersion: Dispersion, batch: Varied, first: int, count: int) -> Rows:
    how = dispersion.analysis
    assert isinstance(how, Linear)
    case, criteria = batch.case, batch.case.criteria
    loop = open_loop(
        case, np.broadcast_to(_damping(dispersion, batch, how.amplitude), (count, len(case.vehicle.tanks)))
    )
    found = loop_margins(loop, criteria, crossings=False)
    parts = [np.broadcast_to(found.nichols_disc_margin, count), np.broadcast_to(found.growth, count)]
    reasons = np.full(count, "", dtype=object)
    for j, tank in enumerate(case.vehicle.tanks if how.required else ()):
        required, omega = many_required(loop, criteria, j)
        amplitude = _amplitude(case, j, required, batch.damping_factor[:, j])
        slosh, engine = _oscillation(loop, criteria, j, amplitude, required, omega)
        parts += [np.where(np.isnan(required), np.inf, required), slosh, engine]
        ends = f"the minimum of {tank.name} ends or becomes another mode's before it reaches the disc margin"
        reasons[np.isnan(engine) & (reasons == "")] = ends
    values = _with_verdict(dispersion, np.stack(parts, axis=-1))
    reasons[np.any(np.isnan(values), axis=1) & (reasons == "")] = "no finite disc margin"
    status = np.where(reasons == "", float(Status.OK), float(Status.FAILED))
    return Rows(first=first, values=values, status=status, reasons=tuple(reasons))


def _oscillation(
    loop: Loop, criteria: Criteria, tank: int, amplitude: Array, required: Array, omega: Array
) -> tuple[Array, Array]:
    """Return slosh in m and engine in rad of loops that oscillate at a tank's required damping, (N,) each.

    0 where it has that damping anyhow, inf where it never has it, nan where no oscillation follows from it.
    """
    slosh = np.where(np.isfinite(amplitude), 0.0, np.inf)
    engine = slosh.copy()
    moving = np.flatnonzero((amplitude > 0.0) & np.isfinite(amplitude))
    if len(moving):
        at = with_ratio(loop, moving, tank, required[moving])
        w = np.broadcast_to(loop.plant.tank_frequency[..., tank], len(amplitude))[moving]
        gain = np.abs(transfer(at, 1j * omega[moving]).slosh[..., tank])
        ends = falls_short(at, omega[moving], criteria, criteria.disc_margin)
        slosh[moving] = np.where(ends, np.nan, amplitude[moving] * w / omega[moving])
        engine[moving] = slosh[moving] / gain
    return slosh, engine


def _amplitude(case: Case, tank: int, required: Array, factor: Array) -> Array:
    """Return the amplitude in m at which a tank's law times its factor gives a ratio; inf where it never does."""
    law = case.vehicle.tanks[tank].damping
    wanted = np.where(np.isnan(required), np.inf, required) / np.where(factor > 0.0, factor, np.nan)
    reachable = np.isfinite(wanted)
    found = np.full(len(required), np.inf)
    found[reachable] = law.amplitude(wanted[reachable])
    found[required == 0.0] = 0.0
    return np.where(np.isnan(found), np.inf, found)


def step_of(dispersion: Dispersion) -> float:
    """Return the time step in s of every run of a campaign: from the file, not from the draws.

    So it is the same for every case and block, and the bits of a case do not depend on those beside it.
    """
    case = dispersion.case
    slosh = max(float(np.max(tank.frequency)) for tank in case.vehicle.tanks)
    bending = max((float(np.max(mode.frequency)) for mode in case.vehicle.flexible_modes), default=0.0)
    widest, run = 1.0, dispersion.analysis
    shortest = run.gust_duration if isinstance(run, Nonlinear) and blows(dispersion) else np.inf
    for p in dispersion.parameters:
        found = find_input(case, p.input)
        if found.field == "gust_duration":
            shortest = p.distribution.low * (shortest if p.factor else 1.0)
        if found.field == "frequency":
            least = min(float(np.min(np.asarray(x))) for x in nominal(case, found))
            widest = max(widest, p.distribution.high / (1.0 if p.factor else least))
    own = SPARE * min(slosh_step(case) / slosh, FLEXIBLE_STEP / bending if bending else np.inf) / widest
    return float(min(own, shortest / GUST_STEPS))


def blows(dispersion: Dispersion) -> bool:
    """Whether some run may have a gust."""
    run = dispersion.analysis
    varies = any(p.input == "run.gust_speed" for p in dispersion.parameters)
    return isinstance(run, Nonlinear) and (varies or run.gust_speed != 0.0)


def _nonlinear(dispersion: Dispersion, batch: Varied, first: int, count: int) -> Rows:
    how, step = dispersion.analysis, step_of(dispersion)
    assert isinstance(how, Nonlinear)
    case = batch.case.model_copy(update={"autopilot": batch.case.autopilot.degraded(how.gain, how.delay)})
    for part, most in ((case.vehicle.tanks, slosh_step(case)), (case.vehicle.flexible_modes, FLEXIBLE_STEP)):
        for one in part:
            if np.any(np.asarray(one.frequency) * step > STRETCH * most):
                raise OutsideValidity(
                    f"the frequency of {one.name} is too high for the campaign's step of {step:.4g} s"
                )
    own = {name: batch.run.get(name, getattr(how, name)) for name in RUN}
    start = np.broadcast_to(own["initial_slosh"], count)[:, None]
    gust = None
    if blows(dispersion):
        gust = OneMinusCosine(size=own["gust_speed"], start=own["gust_start"], duration=own["gust_duration"])
    run = simulate_ensemble(case, how.duration, start, step, batch.damping_factor, gust)
    parts = []
    for j in range(len(case.vehicle.tanks)):
        parts += [run.slosh_amplitude[..., j], run.slosh_peak[..., j]]
    still = (run.tvc_amplitude == 0.0) & np.isnan(run.tvc_omega)  # at rest: no frequency
    parts += [run.tvc_amplitude, run.tvc_peak, np.where(still, 0.0, run.tvc_omega)]
    values = np.stack([np.broadcast_to(x, count) for x in parts], axis=-1)
    reasons = tuple(str(r) for r in np.broadcast_to(run.reason, count))
    diverged = np.array([r.startswith("diverged") for r in reasons])
    status = np.where(diverged, Status.DIVERGED, np.where([r == "" for r in reasons], Status.OK, Status.UNSETTLED))
    greater = np.array([column.worst > 0 for column in columns_of(dispersion)[:-1]])
    values = _with_verdict(dispersion, np.where(diverged[:, None] & greater, np.inf, values))
    return Rows(first=first, values=values, status=status.astype(float), reasons=reasons)
