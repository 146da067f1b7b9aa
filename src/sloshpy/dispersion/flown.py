"""A whole flight simulated for each draw: the nonlinear time-varying loop from displaced slosh, in a gust."""

from dataclasses import dataclass, replace

import numpy as np

from sloshpy.dispersion.dispersion import Dispersion, Nonlinear, drawn
from sloshpy.dispersion.flown_columns import flown_columns, radii, with_radius
from sloshpy.dispersion.flown_faults import flown_fault
from sloshpy.dispersion.reasons import reason_of
from sloshpy.dispersion.rows import Rows, Status, failed, joined
from sloshpy.dispersion.varied import RUN, stands_in, varied_once
from sloshpy.dispersion.verdict import verdicts
from sloshpy.errors import InputError, Problem
from sloshpy.flight.flight_history import FlightHistory
from sloshpy.flight.fly_fast import fly_fast
from sloshpy.flight.peaks import Course
from sloshpy.flight.trajectory import Phase
from sloshpy.simulation import OneMinusCosine
from sloshpy.units import Array


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """One draw of a flight. factors: of the damping laws, (n_tanks,) for each phase. run: what varies of the run."""

    phases: tuple[Phase, ...]
    factors: tuple[Array, ...]
    run: dict[str, float]

    @property
    def gust(self) -> OneMinusCosine | None:
        """The gust of the lateral wind, None where it has no speed."""
        speed, start, duration = (self.run[f"gust_{x}"] for x in ("speed", "start", "duration"))
        return OneMinusCosine(size=speed, start=start, duration=duration) if speed != 0.0 else None


def drawn_flight(dispersion: Dispersion, draw: Array) -> Drawn:
    """Return the flight of one draw (parameters,), loop degraded as the analysis asks.

    Raises:
        ValidationError: the draw makes no sound vehicle or autopilot.
    """
    how = dispersion.analysis
    assert isinstance(how, Nonlinear)
    phases, factors = [], []
    run = {name: float(getattr(how, name)) for name in RUN}
    for phase in dispersion.phases:
        own = [k for k, p in enumerate(dispersion.parameters) if stands_in(phase.cases[0], p.input)]
        parameters = tuple(dispersion.parameters[k] for k in own)
        found = varied_once(replace(dispersion, case=phase.case, parameters=parameters), draw[own])
        pilot = found.case.autopilot.degraded(how.gain, how.delay)
        phases.append(replace(phase, case=found.case.model_copy(update={"autopilot": pilot})))
        factors.append(found.damping_factor)
        run |= {name: float(value[0]) for name, value in found.run.items()}
    return Drawn(phases=tuple(phases), factors=tuple(factors), run=run)


def flown(dispersion: Dispersion, draws: Array, first: int) -> Rows:
    """Return the rows of flights under draws (N, parameters), each by itself."""
    return joined([_flown(dispersion, draw, first + k) for k, draw in enumerate(draws)])


def fly_case(dispersion: Dispersion, seed: int, case: int) -> list[FlightHistory]:
    """Return the time histories of one case of a campaign along a flight, by its number.

    One for each stretch into which nothing is carried, up to the first that ends early. Their phases are as drawn; the
    factors of the damping are not in their laws.

    Raises:
        InputError: the flight cannot be simulated as it is asked.
    """
    fault = flown_fault(dispersion)
    if fault is not None or not dispersion.phases:
        rule, cure = fault[1:] if fault else ("is asked of a flight that is simulated", "ask [nonlinear] of a flight")
        raise InputError(Problem(key="fly_case", value=str(case), rule=rule, cure=cure))
    return fly(dispersion, drawn(dispersion, seed, case, 1)[0])


def fly(dispersion: Dispersion, draw: Array) -> list[FlightHistory]:
    """Return the histories of a draw's stretches, up to the first that ends early."""
    whole, histories, at = drawn_flight(dispersion, draw), list[FlightHistory](), 0
    for stretch in dispersion.stretches:
        own = whole.phases[at : at + len(stretch)]
        slosh = np.full(len(own[0].tanks), whole.run["initial_slosh"])
        histories.append(fly_fast(own, slosh, whole.gust, whole.factors[at]))
        at += len(stretch)
        if histories[-1].stopped:
            break
    return histories


def _flown(dispersion: Dispersion, draw: Array, case: int) -> Rows:
    """Return the row of one flight; what it raises is its own."""
    columns = flown_columns(dispersion)
    try:
        histories = fly(dispersion, draw)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:  # pydantic's and our own are ValueErrors
        return failed(case, len(columns) + 1, Status.FAILED, reason_of(error))
    stopped = histories[-1].stopped
    numbers = _numbers(dispersion, histories)
    values = np.array([numbers.get(column.name, np.nan) for column in columns])
    status = Status.OK
    if stopped:
        diverged = stopped.startswith("diverged")
        status = Status.DIVERGED if diverged else Status.FAILED
        # what is known about the times before stays; of the whole flight nothing is
        lost = np.array([column.moment is None for column in columns]) | np.isnan(values)
        greater = np.array([column.worst > 0 for column in columns])
        values = np.where(lost, np.where(greater, np.inf, np.nan) if diverged else np.nan, values)
    reason = f"{stopped}, {_phase_of(histories[-1])}" if stopped else ""
    whole = np.append(values, verdicts(columns, values[None]))
    return Rows(first=case, values=whole[None], status=np.array([float(status)]), reasons=(reason,))


def _phase_of(history: FlightHistory) -> str:
    """Return the phase in which a history ends."""
    return next(p.name for p in history.phases if history.time[-1] <= p.time[-1])


def _numbers(dispersion: Dispersion, histories: list[FlightHistory]) -> dict[str, float]:
    """Return the numbers of a flight by the names of its columns; those of stretches not reached are missing."""
    found: dict[str, float] = {}
    engine: list[tuple[float, float]] = []
    k = 0
    for history in histories:
        courses = {t: Course.of(history.time, history.slosh[:, j]) for j, t in enumerate(history.phases[0].tanks)}
        last = history.phases[-1].cases[-1]
        period = {t.name: 2.0 * np.pi / float(t.frequency) for t in last.vehicle.tanks}
        for t, course in courses.items():
            peak, time = course.greatest()
            if peak > found.get(f"slosh_peak.{t}", -1.0):
                found[f"slosh_peak.{t}"], found[f"slosh_peak_time.{t}"] = peak, time
            found[f"slosh_end.{t}"] = course.amplitude(period[t])
            if with_radius(dispersion, t):
                share = max(_share(course, phase, t) for phase in history.phases)
                found[f"slosh_radius.{t}"] = max(share, found.get(f"slosh_radius.{t}", 0.0))
        tvc = Course.of(history.time, history.tvc)
        engine.append(tvc.greatest())
        found["engine_end"] = tvc.amplitude(max(period.values()))
        for phase in history.phases:
            for name, course in (*((f"slosh_peak.{t}", c) for t, c in courses.items()), ("engine_peak", tvc)):
                found |= {f"{name}[{k + i}]": float(x) for i, x in enumerate(course.about(phase))}
            k += len(phase.time)
    found["engine_peak"], found["engine_peak_time"] = max(engine, key=lambda pair: pair[0])
    return found


def _share(course: Course, phase: Phase, tank: str) -> float:
    """Return the greatest slosh in a phase over the tank's radius of that moment."""
    inside = (course.time >= phase.time[0]) & (course.time <= phase.time[-1])
    if not np.any(inside):
        return 0.0
    radius = np.interp(course.time[inside], phase.time, radii(phase, tank))
    return float(np.max(np.abs(course.value[inside]) / radius))
