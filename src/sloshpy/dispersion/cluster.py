"""Blocks of cases on other machines, by dask.distributed: the same bits as here, and nothing taken on trust.

A worker is handed the question and the number of a block. It gives back bytes in the store's format and says what its
digits rest on; both are checked on arrival. A block whose worker dies or is late is worked on here, case by case.

Without TLS only the loopback is spoken to. Beyond it both sides prove themselves by certificates, since whoever may
speak to a scheduler may run anything on its workers.
"""

import ipaddress
import json
import os
import time
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from sloshpy.dispersion.block import decoded, encoded
from sloshpy.dispersion.environment import environment
from sloshpy.dispersion.rows import Rows
from sloshpy.dispersion.store import Layout, differences, identity
from sloshpy.dispersion.workers import PATIENCE, START, Answer, answered_here, one_by_one
from sloshpy.errors import InputError, Problem

if TYPE_CHECKING:
    from distributed import Client, Future

CONNECT = 20.0  # s, for a scheduler to answer and for a first worker to be there
PLAIN = ["msgpack", "error"]  # of what comes back: numbers, texts, bytes; errors stay dask's own, pickled
GLANCE = 1.0  # s between two looks for what is late
ONE_THREAD = "OPENBLAS_NUM_THREADS"  # 1 in every worker: dask's nanny sees to it


@dataclass(frozen=True, kw_only=True)
class Cluster:
    """Where a scheduler listens, and the PEM files by which both sides know each other.

    address: "tls://host:8786"; of the loopback also "tcp://127.0.0.1:8786" or "127.0.0.1:8786".
    ca, cert, key: certificate of the authority, own certificate, own key; all of them or none.

    Raises:
        InputError: an address that is not the loopback without TLS, or files that are not there.
    """

    address: str
    ca: Path | None = None
    cert: Path | None = None
    key: Path | None = None

    def __post_init__(self) -> None:
        given = {"tls-ca": self.ca, "tls-cert": self.cert, "tls-key": self.key}
        if any(given.values()) and not all(given.values()):
            lacking = next(name for name, file in given.items() if file is None)
            raise _refused(lacking, "", "is missing beside the other two", f"name the file of --{lacking}")
        for name, file in given.items():
            if file is not None and not file.is_file():
                raise _refused(name, file, "is no file", "name a PEM file")
        parts = urlsplit(self.address if "://" in self.address else f"//{self.address}")
        try:
            whole = parts.hostname is not None and parts.port is not None and parts.scheme in {"", "tcp", "tls"}
        except ValueError:  # a port that is no number
            whole = False
        if not whole:
            raise _refused("cluster", self.address, "is no address of a scheduler", "write tls://host:8786")
        if not self.secure and (parts.scheme == "tls" or not is_loopback(parts.hostname or "")):
            cure = "say --tls-ca, --tls-cert and --tls-key, or reach it through a tunnel to 127.0.0.1"
            rule = "is not the loopback, and nothing proves who is there"
            raise _refused("cluster", self.address, rule if parts.scheme != "tls" else "needs certificates", cure)
        if self.secure and parts.scheme == "tcp":
            raise _refused("cluster", self.address, "is spoken to in clear", "write tls:// in place of tcp://")

    @property
    def secure(self) -> bool:
        """Whether both sides prove themselves."""
        return self.ca is not None

    @property
    def url(self) -> str:
        """The address with its protocol."""
        if "://" in self.address:
            return self.address
        return f"{'tls' if self.secure else 'tcp'}://{self.address}"


def is_loopback(host: str) -> bool:
    """Return whether a host is this machine by its own inner address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def computed_there(
    cluster: Cluster, answer: Answer, layout: Layout, numbers: Iterable[int], case_limit: float
) -> Iterator[tuple[int, Rows]]:
    """Return the rows of blocks in the order in which they are ready; see `computed`.

    Raises:
        InputError: no scheduler, no worker, or one whose versions, code or processor differ.
    """
    with _connected(cluster) as client:
        _checked(cluster, client)
        yield from _Run(client, answer, layout, case_limit).blocks(numbers)


def _connected(cluster: Cluster) -> "Client":
    try:
        from distributed import Client, Security
    except ImportError:
        cure = "pip install 'sloshpy[cluster]', or leave --cluster out"
        raise _refused("cluster", cluster.address, "needs dask.distributed, which is not installed", cure) from None
    ca, cert, key = (str(x) for x in (cluster.ca, cluster.cert, cluster.key))
    how = Security(tls_ca_file=ca, tls_client_cert=cert, tls_client_key=key, require_encryption=True)
    try:
        client = Client(cluster.url, security=how if cluster.secure else None, timeout=CONNECT, deserializers=PLAIN)
    except (OSError, ValueError, RuntimeError, TypeError) as error:
        rule = f"does not answer ({' '.join(str(error).split())[:120]})"
        raise _refused("cluster", cluster.address, rule, "start it: docs/dispersions.md says how") from None
    return client


def _checked(cluster: Cluster, client: "Client") -> None:
    """Refuse a cluster without workers, one that speaks in clear beyond the loopback, or with another environment."""
    _wait_for_one(client, cluster.address)
    told = client.scheduler_info(n_workers=-1)
    open_ = [a for a in (told["address"], *told["workers"]) if not _private(str(a))]
    if open_ and not cluster.secure:
        rule = f"passes cases to {open_[0]} in clear"
        raise _refused("cluster", cluster.address, rule, "start scheduler and workers with --host 127.0.0.1, or by TLS")
    for worker, found in client.run(environment_there, on_error="return").items():
        if not isinstance(found, str):
            rule = f"has a worker {worker} that cannot run sloshpy ({type(found).__name__}: {found})"[:300]
            raise _refused("cluster", cluster.address, rule, "install the same sloshpy there")
        _compared(worker, found)


def _wait_for_one(client: "Client", address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=CONNECT)
    except TimeoutError:
        cure = "start some: dask worker ADDRESS; what is finished is in the store"
        raise _refused("cluster", address, "has no worker", cure) from None


def _private(address: str) -> bool:
    parts = urlsplit(address)
    return parts.scheme == "inproc" or is_loopback(parts.hostname or "")


def environment_there() -> str:
    """Return what this process's digits rest on, as JSON: versions, code, processor, threads of the linear algebra."""
    return json.dumps(environment() | {"threads": os.environ.get(ONE_THREAD, "")}, sort_keys=True)


