"""A question that answers for one case, asked of each case of a batch and along further axes."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from pydantic import BaseModel

from sloshpy.case import Case
from sloshpy.damping import ConstantDamping, PowerDamping, SumDamping, TableDamping
from sloshpy.units import Array, Real

Answer = TypeVar("Answer")
_LAWS = (ConstantDamping, PowerDamping, SumDamping, TableDamping)  # their arrays are data, not a batch


@dataclass(frozen=True, kw_only=True)
class Answers(Generic[Answer]):
    """One answer for each case of a batch: `answers[2]`, `answers[0, 3]`, or all in turn by iteration.

    shape: of the batch. flat: the answers, last axis fastest.
    """

    shape: tuple[int, ...]
    flat: tuple[Answer, ...]

    def __getitem__(self, index: int | tuple[int, ...]) -> Answer:
        return self.flat[int(np.arange(len(self.flat)).reshape(self.shape)[index])]

    def __iter__(self) -> Iterator[Answer]:
        return iter(self.flat)

    def __len__(self) -> int:
        return len(self.flat)

    def values(self, name: str) -> Array:
        """Return one number or array of every answer, (*shape, ...), shorter arrays filled up with nan.

        Args:
            name: of a field or property, such as "slosh_amplitude"; dots lead inside: "required.neutral".

        Raises:
            TypeError: it is no number in some answer.
        """
        found = []
        for one in self.flat:
            value: Any = one
            for part in name.split("."):
                value = getattr(value, part)
            found.append(np.asarray(np.nan if value is None else value))
        if any(x.dtype.kind not in "bifc" for x in found):
            raise TypeError(f"{name} is no number; take it from each answer")
        size = tuple(int(n) for n in np.max([x.shape for x in found], axis=0))
        kind = complex if any(x.dtype.kind == "c" for x in found) else float
        stacked = np.full((len(found), *size), np.nan, dtype=kind)
        for k, x in enumerate(found):
            filled: tuple[int | slice, ...] = (k, *(slice(n) for n in x.shape))
            stacked[filled] = x
        return stacked.reshape(*self.shape, *size)

    def __str__(self) -> str:
        return "\n".join(f"{index}: {self[index]}" for index in np.ndindex(self.shape))


def for_each(verb: Callable[..., Answer], case: Case, *along: Real) -> Answers[Answer]:
    """Return the answer of a verb for each case of a batch and for each value of further axes.

    Args:
        verb: of one case and one value of each axis, such as `predict_limit_cycle` or a function of your own.
        case: its fields may carry leading axes.
        along: values handed to the verb after the case; their shapes broadcast with the batch's.

    For example `for_each(root_locus, case, np.array([0.0, 0.01, 0.02]))`: the loci at three dampings.
    """
    shape = np.broadcast_shapes(case_shape(case), *(np.shape(x) for x in along))
    axes = [np.broadcast_to(np.asarray(x, dtype=float), shape) for x in along]
    flat = tuple(verb(_at(case, shape, index), *(float(x[index]) for x in axes)) for index in np.ndindex(shape))
    return Answers(shape=shape, flat=flat)


def case_shape(case: Case) -> tuple[int, ...]:
    """Return the shape of a batch, () for one case."""
    return np.broadcast_shapes(*(x.shape for x in _arrays(case)))


def single(case: Case, verb: str) -> None:
    """Refuse a batch where a verb answers for one case."""
    shape = case_shape(case)
    if shape:
        raise ValueError(f"{verb} answers for one case, this is a batch of shape {shape}: for_each({verb}, case)")


def _arrays(value: Any) -> Iterator[Array]:
    """Return every array that carries leading axes."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, BaseModel) and not isinstance(value, _LAWS):
        for name in type(value).model_fields:
            yield from _arrays(getattr(value, name))
    elif isinstance(value, tuple | dict):
        for one in value.values() if isinstance(value, dict) else value:
            yield from _arrays(one)


def _at(value: Any, shape: tuple[int, ...], index: tuple[int, ...]) -> Any:
    """Return a case, or a part of one, with the arrays' entries at an index of the batch."""
    if isinstance(value, np.ndarray):
        return float(np.broadcast_to(value, shape)[index])
    if isinstance(value, BaseModel) and not isinstance(value, _LAWS):
        return value.model_copy(
            update={name: _at(getattr(value, name), shape, index) for name in type(value).model_fields}
        )
    if isinstance(value, dict):
        return {key: _at(one, shape, index) for key, one in value.items()}
    return tuple(_at(one, shape, index) for one in value) if isinstance(value, tuple) else value
