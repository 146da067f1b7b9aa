"""The review of a flight as one JSON object in SI units, null where there is no number."""

import json
import math
from typing import Any

import numpy as np

from sloshpy.flight.assess_flight import FlightAssessment
from sloshpy.flight.phase_review import PhaseReview
from sloshpy.flight.windows import GrowthWindow
from sloshpy.flight.worst import Worst


def flight_json(result: FlightAssessment) -> str:
    """Return the review of a flight as JSON: verdict, the worst of each criterion, windows of growth, every time."""
    flight = result.trajectory
    told = {
        "name": flight.name,
        "verdict": result.verdict,
        "reasons": list(result.reasons),
        "worst": [_worst(one) for one in result.worst],
        "growth_windows": [_window(one) for one in result.windows],
        "events": [event.told() for event in flight.crossings],
        "phases": [_phase(review) for review in result.reviews],
        "files": [{"file": one.file, "sha256": one.sha256} for one in flight.files],
    }
    return json.dumps(_plain(told), indent=1, allow_nan=False)


def _worst(one: Worst) -> dict[str, Any]:
    return {
        "criterion": one.criterion,
        "value": one.value,
        "unit": one.unit,
        "in_words": one.shown,
        "limit": one.bound,
        "met": one.met,
        "time": one.time,
        "phase": one.phase,
        "why": one.why or None,
        "caution": one.caution or None,
    }


def _window(one: GrowthWindow) -> dict[str, Any]:
    return {
        "phase": one.phase,
        "mode": one.mode,
        "start": one.start,
        "end": one.end,
        "exponent": one.exponent,
        "factor": one.factor,
        "greatest_growth_rate": one.growth,
        "at": one.at,
        "time_to_double": one.time_to_double,
    }


def _phase(review: PhaseReview) -> dict[str, Any]:
    phase = review.phase
    return {
        "name": phase.name,
        "start": phase.time[0],
        "end": phase.time[-1],
        "tanks": list(phase.tanks),
        "notes": list(phase.notes),
        "schedules": dict(phase.schedules),
        "exchanges": [{"tanks": list(v.tanks), "start": v.start, "end": v.end} for v in review.tracks.veering],
        "times": [_time(review, k) for k in range(len(phase.time))],
    }


def _time(review: PhaseReview, k: int) -> dict[str, Any]:
    """Return one time; without trust in its stability nothing that rests on the loop is told."""
    trusted, whole = bool(review.trusted[k]), review.assessments[k]
    loop: dict[str, Any] = dict.fromkeys(("stable", "growth_rate", "time_to_double", "disc_margin"))
    if trusted:
        loop = {
            "stable": bool(review.margins.stable[k]),
            "growth_rate": review.margins.growth[k],
            "time_to_double": review.time_to_double[k],
            "disc_margin": dict(zip(review.margins.groups, review.disc_margin[k], strict=True)),
        }
    return {
        "time": review.time[k],
        **loop,
        "verdict": whole.verdict if whole is not None else "invalid" if review.unsupported[k] else None,
        "reasons": list(whole.reasons) if whole is not None else [review.unsupported[k]] * bool(review.unsupported[k]),
        "cg": review.cg[k],
        "percussion_station": review.percussion_station[k],
        "tanks": [_tank(review, k, j) for j in range(len(review.phase.tanks))],
        "limit_cycles": None
        if whole is None or whole.cycles is None
        else [
            {
                "frequency_hz": cycle.omega / (2.0 * np.pi),
                "slosh_amplitude_m": cycle.slosh_amplitude,
                "tvc_amplitude_rad": cycle.tvc_amplitude,
                "stable": cycle.stable,
            }
            for cycle in whole.cycles
        ],
    }


def _tank(review: PhaseReview, k: int, j: int) -> dict[str, Any]:
    phase, within = review.phase, review.within_zone[k, j]
    tank, fill = phase.cases[k].vehicle.tanks[j], phase.fill
    return {
        "name": tank.name,
        "fill": None if fill is None else fill[k, j],
        "slosh_mass": tank.slosh_mass,
        "station": review.slosh_station[k, j],
        "frequency_hz": float(tank.frequency) / (2.0 * np.pi),
        "danger_zone": {"aft_station": review.aft_station[k, j], "inside": None if np.isnan(within) else bool(within)},
        "required_damping": review.required_damping[k, j],
        "neutral_damping": review.required[j].neutral[k],
        "others_held_at": {n: x for n, x in zip(phase.tanks, review.held[k], strict=True) if n != tank.name},
        "available_damping": phase.available_damping[k, j],
        "at_amplitude": phase.reference_amplitude[k, j],
        "small_amplitude_damping": phase.small_damping[k, j],
        "limit_cycle": {
            "slosh_amplitude_m": review.cycle_slosh[k, j],
            "slosh_limit_m": review.slosh_limit[k, j],
            "tvc_amplitude_rad": review.cycle_tvc[k, j],
            "tvc_limit_rad": review.tvc_limit,
        }
        if review.assessments[k] is not None
        else None,
    }


def _plain(value: Any) -> Any:
    """Return a value of plain JSON; what is no finite number is null."""
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(one) for one in value]
    if isinstance(value, str) or value is None:
        return value
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    number = float(value)
    return number if math.isfinite(number) else None
