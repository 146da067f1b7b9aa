"""Worker processes on the cores of this machine, one thread each; they end with whoever started them."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager


@contextmanager
def pool_of(workers: int) -> Iterator[tuple[ProcessPoolExecutor, Callable[[], None]]]:
    """Run workers, each with one BLAS thread; the function ends them all at once, hung ones too.

    All or none: one that is killed while it waits for work keeps the lock of the queue from the others.
    """
    others = set(multiprocessing.active_children())

    def end_all() -> None:
        for process in set(multiprocessing.active_children()) - others:
            process.kill()

    context = multiprocessing.get_context("spawn")  # a forked child would share locks and random state
    with one_thread():
        pool = ProcessPoolExecutor(workers, mp_context=context, initializer=begin)
        try:
            yield pool, end_all
        except BaseException:  # an interrupt too, or a reader who has seen enough
            end_all()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def one_thread() -> Iterator[None]:
    """Have the processes that are started meanwhile use one thread for linear algebra: so do their last digits."""
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


def begin() -> None:
    """Prepare a worker: the keyboard is the driver's, and without a driver it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def end_with_parent() -> None:
        if parent is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()
