"""A campaign: N draws of an uncertain case, each with its answer, computed block by block and kept in a store."""

import functools
import hashlib
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from sloshpy.batch import single
from sloshpy.dispersion.answers import answered
from sloshpy.dispersion.cluster import Cluster, computed_there
from sloshpy.dispersion.columns import columns_of
from sloshpy.dispersion.dispersion import Dispersion, Linear, drawn, moments_of
from sloshpy.dispersion.environment import environment
from sloshpy.dispersion.flown_faults import flown_fault
from sloshpy.dispersion.rows import Column, Rows, Status
from sloshpy.dispersion.store import HEADER, Layout, Store, open_store, read_header, sealed
from sloshpy.dispersion.streams import MOST_CASES
from sloshpy.dispersion.varied import find_input, stands_in
from sloshpy.dispersion.workers import computed
from sloshpy.errors import InputError, Problem
from sloshpy.units import Array, BoolArray

BLOCK = 1000  # cases
FLIGHTS = 100  # flights in a block, each of many moments
FLOWN = 20  # simulated flights in a block, a second or so each
CASE_LIMIT = 60.0  # s that one case may take in a process of its own
MOST_SEED = 2**64

LONG = 400  # letters
Watch = Callable[[int, int], None]  # of cases done now and in all


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """What N cases answered, in the order of their numbers.

    values: (N, columns), nan where a case has no number or is not done. status: (N,), of `Status`, nan where not done.
    reasons: by case number, of every case that is not OK. digest: of all rows in order, "" where some are missing.
    """

    dispersion: Dispersion
    seed: int
    columns: tuple[Column, ...]
    values: Array
    status: Array
    reasons: dict[int, str]
    digest: str

    @property
    def count(self) -> int:
        """How many cases were asked for."""
        return len(self.values)

    @property
    def done(self) -> BoolArray:
        """Which cases are done, (N,)."""
        return ~np.isnan(self.status)

    @property
    def whole(self) -> bool:
        """Whether every case is done."""
        return bool(np.all(self.done))

    def column(self, name: str) -> Array:
        """Return one number of every case, (N,)."""
        return self.values[:, [column.name for column in self.columns].index(name)]

    def draws(self) -> Array:
        """Return what was drawn, (N, parameters)."""
        return drawn(self.dispersion, self.seed, 0, self.count)


def run_campaign(
    dispersion: Dispersion,
    cases: int,
    seed: int,
    *,
    store: str | os.PathLike[str] | None = None,
    resume: bool = False,
    workers: int = 0,
    cluster: Cluster | None = None,
    case_limit: float = CASE_LIMIT,
    watch: Watch | None = None,
) -> Campaign:
    """Draw and answer the cases 0 to N - 1.

    Args:
        dispersion: the uncertain case and what is asked.
        cases: N, 1 or more. seed: root of all streams, 0 <= seed < 2^64.
        store: folder in which finished blocks are kept. resume: take up the campaign that it holds, which may grow.
        workers: processes; 0: this process, without guard against a case that hangs or crashes.
        cluster: workers of dask.distributed elsewhere, in place of `workers`.
        case_limit: s that one case, each time of a flight, or one simulated flight may take, with workers or a cluster.
        watch: told how many cases are done and how many there are.

    Raises:
        InputError: the store holds something else, is being written, or its disk is full; the cluster is not there, or
            its machines would give other digits.
    """
    layout = layout_of(dispersion, cases, seed)
    answer = functools.partial(answered, dispersion, seed)
    tell = watch or (lambda done, count: None)
    linear = isinstance(dispersion.analysis, Linear)
    limit = case_limit * (len(dispersion.cases) if linear else 1)

    def blocks(numbers: Iterable[int]) -> Iterator[tuple[int, Rows]]:
        if cluster is not None:
            return computed_there(cluster, answer, layout, numbers, limit)
        return computed(answer, layout, numbers, workers, limit)

    if store is None:
        kept: dict[int, Rows] = {}
        for number, rows in blocks(layout.numbers):
            kept[number] = rows
            tell(sum(r.count for r in kept.values()), cases)
        return _gathered(dispersion, seed, layout, kept.get)
    held = open_store(store, header_of(dispersion, cases, seed), layout, resume)
    with held.writing():
        fill(held, blocks, tell)
    return _gathered(dispersion, seed, layout, held.read)


