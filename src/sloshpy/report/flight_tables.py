"""The review of a flight as texts for the tables of a page; units are turned, nothing is computed."""

import math

import numpy as np

from sloshpy.flight import DampingRequirement, FlightAssessment, Phase
from sloshpy.report.inputs import InputRow, input_rows
from sloshpy.report.tables import NONE, Table

MOST_ROWS = 24  # of a requirement on the page; the whole table is a file of its own


def worst_table(result: FlightAssessment) -> Table:
    """Return the worst of each criterion with its time, the failed ones first."""
    met = {True: "met", False: "FAILS", None: NONE}
    rows = [
        (
            w.criterion,
            w.shown,
            w.limit or NONE,
            f"{w.time:g} s",
            w.phase + (f": {w.why}" if w.why else ""),
            "caution" if w.caution else met[w.met],
        )
        for w in result.worst
    ]
    return Table(
        title="Worst of each criterion",
        head=("Criterion", "Worst", "Limit or there", "Time", "Phase", ""),
        rows=rows,
        note=f"{NONE} decides nothing by itself: slosh is decided by its limit cycles. Of a required damping, there is "
        "what the tank has, at the amplitude named.",
    )


def window_table(result: FlightAssessment) -> Table:
    """Return the windows in which a mode grows at small amplitude."""
    rows = [
        (
            w.mode,
            f"{w.start:.2f} to {w.end:.2f} s",
            f"{w.factor:.4g}",
            f"{w.time_to_double:.3g} s at {w.at:g} s",
            w.phase,
        )
        for w in result.windows
    ]
    return Table(
        title="Growth at small amplitude",
        head=("Mode", "Window, its begin the worst start", "Factor", "Doubles fastest in", "Phase"),
        rows=rows,
        note=". ".join(map(str, result.chains)) if rows else "No mode grows at small amplitude at any time assessed.",
    )


def phase_table(result: FlightAssessment) -> Table:
    """Return the phases."""
    rows = [
        (p.name, f"{p.time[0]:g} to {p.time[-1]:g} s", str(len(p.time)), ", ".join(p.tanks), p.case_file or NONE)
        for p in result.trajectory
    ]
    head = ("Phase", "Time of flight", "Times assessed", "Tanks", "Case")
    return Table(title="Phases", head=head, rows=rows, note="Both ends of a phase are among its times.")


def event_table(result: FlightAssessment) -> Table:
    """Return the events between phases and whether an oscillation goes on across each."""
    rows = [
        (
            f"{e.start:g} to {e.end:g} s" if e.end > e.start else f"{e.end:g} s",
            f"{e.before} to {e.after}",
            "; ".join(e.changes) or NONE,
            "goes on" if e.carries else f"is not carried: {'; '.join(e.barriers)}",
        )
        for e in result.trajectory.crossings
    ]
    note = "No interpolation crosses an event; both its sides are assessed." if rows else "There is none."
    return Table(title="Events", head=("Time", "Phases", "Changes", "An oscillation"), rows=rows, note=note)


def requirement_table(found: DampingRequirement) -> Table:
    """Return the damping required of a tank at some of its times, the worst among them."""
    count = len(found.time)
    every = math.ceil(count / MOST_ROWS)
    shown = sorted({*range(0, count, every), count - 1, found.worst})
    rows = [
        (
            f"{found.time[k]:g} s" + (" (worst)" if k == found.worst and found.required[k] != 0.0 else ""),
            _percent(found.fill[k], NONE),
            _percent(found.required[k], "none suffices"),
            _percent(found.neutral[k], "none suffices"),
            f"{_percent(found.available[k], NONE)} at {_number(found.amplitude[k], 'm', '0 m')}",
            _number(found.omega[k] / (2.0 * np.pi), "Hz", NONE),
            _number(found.frequency[k] / (2.0 * np.pi), "Hz", NONE),
            found.held[k] or NONE,
        )
        for k in shown
    ]
    some = f"{len(shown)} of {count} times, the worst among them; all: --requirement. " if len(shown) < count else ""
    return Table(
        title=f"Damping required of {found.tank}",
        head=(
            "Time",
            "Fill",
            "Required",
            "For stability",
            "Available",
            "Least margin at",
            "Slosh",
            "Other tanks held at",
        ),
        rows=rows,
        note=f"Criterion: {found.criterion}. {some}",
    )


def phase_inputs(phase: Phase) -> Table:
    """Return every input of a phase: its value, or its course, and the schedule that gives it."""
    scheduled, own = dict(phase.schedules), _own_laws(phase)
    rows = [
        (row.key, row.symbol, row.meaning, row.value, _of_schedule(row, scheduled))
        for row in input_rows(phase.case)
        if not row.key.startswith(tuple(f"tank.{name}.damping." for name in own))
    ]
    rows += [
        (f"tank.{name}.damping", "", "damping at small amplitude", text, "tank file at its fill")
        for name, text in own.items()
    ]
    tables = "; ".join(dict.fromkeys(words for _, words in phase.schedules))
    notes = f" Notes: {'; '.join(phase.notes)}." if phase.notes else ""
    return Table(
        title=f"Inputs, {phase.name}",
        head=("Key", "Symbol", "Meaning", "SI (everyday unit)", "By"),
        rows=rows,
        note=f"By: the case file, or a table ({tables or 'none'}). Follows: from what the tables give, as slosh "
        f"frequencies from the acceleration and the normal force from the dynamic pressure.{notes}",
    )


def _own_laws(phase: Phase) -> dict[str, str]:
    """Return the tanks whose law changes along the phase, with their damping at small amplitude at both ends."""
    if not phase.laws:
        return {}
    return {
        name: f"{_percent(phase.small_damping[0, j], NONE)} to {_percent(phase.small_damping[-1, j], NONE)}"
        for j, (name, tank) in enumerate(zip(phase.tanks, phase.case.vehicle.tanks, strict=True))
        if phase.laws[0][j] is not tank.damping
    }


def _of_schedule(row: InputRow, scheduled: dict[str, str]) -> str:
    if row.key in scheduled:
        return scheduled[row.key].split(",")[0]
    # a filter's coefficients by their own columns or by that of its frequency
    by = [k for k in scheduled if k.startswith(f"{row.key}.s^") or k == f"{row.key.rpartition('.')[0]}.frequency"]
    if row.course and by and row.key.endswith((".numerator", ".denominator")):
        return ", ".join(dict.fromkeys(scheduled[k].split(",")[0] for k in by))
    tank, _, name = row.key.rpartition(".")
    if name in {"slosh_mass", "station", "frequency", "radius"} and {f"{tank}.fill", f"{tank}.depth"} & set(scheduled):
        return "tank file"
    return "follows" if row.course else "case"


def _percent(ratio: float, none: str) -> str:
    return none if math.isnan(ratio) else f"{100.0 * ratio:.4g} %"


def _number(value: float, unit: str, none: str) -> str:
    return f"{value:.4g} {unit}" if math.isfinite(value) else none
