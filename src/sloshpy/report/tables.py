"""The numbers of an assessment as texts for the tables of a page; units are turned, nothing is computed."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sloshpy.assess import Assessment, TankReview
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle import periodic_orbit
from sloshpy.stability import Margins, damping_sensitivity, margin_table
from sloshpy.stability.margins import in_unit
from sloshpy.units import Array, decibel

NONE = "–"


@dataclass(frozen=True, kw_only=True)
class Table:
    """A title, column heads and rows of texts; `note` stands below."""

    title: str
    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    note: str = ""


def criteria_table(assessment: Assessment) -> Table:
    """Return the criteria that the verdict rests on."""
    c, worst = assessment.case.criteria, assessment.worst_tvc_amplitude
    other, stable = assessment.other_disc_margin, bool(assessment.margins.stable)
    found = _number(other, ".3f") if stable else f"{_number(other, '.3f')} from the critical point, the loop unstable"
    return Table(
        title="Criteria",
        head=("Criterion", "Wanted", "Found", "Use"),
        rows=[
            (
                "Engine amplitude",
                f"<= {np.degrees(c.tvc_amplitude):.3g} deg",
                _number(np.degrees(worst), ".3g", "deg"),
                "greatest limit cycle of any tank, degraded by its whole margin",
            ),
            (
                "Disc margin",
                f">= {c.disc_margin:g}",
                found if assessment.margins.trusted else NONE,
                "least of the rigid body and other modes; for a tank it sets the required damping",
            ),
            ("Gain axis of the disc", f"{decibel(c.gain_margin):.3g} dB", "", "GM_d of eq 24"),
            ("Phase axis of the disc", f"{np.degrees(c.phase_margin):.3g} deg", "", "PM_d of eq 24"),
            ("Limit-cycle disc margin", f"{c.limit_cycle_disc_margin:g}", "", "frequencies below it enter the band"),
        ],
    )


def tank_table(assessment: Assessment) -> Table:
    """Return one column for each tank: requirement, zone and limit cycle in both conventions."""
    columns = [_tank(tank, assessment.margins.trusted) for tank in assessment.tanks]
    names = list(columns[0])
    return Table(
        title="Tanks",
        head=("", *(tank.name for tank in assessment.tanks)),
        rows=[(name, *(column[name] for column in columns)) for name in names],
        note="Limit cycle: with gain and phase degraded until the loop is neutral at the required damping. "
        "Frequency-consistent amplitudes read the damping law at the cycle's own frequency; the paper reads it at the "
        "slosh frequency.",
    )


def _tank(tank: TankReview, trusted: bool) -> dict[str, str]:
    c, z = tank.limit_cycle, tank.zone
    inside = {True: "inside", False: "outside", None: "closed form refused"}[z.inside]
    band = " and ".join(f"{a:.4g} to {b:.4g}" for a, b in c.band / (2.0 * np.pi))
    coupled_slosh, coupled_engine = c.coupled_amplitude
    return {
        "Damping, loop as read": _number(100.0 * tank.damping_ratio, ".4g", "%"),
        "Required damping, all tanks together": _needed(float(c.together.required)) if trusted else NONE,
        "Required damping in its five steps": _needed(float(c.required.required)) if trusted else NONE,
        "Required damping, others at small amplitude": _needed(float(tank.required.required)) if trusted else NONE,
        "Neutral damping, others at small amplitude": _needed(float(tank.required.neutral)) if trusted else NONE,
        "Slosh disc margin, loop as read": _number(tank.disc_margin, "+.4f") if trusted else NONE,
        "Danger zone (eqs 22, 23)": inside,
        "Zone about the c.g.": NONE if z.reason else f"{z.aft:.4g} m behind to {-z.forward:.4g} m ahead",
        "Place of the slosh mass": f"{abs(z.l):.4g} m {'behind' if z.l > 0.0 else 'ahead of'} the c.g.",
        "Limit-cycle band": f"{band} Hz" if band else NONE,
        "Slosh amplitude, frequency-consistent": _number(c.slosh_amplitude, ".4g", "m"),
        "Slosh amplitude, paper": _number(c.paper_slosh_amplitude, ".4g", "m"),
        "Engine amplitude, frequency-consistent": _mrad(c.tvc_amplitude),
        "Engine amplitude, paper": _mrad(c.paper_tvc_amplitude),
        "Slosh amplitude, all tanks coupled": _number(coupled_slosh, ".4g", "m"),
        "Engine amplitude, all tanks coupled": _number(1e3 * coupled_engine, ".3f", "mrad"),
        "Gain to neutral": _number(c.gain_db, "+.3f", "dB"),
        "Delay to neutral": _number(1e3 * c.delay, "+.1f", "ms") + (", a phase advance" if c.delay < 0.0 else ""),
        "Acceptable": {True: "yes", False: "no", None: "no number supported"}[c.acceptable],
    }


def mode_table(assessment: Assessment) -> Table:
    """Return the closed-loop poles, least damped first."""
    p = assessment.poles
    rows = []
    for value, name in zip(p.value, p.name, strict=True):
        ratio = -value.real / abs(value) if value else 0.0
        doubles = f"doubles in {math.log(2.0) / value.real:.3g} s" if value.real > 0.0 else ""
        rows.append(
            (
                name,
                _number(value.imag / (2.0 * np.pi), ".4f"),
                _number(value.imag, ".4f"),
                _number(100.0 * ratio, ".3f"),
                _number(value.real, "+.5f"),
                doubles,
            )
        )
    head = ("Mode", "Frequency [Hz]", "[rad/s]", "Damping [%]", "Growth [1/s]", "")
    note = f"Neutral drift poles removed by structure, since the loop neither sees nor moves them: {p.drift_poles}."
    return Table(title=f"Closed-loop modes ({assessment.read_at})", head=head, rows=rows, note=note)


def by_mode_table(assessment: Assessment) -> Table:
    """Return the margins by mode, each kind in its own column."""
    found = margin_table(assessment.case, damping=assessment.margins.source.damping)
    head = tuple(f"{c.name} [{c.unit}]" if c.unit else c.name for c in found.shown)
    return Table(
        title=f"Margins by mode ({assessment.read_at})",
        head=("Mode", *head, ""),
        rows=[(row.mode, *(c.text(row) for c in found.shown), row.label) for row in found.rows],
        note=f"{'. '.join(found.verdict())}. A gain or phase limits the mode whose pole crosses there; nichols is "
        "eq 24, modulus the least |1 + L|, disk the balanced disk margin: three different distances.",
    )


def crossing_table(margins: Margins, read_at: str) -> Table:
    """Return every minimum of the disc margin and every crossing with the mode it belongs to."""
    rows = []
    for name, points, unit in (
        ("disc margin", margins.minima, ""),
        ("gain margin", margins.phase_crossings, "dB"),
        ("phase margin", margins.gain_crossings, "deg"),
    ):
        for omega, value, mode in margins.listed(points):
            shown = f"{in_unit(value, unit):.4f} {unit}".strip()
            rows.append((name, shown, f"{omega / (2.0 * np.pi):.4f}", f"{omega:.4f}", mode))
    note = "" if margins.stable else "The loop as read is unstable: these are distances to the critical point."
    head = ("Kind", "Value", "Frequency [Hz]", "[rad/s]", "Mode")
    return Table(title=f"Minima and crossings ({read_at})", head=head, rows=rows, note=note)


def cycle_table(assessment: Assessment) -> Table:
    """Return the limit cycles of the loop as given."""
    rows = [
        (
            "stable" if c.stable else "unstable",
            f"{c.omega / (2.0 * np.pi):.4f}",
            ", ".join(f"{name} {a:.4g} m" for name, a in c.slosh_amplitude.items()),
            f"{1e3 * c.tvc_amplitude:.4g}",
        )
        for c in assessment.cycles or ()
    ]
    head = ("Limit cycle", "Frequency [Hz]", "Slosh", "Engine [mrad]")
    note = "" if rows else "None." if assessment.cycles is not None else "No number is supported; see the reasons."
    return Table(title="Limit cycles of the loop as given", head=head, rows=rows, note=note)


def sensitivity_table(assessment: Assessment) -> Table:
    """Return what 1 % more damping of each tank does to the growth of every mode, and which tank moves it most."""
    found = damping_sensitivity(assessment.case, damping=assessment.margins.source.damping)
    rows = [
        (name, _number(p.real, "+.5f"), *(_number(0.01 * slope, "+.5f") for slope in slopes), driver or NONE)
        for name, p, slopes, driver in zip(
            found.poles.name, found.poles.value, found.growth_slope, found.driver, strict=True
        )
    ]
    return Table(
        title=f"Change of growth by 1 % more damping of a tank ({assessment.read_at})",
        head=("Mode", "Growth [1/s]", *(f"{tank} [1/s]" for tank in found.tanks), "Moved most by"),
        rows=rows,
        note="Negative: the damping helps. First derivatives, all else held; – where two poles coincide.",
    )


def orbit_table(assessment: Assessment) -> Table:
    """Return the exact periodic orbit beside each one-sinusoid limit cycle of the loop as given."""
    rows = []
    for cycle in assessment.cycles or ():
        predicted = ", ".join(f"{name} {a:.4g} m" for name, a in cycle.slosh_amplitude.items())
        try:
            orbit = periodic_orbit(assessment.case, cycle)
        except OutsideValidity as error:
            rows.append((predicted, str(error), NONE, NONE, NONE))
            continue
        rows.append(
            (
                predicted,
                ", ".join(f"{name} {a:.6g} m" for name, a in orbit.slosh_amplitude.items()),
                f"{1e3 * orbit.tvc_amplitude:.4g}",
                f"{100.0 * orbit.harmonics:.3g}",
                {True: "attracts", False: "repels", None: "not known"}[orbit.stable],
            )
        )
    head = ("One sinusoid", "Exact orbit", "Engine [mrad]", "Other harmonics [%]", "By Floquet multipliers")
    note = "" if rows else "No limit cycle by one sinusoid to start from."
    return Table(title="Exact periodic orbits of the loop as given", head=head, rows=rows, note=note)


def _number(value: float, form: str, unit: str = "") -> str:
    return f"{value:{form}} {unit}".strip() if math.isfinite(value) else NONE


def _needed(ratio: float) -> str:
    if math.isnan(ratio):
        return "none suffices"
    return "none needed" if ratio == 0.0 else f"{100.0 * ratio:.4f} %"


def _mrad(pair: Array) -> str:
    if not np.all(np.isfinite(pair)):
        return NONE
    low, high = np.degrees(pair)
    return f"{1e3 * pair[0]:.4g} to {1e3 * pair[1]:.4g} mrad ({low:.3f} to {high:.3f} deg)"
