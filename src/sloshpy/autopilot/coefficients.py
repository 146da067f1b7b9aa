"""Coefficients of transfer functions, each one number or an array over a batch, and the batch axes of an autopilot."""

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from sloshpy.units import Array, Real

if TYPE_CHECKING:
    from sloshpy.autopilot.autopilot import Actuator, Autopilot, Filter

# numbers of the autopilot that may carry leading axes, beside coefficients of filters and the actuator's
NUMBERS = ("attitude_gain", "rate_gain", "accelerometer_gain", "drift_gain", "drift_rate_gain", "gain", "delay")
_PARTS = ("numerator", "denominator")


def alike(numerator: Sequence[Real], denominator: Sequence[Real]) -> tuple[Array, Array]:
    """Return both as arrays (k, ...) of descending powers, the batch's axes behind and the same in both."""
    shape = np.broadcast_shapes(*(np.shape(c) for c in (*numerator, *denominator)))
    if not shape:
        return np.array(numerator, dtype=float), np.array(denominator, dtype=float)
    top, bottom = (np.stack([np.broadcast_to(c, shape) for c in part]) for part in (numerator, denominator))
    return top.astype(float), bottom.astype(float)


def each(polynomials: Array) -> Iterator[Array]:
    """Return the polynomials (k,) of a batch (k, ...) one by one, last axis fastest."""
    yield from polynomials.reshape(len(polynomials), -1).T


def derivative(polynomial: Array) -> Array:
    """Return the derivative of polynomials (k, ...) in descending powers, (k - 1, ...)."""
    power = np.arange(len(polynomial) - 1, 0, -1).reshape(-1, *[1] * (polynomial.ndim - 1))
    return np.asarray(polynomial[:-1] * power)


def axes(autopilot: "Autopilot") -> list[tuple[int, ...]]:
    """Return the shapes of every number of an autopilot that may carry the batch's axes."""
    found = [np.shape(getattr(autopilot, name)) for name in NUMBERS]
    for one in (*autopilot.filter, autopilot.actuator):
        found += [] if one is None else [np.shape(x) for x in _entries(one)]
    return found


def mapped(autopilot: "Autopilot", change: Callable[[Array], Array]) -> "Autopilot":
    """Return an autopilot with a change of the batch's axes made to every array in it."""
    update: dict[str, Any] = {k: change(x) for k in NUMBERS if (x := np.asarray(getattr(autopilot, k))).ndim}
    if any(np.ndim(x) for one in autopilot.filter for x in _entries(one)):
        update["filter"] = tuple(_changed(one, change) for one in autopilot.filter)
    if autopilot.actuator is not None and any(np.ndim(x) for x in _entries(autopilot.actuator)):
        update["actuator"] = _changed(autopilot.actuator, change)
    return autopilot.model_copy(update=update) if update else autopilot


def _entries(one: "Filter | Actuator") -> list[Real]:
    found = [x for part in _PARTS for x in getattr(one, part) or ()]
    fields = type(one).model_fields  # asking pydantic for an attribute that is not there takes long
    named = [name for name in ("frequency", "damping") if name in fields]
    return found + [x for name in named if (x := getattr(one, name)) is not None]


def _changed(one: Any, change: Callable[[Array], Array]) -> Any:
    def of(x: Any) -> Any:
        if isinstance(x, tuple):
            return tuple(of(c) for c in x)
        return change(np.asarray(x)) if np.ndim(x) else x

    return one.model_copy(update={name: of(getattr(one, name)) for name in type(one).model_fields})
