"""Steps of work on the cores of this machine: the same steps as one after another, so the same bits."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any


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
    with _pool(workers) as pool:
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


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Run workers with one BLAS thread each; whatever ends this early kills them, so that no one waits for them."""
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")  # a forked child would share locks
    with _one_thread():
        pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin)
        try:
            yield pool
        except BaseException:  # an interrupt too
            for process in set(multiprocessing.active_children()) - others:
                process.kill()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Have the processes that are started meanwhile use one thread for linear algebra: the cores are taken."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _begin() -> None:
    """Prepare a worker: the keyboard is the driver's, and without a driver it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def end_with_parent() -> None:
        if parent is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()
