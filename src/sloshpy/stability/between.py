"""Cases along one axis: taken from a batch one by one, and interpolated between two neighbours."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, ValidationError

from sloshpy.case import Case
from sloshpy.dynamics.loop import open_loop


class NotAlike(ValueError):
    """Two cases differ in more than numbers, or what lies between them is no vehicle; the text says in what."""


def single_cases(cases: Case | Sequence[Case]) -> tuple[Case, ...]:
    """Return the cases along the one leading axis of a batch; a sequence of single cases is returned as it is.

    Raises:
        ValueError: a batch of no or of several axes, a batch among several cases, fewer than two cases.
    """
    if isinstance(cases, Case):
        shape = open_loop(cases).batch
        if len(shape) != 1:
            raise ValueError(f"modes are tracked along one axis, this case has the batch shape {shape}")
        cases = tuple(_taken(cases, k, shape[0]) for k in range(shape[0]))
    if len(cases) < 2:
        raise ValueError("modes are tracked along two cases or more")
    for k, case in enumerate(cases):
        if open_loop(case).batch:
            raise ValueError(f"case {k + 1} of the sequence is a batch: give single cases, or one batch")
    return tuple(cases)


def between(one: Case, other: Case, part: float) -> Case:
    """Return the case at a fraction of the way from one to the other, every number interpolated linearly.

    Tanks keep the first case's damping laws: a damping on the way is interpolated as a ratio by the caller.

    Raises:
        NotAlike: parts, filters or modes differ in number, name or kind, or the vehicle between is impossible.
    """
    first, second = (case.model_copy(update={"name": one.name, "source": None}) for case in (one, other))
    try:
        found: Case = _mixed(first, second, part, "case")
    except ValidationError as error:
        raise NotAlike(f"the case between is impossible: {error.errors()[0]['msg']}") from error
    return found


def _taken(value: Any, k: int, size: int) -> Any:
    """Return element k of every array of a model; damping laws have none of the batch's axes."""
    if isinstance(value, BaseModel):
        fields = {name: getattr(value, name) for name in type(value).model_fields}
        return type(value)(**{n: x if _is_law(x) else _taken(x, k, size) for n, x in fields.items()})
    if isinstance(value, np.ndarray) and value.ndim:
        return float(np.broadcast_to(value, (size,))[k])
    if isinstance(value, tuple):
        return tuple(_taken(x, k, size) for x in value)
    if isinstance(value, dict):
        return {name: _taken(x, k, size) for name, x in value.items()}
    return value


def _mixed(one: Any, other: Any, part: float, where: str) -> Any:
    """Return what lies between two values of the same kind."""
    if _is_law(one):
        return one
    if type(one) is not type(other) and not (np.isscalar(one) and np.isscalar(other)):
        raise NotAlike(f"{where} is of two kinds")
    if isinstance(one, BaseModel):
        names = type(one).model_fields
        return type(one)(**{n: _mixed(getattr(one, n), getattr(other, n), part, n) for n in names})
    if isinstance(one, tuple):
        if len(one) != len(other):
            raise NotAlike(f"{where} has {len(one)} and {len(other)} entries")
        return tuple(_mixed(x, y, part, where) for x, y in zip(one, other, strict=True))
    if isinstance(one, dict):
        if one.keys() != other.keys():
            raise NotAlike(f"{where} has other names")
        return {n: _mixed(one[n], other[n], part, where) for n in one}
    if isinstance(one, float | int | np.ndarray):
        return (1.0 - part) * one + part * other
    if one != other:
        raise NotAlike(f"{where} is {one!r} and {other!r}")
    return one


def _is_law(value: Any) -> bool:
    """Whether a value is a tank's damping law, whatever the kind: it tells a ratio at an amplitude."""
    return isinstance(value, BaseModel) and "law" in type(value).model_fields