def fill(store: Store, blocks: Callable[[Iterable[int]], Iterator[tuple[int, Rows]]], watch: Watch) -> None:
    """Compute the blocks that a store lacks, and write each as soon as it is ready."""
    layout = store.layout
    there = set(store.done())
    done = sum(layout.span(number)[1] for number in there)
    watch(done, layout.cases)
    missing = [number for number in layout.numbers if number not in there]
    for number, rows in blocks(missing):
        store.write(number, rows)
        done += rows.count
        watch(done, layout.cases)


def read_campaign(dispersion: Dispersion, folder: str | os.PathLike[str], partial: bool = False) -> Campaign:
    """Return the campaign that a store holds, from blocks that are proved whole.

    Raises:
        InputError: it is no store, belongs to other files, or is not whole and `partial` was not said.
    """
    header = read_header(Path(folder))
    cases, seed = int(header["cases"]), int(header["seed"])
    layout = layout_of(dispersion, cases, seed)
    wanted = sealed(header_of(dispersion, cases, seed) | {"environment": header["environment"]})
    store = Store(folder=Path(folder), header=header, layout=layout)
    if wanted != header:
        changed = sorted(k for k in {*wanted, *header} - {"campaign", "sha256"} if wanted.get(k) != header.get(k))
        raise InputError(
            _refused(
                "store", str(folder), f"is of another dispersion: {', '.join(changed)} differ", "name its own files"
            )
        )
    found = _gathered(dispersion, seed, layout, store.read)
    if not found.whole and not partial:
        rule = f"holds {int(np.sum(found.done))} of {cases} cases"
        raise InputError(
            _refused("store", str(folder), rule, "finish it with --resume, or say --partial to read it so")
        )
    return found


def lacking(dispersion: Dispersion, folder: str | os.PathLike[str], case: int) -> str:
    """Return why a store has no row of a case, in words; "" where it has one. A store as of `read_campaign`."""
    header = read_header(Path(folder))
    layout = layout_of(dispersion, int(header["cases"]), int(header["seed"]))
    return Store(folder=Path(folder), header=header, layout=layout).lacking(case)


def rerun(dispersion: Dispersion, seed: int, case: int) -> Rows:
    """Return the row of one case by its number, bit for bit the one of a campaign."""
    _checked(dispersion, case + 1, seed)
    return answered(dispersion, seed, case, 1)


def layout_of(dispersion: Dispersion, cases: int, seed: int) -> Layout:
    """Return how the cases of a campaign lie in blocks."""
    _checked(dispersion, cases, seed)
    return Layout(cases=cases, block=_block(dispersion), columns=tuple(c.name for c in columns_of(dispersion)))


def _block(dispersion: Dispersion) -> int:
    """Return how many cases a block holds."""
    if not dispersion.flight:
        return BLOCK
    return FLIGHTS if isinstance(dispersion.analysis, Linear) else FLOWN


def header_of(dispersion: Dispersion, cases: int, seed: int) -> dict[str, Any]:
    """Return what makes a campaign this one and no other, as JSON: file, case, seed, number, environment."""
    header: dict[str, Any] = {
        "format": 1,
        "name": dispersion.name,
        "cases": cases,
        "seed": seed,
        "block": _block(dispersion),
        "columns": [c.name for c in columns_of(dispersion)],
        "files": dispersion.digest,
        "configuration": _configuration(dispersion),
        "environment": environment(),
    }
    return sealed(header)