def _compared(worker: str, told: str) -> None:
    """Refuse a worker whose digits may differ from those computed here."""
    here = environment() | {"threads": "1"}
    try:
        there = json.loads(told)
    except ValueError:
        there = None
    if not isinstance(there, dict):
        raise _refused("cluster", worker, "does not say what it runs", "install the same sloshpy there")
    if there != here:
        told_apart = differences({"its": there}, {"its": here})
        cure = f"install the same on every machine; {ONE_THREAD}=1 for the workers"
        raise InputError(*(Problem(key="cluster", value=worker, rule=text, cure=cure) for text, _ in told_apart))


def answer_there(answer: Answer, number: int, first: int, count: int, columns: int) -> dict[str, Any]:
    """Return a block's bytes and what its digits rest on; runs in a worker."""
    own = environment_there()
    return {"environment": own, "block": encoded(number, answered_here(answer, first, count, columns), own)}


def arrived(reply: object, worker: str, number: int, first: int, count: int, columns: int) -> Rows | None:
    """Return the rows that a worker sent, None where they are not whole or not those that were asked for.

    Raises:
        InputError: its versions, code or processor differ.
    """
    if not isinstance(reply, dict) or not isinstance(reply.get("block"), bytes):
        return None
    own = reply.get("environment")
    if not isinstance(own, str):
        return None
    _compared(worker, own)
    rows = decoded(reply["block"], number, own)
    return rows if rows is not None and rows.sound(first, count, columns) else None


class _Run:
    """Blocks under way: as many as there are threads, so that the time of each is known."""

    def __init__(self, client: "Client", answer: Answer, layout: Layout, case_limit: float) -> None:
        self._client, self._answer, self._layout, self._limit = client, answer, layout, case_limit
        self._running: dict[Future, tuple[int, float]] = {}
        self._name = identity({"time": time.time_ns(), "process": os.getpid()})[:12]

    def blocks(self, numbers: Iterable[int]) -> Iterator[tuple[int, Rows]]:
        """Return number and rows of each block."""
        waiting = deque(numbers)
        try:
            while waiting or self._running:
                self._fill(waiting)
                for number, rows in self._ready():
                    yield number, rows if rows is not None else self._by_hand(number)
        finally:  # an interrupt too
            self._client.cancel(list(self._running), force=True)

    def _fill(self, waiting: deque[int]) -> None:
        places = sum(self._client.nthreads().values())
        if not places and not self._running:
            _wait_for_one(self._client, self._client.scheduler.address)
            places = 1
        while waiting and len(self._running) < places:
            number = waiting.popleft()
            first, count = self._layout.span(number)
            question = self._answer, number, first, count, len(self._layout.columns)
            future = self._client.submit(answer_there, *question, pure=False, key=f"sloshpy-{self._name}-{number}")
            allowed = START + self._limit * (1.0 + count / PATIENCE)
            self._running[future] = number, time.monotonic() + allowed

    def _ready(self) -> Iterator[tuple[int, Rows | None]]:
        """Return the blocks that have arrived, and those that are lost: None."""
        from distributed import wait

        with suppress(TimeoutError):
            wait(list(self._running), timeout=GLANCE, return_when="FIRST_COMPLETED")
        for future in [f for f in self._running if f.done()]:
            number, _ = self._running.pop(future)
            yield number, self._taken(future, number)
        late = [f for f, (_, deadline) in self._running.items() if time.monotonic() > deadline]
        if late:
            yield from self._ended(late)

    def _taken(self, future: "Future", number: int) -> Rows | None:
        if future.status != "finished":  # its workers died, or the task could not be sent
            return None
        return arrived(future.result(), "a worker", number, *self._layout.span(number), len(self._layout.columns))

    def _ended(self, late: "list[Future]") -> Iterator[tuple[int, Rows | None]]:
        """End the workers of blocks that are late: a task cannot be ended alone."""
        busy = self._client.processing()
        keys = {f.key for f in late}
        hung = [worker for worker, tasks in busy.items() if keys & set(tasks)]
        self._client.cancel(late, force=True)
        with suppress(Exception):  # a worker without a nanny stays as it is
            self._client.restart_workers(hung, timeout=START, raise_for_error=False)
        for future in late:
            number, _ = self._running.pop(future)
            yield number, None

    def _by_hand(self, number: int) -> Rows:
        """Compute a block here, case by case, each guarded."""
        return one_by_one(self._answer, *self._layout.span(number), len(self._layout.columns), self._limit)


def _refused(key: str, value: object, rule: str, cure: str) -> InputError:
    return InputError(Problem(key=key, value=str(value), rule=rule, cure=cure))
