"""A review as the JSON object that `sloshpy assess --json` prints."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from sloshpy.limit_cycle import Cycle
from sloshpy.stability.margins import in_unit
from sloshpy.units import Array

if TYPE_CHECKING:
    from sloshpy.assess.assessment import Assessment, TankReview

_UNKNOWN: dict[str, Any] = dict.fromkeys(
    ("neutral_damping", "required_damping", "required_damping_together", "shared_with", "limit_cycle")
)


def contract(review: "Assessment") -> dict[str, Any]:
    """Return a review as one object of JSON's own types, SI units; None where not applicable or not finite."""
    m = review.margins
    found = {
        "name": review.case.name,
        "verdict": review.verdict,
        "reasons": list(review.reasons),
        **_loop(review),
        "tanks": [_tank(tank, m.trusted) | (_UNKNOWN if m.folded else {}) for tank in review.tanks],
        "limit_cycles": None if review.cycles is None else [_cycle(cycle) for cycle in review.cycles],
    }
    return {key: _plain(value) for key, value in found.items()}


def _loop(review: "Assessment") -> dict[str, Any]:
    """Return stability, modes, margins and crossings of the loop; None where the margins are not to be trusted."""
    m, p, hertz = review.margins, review.poles, 2.0 * np.pi
    if not m.trusted:
        return dict.fromkeys(("stable", "modes", "disc_margin", "minima", "crossings"))
    return {
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
        "minima": [{"disc_margin": v, "frequency_hz": w / hertz, "mode": group} for w, v, group in m.listed(m.minima)],
        "crossings": [
            *(_crossing("gain", w, None, in_unit(v, "deg"), g) for w, v, g in m.listed(m.gain_crossings)),
            *(_crossing("phase", w, in_unit(v, "dB"), None, g) for w, v, g in m.listed(m.phase_crossings)),
        ],
    }


def _crossing(kind: str, omega: float, db: float | None, deg: float | None, mode: str) -> dict[str, Any]:
    return {
        "kind": kind,
        "frequency_hz": omega / (2.0 * np.pi),
        "margin_db": db,
        "margin_deg": deg,
        "mode": mode,
    }


def _tank(tank: "TankReview", trusted: bool) -> dict[str, Any]:
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
