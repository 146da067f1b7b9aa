"""Steps of work on the cores of this machine: the same steps as one after another, so the same bits."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any

from sloshpy.processes import pool_of


@dataclass(frozen=True, kw_only=True)
class Step:
    """One piece of work: in words, and the question, which may be sent to another process."""

    what: str
    ask: Callable[[], Any]


def answered(steps: Sequence[Step], workers: int, told: Callable[[str], None]) -> list[Any]:
    """Return the answer of every step, in their order.

    Args:
        steps: none of them rests on another. workers: processes; 0 or 1: this one alone.
        told: hears what was done, once for each step.

    What a worker that dies leaves behind is done here. An interrupt ends the workers at once.
    """
    found: dict[int, Any] = {}
    if workers > 1 and len(steps) > 1:
        for k, answer in _from_workers(steps, min(workers, len(steps))):
            found[k] = answer
            told(steps[k].what)
    for k, step in enumerate(steps):
        if k not in found:
            found[k] = step.ask()
            told(step.what)
    return [found[k] for k in range(len(steps))]


def _from_workers(steps: Sequence[Step], workers: int) -> Iterator[tuple[int, Any]]:
    """Return the answers as they come; those of a pool that breaks do not come."""
    with pool_of(workers) as (pool, _):
        running: dict[Future[Any], int] = {pool.submit(step.ask): k for k, step in enumerate(steps)}
        while running:
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                k = running.pop(future)
                try:
                    answer = future.result()
                except BrokenProcessPool:
                    return
                yield k, answer
