"""Any law of damping as numbers, for each time and tank: power terms with their ends, and tables as cubics."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sloshpy.damping import AnyDamping, ConstantDamping, PowerDamping, SumDamping
from sloshpy.units import Array, IntArray


class LawTerms(NamedTuple):
    """Terms of the damping acceleration of n tanks at T times, K at most each; a kernel takes them as they are.

    A term is -c |v|^p v up to the speed `fastest` in m/s and nothing known beyond, or, where `table` is not -1, that
    table times c: -h(|v| / w) v, cubics between nodes. coefficient, exponent, fastest, frequency (w, rad/s), table:
    (T, n, K). node: of all tables in turn, in m; cubic: (its length, 4), highest power first, times w; first:
    (tables + 1,), where each starts.
    """

    coefficient: Array
    exponent: Array
    fastest: Array
    frequency: Array
    table: IntArray
    node: Array
    cubic: Array
    first: IntArray


def law_terms(laws: Sequence[Sequence[AnyDamping]], frequency: Array, factor: Array) -> LawTerms:
    """Return the terms of laws by time and tank, at slosh frequencies (T, n) in rad/s, each tank's times its factor.

    Raises:
        OutsideValidity: a table without a row at 0 m, whose force at small velocities is not known.
    """
    parts = [[flattened(law) for law in row] for row in laws]
    most = max(len(some) for row in parts for some in row)
    shape = (len(parts), len(parts[0]), most)
    coefficient, exponent, w = np.zeros(shape), np.zeros(shape), np.ones(shape)
    fastest, table = np.full(shape, np.inf), np.full(shape, -1, dtype=np.int64)
    known: dict[int, int] = {}
    nodes, cubics, first = [], [], [0]
    for (t, j, i), law in ((index, law) for index, law in _each(parts)):
        natural = float(frequency[t, j])
        if isinstance(law, ConstantDamping):
            coefficient[t, j, i] = 2.0 * law.constant_ratio * natural * factor[j]
        elif isinstance(law, PowerDamping):
            coefficient[t, j, i], exponent[t, j, i] = law.coefficient(natural) * factor[j], law.exponent
            fastest[t, j, i] = law.largest_amplitude * natural
        else:
            assert not isinstance(law, SumDamping)
            if id(law) not in known:
                known[id(law)] = len(known)
                node, cubic = law.force_cubics
                nodes.append(node)
                cubics.append(np.concatenate([cubic, np.zeros((1, 4))]))
                first.append(first[-1] + len(node))
            table[t, j, i], coefficient[t, j, i], w[t, j, i] = known[id(law)], factor[j], natural
    return LawTerms(
        coefficient=coefficient,
        exponent=exponent,
        fastest=fastest,
        frequency=w,
        table=table,
        node=np.concatenate([np.zeros(0), *nodes]),
        cubic=np.concatenate([np.zeros((0, 4)), *cubics]),
        first=np.array(first, dtype=np.int64),
    )


def flattened(law: AnyDamping) -> tuple[AnyDamping, ...]:
    """Return the laws that a sum holds, however deep; a single law alone."""
    return tuple(p for part in law.of for p in flattened(part)) if isinstance(law, SumDamping) else (law,)


def _each(parts: list[list[tuple[AnyDamping, ...]]]) -> list[tuple[tuple[int, int, int], AnyDamping]]:
    return [((t, j, i), law) for t, row in enumerate(parts) for j, some in enumerate(row) for i, law in enumerate(some)]