def _configuration(dispersion: Dispersion) -> dict[str, str]:
    """Return everything that a number depends on, however it was made, in words, so that a difference can be named."""
    case = dispersion.case
    nouns: dict[str, BaseModel] = {"vehicle": case.vehicle, "autopilot": case.autopilot, "criteria": case.criteria}
    nouns |= {f"tank {t.name}": t for t in case.vehicle.tanks}
    nouns |= {f"flexible_mode {f.name}": f for f in case.vehicle.flexible_modes}
    parts: dict[str, object] = {
        f"{noun} {name}": getattr(value, name)
        for noun, value in nouns.items()
        for name in type(value).model_fields
        if name not in {"tanks", "flexible_modes"}
    }
    parts |= {f"input {one.input}": one for one in dispersion.parameters}
    parts |= {f"correlation {k + 1}": (c.inputs, c.matrix.tolist()) for k, c in enumerate(dispersion.correlations)}
    parts |= {"sampling": dispersion.sampling, "analysis": type(dispersion.analysis).__name__}
    parts |= {f"analysis {name}": value for name, value in asdict(dispersion.analysis).items()}
    parts |= {"flight": dispersion.flight}
    # a long text, such as that of a table, is kept as its hash
    return {k: t if len(t := repr(x)) < LONG else hashlib.sha256(t.encode()).hexdigest() for k, x in parts.items()}


def _checked(dispersion: Dispersion, cases: int, seed: int) -> None:
    """Refuse what no campaign can be made of."""
    for case in dispersion.cases:
        single(case, "a campaign")
    if dispersion.flight and not isinstance(dispersion.analysis, Linear):
        _check_flown(dispersion)
    if not 1 <= cases <= MOST_CASES:
        raise InputError(_refused("cases", str(cases), f"must be 1 to {MOST_CASES}", "write --cases 2000"))
    if not 0 <= seed < MOST_SEED:
        raise InputError(_refused("seed", str(seed), "must be >= 0 and < 2^64", "write --seed 1"))
    for parameter in dispersion.parameters:
        if parameter.input.startswith("run.") and isinstance(dispersion.analysis, Linear):
            raise InputError(_refused("input", parameter.input, "is asked of a simulation", "ask [nonlinear]"))
        if not any(stands_in(case, parameter.input) for case in dispersion.cases):
            find_input(dispersion.case, parameter.input)  # says why not


def _check_flown(dispersion: Dispersion) -> None:
    """Refuse a flight that no draw of it could be simulated along."""
    if moments_of(dispersion.phases) != dispersion.flight:
        cure = "give phases, and flight=moments_of(phases)"
        raise InputError(_refused("flight", "", "has no phases that a simulation could go along", cure))
    fault = flown_fault(dispersion)
    if fault is not None:
        raise InputError(_refused(fault[0] or "nonlinear", "", *fault[1:]))


def _gathered(dispersion: Dispersion, seed: int, layout: Layout, read: Callable[[int], Rows | None]) -> Campaign:
    """Return the rows of all blocks that there are, in the order of the cases, and the hash of them all."""
    values, status = np.full((layout.cases, len(layout.columns)), np.nan), np.full(layout.cases, np.nan)
    reasons: dict[int, str] = {}
    for rows in _each(layout, read):
        part = slice(rows.first, rows.first + rows.count)
        values[part], status[part] = rows.values, rows.status
        reasons |= {rows.first + k: reason for k, reason in enumerate(rows.reasons) if rows.status[k] != Status.OK}
    digest = hashlib.sha256(np.column_stack([status, values]).astype("<f8").tobytes())
    digest.update(repr(sorted(reasons.items())).encode())
    whole = not np.any(np.isnan(status))
    return Campaign(
        dispersion=dispersion,
        seed=seed,
        columns=columns_of(dispersion),
        values=values,
        status=status,
        reasons=reasons,
        digest=digest.hexdigest() if whole else "",
    )


def _each(layout: Layout, read: Callable[[int], Rows | None]) -> Iterator[Rows]:
    for number in layout.numbers:
        rows = read(number)
        if rows is not None:
            yield rows


def holds_campaign(folder: Path) -> bool:
    """Return whether a folder is a store."""
    return (folder / HEADER).exists()


def _refused(key: str, value: str, rule: str, cure: str) -> Problem:
    return Problem(key=key, value=value, rule=rule, cure=cure)
