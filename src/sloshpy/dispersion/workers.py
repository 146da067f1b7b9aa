"""Blocks of cases on the cores of this machine; a case that hangs or kills its worker costs itself alone.

A worker is handed data and the number of a block and gives back arrays, which are checked on arrival. `computed` is the
one place where it is chosen who computes.
"""

import multiprocessing
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from multiprocessing.connection import Connection

from sloshpy.dispersion.rows import Rows, Status, failed, joined
from sloshpy.dispersion.store import Layout
from sloshpy.processes import begin, one_thread, pool_of

START = 60.0  # s, in which a worker must have begun
PATIENCE = 100  # a block may take the limit of one case, and a hundredth of it for each case
ATTEMPTS = 2  # a case is called crashed where it ends its worker so often: once may be someone's kill

Answer = Callable[[int, int], Rows]  # of first case and count; may be sent to another process


def computed(
    answer: Answer, layout: Layout, numbers: Iterable[int], workers: int, case_limit: float
) -> Iterator[tuple[int, Rows]]:
    """Return the rows of blocks in the order in which they are ready.

    Args:
        answer: what is asked of some cases.
        layout: of the blocks. numbers: of those wanted.
        workers: processes; 0: this process, which a case that hangs or crashes then takes along.
        case_limit: s that one case may take, in a process of its own.
    """
    if workers > 0:
        yield from _in_workers(answer, layout, numbers, workers, case_limit)
        return
    for number in numbers:
        yield number, answered_here(answer, *layout.span(number), len(layout.columns))


def answered_here(answer: Answer, first: int, count: int, columns: int) -> Rows:
    """Return the rows of some cases; where they raise something unforeseen, each by itself."""
    try:
        rows = answer(first, count)
        if not rows.sound(first, count, columns):
            raise TypeError("the answer is not whole")
        return rows
    except Exception as error:  # a fault of ours: the case is listed with it, the campaign goes on
        if count == 1:
            return failed(first, columns, Status.FAILED, f"{type(error).__name__}: {error}"[:200])
    return joined([answered_here(answer, k, 1, columns) for k in range(first, first + count)])


def _in_workers(
    answer: Answer, layout: Layout, numbers: Iterable[int], workers: int, case_limit: float
) -> Iterator[tuple[int, Rows]]:
    waiting, columns = deque(numbers), len(layout.columns)
    while waiting:
        suspects: list[int] = []
        running: dict[Future[Rows], tuple[int, float]] = {}
        with pool_of(min(workers, len(waiting))) as (pool, end_all):
            while (waiting or running) and not suspects:
                while waiting and len(running) < workers:
                    number = waiting.popleft()
                    first, count = layout.span(number)
                    allowed = START + case_limit * (1.0 + count / PATIENCE)
                    running[pool.submit(answered_here, answer, first, count, columns)] = (
                        number,
                        time.monotonic() + allowed,
                    )
                soonest = min(deadline for _, deadline in running.values())
                done, _ = wait(running, max(soonest - time.monotonic(), 0.0), return_when=FIRST_COMPLETED)
                if not done:  # one is late
                    suspects = [number for number, _ in running.values()]
                for future in done:
                    number, _ = running.pop(future)
                    rows = _arrived(future, *layout.span(number), columns)
                    if rows is None:
                        suspects.append(number)
                    else:
                        yield number, rows
            if suspects:  # the others that were under way die with the pool
                end_all()
                suspects += [number for number, _ in running.values() if number not in suspects]
        for number in suspects:
            yield number, one_by_one(answer, *layout.span(number), columns, case_limit)


def _arrived(future: Future[Rows], first: int, count: int, columns: int) -> Rows | None:
    """Return what a worker gave back, None where it died or sent something else than the rows asked for."""
    try:
        rows = future.result()
    except (BrokenProcessPool, OSError, EOFError):
        return None
    return rows if isinstance(rows, Rows) and rows.sound(first, count, columns) else None


def one_by_one(answer: Answer, first: int, count: int, columns: int, case_limit: float) -> Rows:
    """Return the rows of some cases, one after another in a process that may hang or die.

    A case that takes longer than its limit is marked so, one that ends its process twice as crashed; a new process
    goes on behind it.
    """
    parts: list[Rows] = []
    deaths, end = 0, first + count
    while first + len(parts) < end:
        at = first + len(parts)
        fate, rows = _stretch(answer, at, end, columns, case_limit)
        parts += rows
        at += len(rows)
        deaths = deaths + 1 if fate is Status.CRASHED and not rows else int(fate is Status.CRASHED)
        if fate is Status.TIMEOUT:
            parts.append(failed(at, columns, fate, f"took longer than {case_limit:g} s"))
        elif deaths >= ATTEMPTS:
            parts.append(failed(at, columns, Status.CRASHED, "its worker died"))
            deaths = 0
    return joined(parts)


def _stretch(answer: Answer, first: int, end: int, columns: int, case_limit: float) -> tuple[Status, list[Rows]]:
    """Return the rows of cases in one process until it is through, late or dead, and which of these it was."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_serve, args=(theirs, answer, first, end, columns), daemon=True)
    with one_thread():
        process.start()
    theirs.close()
    rows: list[Rows] = []
    try:
        _begun(ours)
        while first + len(rows) < end:
            if not ours.poll(case_limit):
                return Status.TIMEOUT, rows
            row = ours.recv()
            if not (isinstance(row, Rows) and row.sound(first + len(rows), 1, columns)):
                return Status.CRASHED, rows
            rows.append(row)
    except (EOFError, ConnectionResetError):
        return Status.CRASHED, rows
    finally:
        process.kill()
        process.join()
        process.close()
        ours.close()
    return Status.OK, rows


def _begun(connection: Connection) -> None:
    """Wait until a worker has begun.

    Raises:
        ChildProcessError: it does not, for which no case is to blame.
    """
    with suppress(EOFError, OSError):
        if connection.poll(START) and connection.recv() == "ready":
            return
    raise ChildProcessError("a worker process does not start; what is finished stays")


def _serve(connection: Connection, answer: Answer, first: int, end: int, columns: int) -> None:
    begin()
    connection.send("ready")
    for case in range(first, end):
        connection.send(answered_here(answer, case, 1, columns))
