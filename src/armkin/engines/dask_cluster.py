"""Runs chunks on a Dask cluster, a window of them at a time.

If a worker is killed, the scheduler gives its chunks to another worker. If the scheduler is killed, the run ends, but
the client has all finished results. Every chunk carries the job as bytes, which a worker unpacks once.
"""

import hashlib
import pickle
import platform
import socket
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import lru_cache
from importlib import import_module
from typing import Any, TypeVar

from armkin.errors import ArmkinError, ClusterError, MissingExtraError

Chunk = TypeVar("Chunk")
Result = TypeVar("Result")

REACHED = 1.5  # longest time [s] to connect to an address
SECONDS = 10  # longest time [s] to wait for an answer of a connected scheduler, or for a worker
CHUNKS_AHEAD = 3  # chunks sent ahead to each thread of the workers


def in_order(address: str, work: Callable[[Any, Chunk], Result], job: Any, chunks: Iterable[Chunk]) -> Iterator[Result]:
    """See `armkin.engines.ordered_chunks`. Raises ClusterError for a scheduler that cannot be reached or goes away."""
    client = _connect(address)
    try:
        _check_workers(client, address)
        data = pickle.dumps((work, job))
        yield from _results(client, address, data, iter(chunks))
    finally:
        with suppress(Exception):  # the scheduler may be gone
            client.close(timeout=2)


def _results(client: Any, address: str, data: bytes, source: Iterator[Any]) -> Iterator[Any]:
    """The results in order, with `CHUNKS_AHEAD` chunks for each thread, at least two, on the cluster."""
    futures: deque[Any] = deque()
    name = hashlib.sha256(data).hexdigest()
    while True:
        try:
            threads = sum(client.nthreads().values()) if not futures else 0
            window = max(CHUNKS_AHEAD * threads, 2, len(futures))
            while len(futures) < window and (chunk := next(source, futures)) is not futures:
                futures.append(client.submit(_run_chunk, data, name, chunk, pure=False))
            if not futures:
                return
            answer = futures.popleft().result()
        except ArmkinError:
            raise
        except Exception as error:
            raise _lost_error(client, address, error) from None
        yield answer
        # send a chunk for each result, so that the window stays full
        with suppress(StopIteration):
            futures.append(client.submit(_run_chunk, data, name, next(source), pure=False))


def _lost_error(client: Any, address: str, error: Exception) -> ClusterError:
    kind = type(error).__name__
    if kind == "KilledWorker":
        return ClusterError(f"{address}: the same chunk has ended several workers: out of memory?", address=address)
    if client.status != "running" or kind in ("CancelledError", "FutureCancelledError", "CommClosedError"):
        return ClusterError(f"{address}: the scheduler is gone", address=address)
    return ClusterError(f"{address}: a chunk failed: {kind}: {error}", address=address)


def _connect(address: str) -> Any:
    """A client of the scheduler at an address; ClusterError where it cannot be reached."""
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise MissingExtraError("a cluster needs Dask: pip install 'armkin[cluster]'") from None
    import logging

    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what is lost is said here
    _check_reached(address)
    try:
        return distributed.Client(address, timeout=SECONDS, set_as_default=False)
    except Exception as error:  # whatever comes of what another program answers: MemoryError of a length in its bytes
        reason = "what answers there is no Dask scheduler" if isinstance(error, MemoryError) else str(error)
        raise _no_scheduler(address, reason.partition("\n")[0] or type(error).__name__) from None


def _check_reached(address: str) -> None:
    """Raise ClusterError for an address to which no connection comes about: Dask would try again and again."""
    kind, _, place = address.rpartition("://")
    host, _, port = place.rpartition(":")
    if kind not in ("", "tcp", "tls") or not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise ClusterError(f"'{address}' is no address of a scheduler, which is tcp://HOST:PORT", address=address)
    try:
        socket.create_connection((host.strip("[]"), int(port)), REACHED).close()
    except UnicodeError:  # an empty part between two dots, or one above 63 characters
        raise _no_scheduler(address, f"{host} is no name of a computer") from None
    except OSError as error:
        reason = f"no connection in {REACHED:g} s" if isinstance(error, TimeoutError) else error.strerror or str(error)
        raise _no_scheduler(address, reason) from None


def _no_scheduler(address: str, reason: str) -> ClusterError:
    return ClusterError(f"{address}: no scheduler answers ({reason}); start one with: dask scheduler", address=address)


def _check_workers(client: Any, address: str) -> None:
    """Raise ClusterError if there is no worker, or one that would compute with another armkin, numpy or Python."""
    try:
        client.wait_for_workers(1, timeout=SECONDS)
        of_workers = client.run(versions)
    except TimeoutError:
        raise ClusterError(
            f"{address}: the scheduler has no worker; start one with: dask worker {address}", address=address
        ) from None
    except Exception as error:
        raise ClusterError(f"{address}: a worker has no armkin of this version: {error}", address=address) from None
    own_versions = versions()
    for worker, of_worker in of_workers.items():
        names = [name for name in own_versions if own_versions[name] != of_worker.get(name)]
        if names:
            differences = ", ".join(f"{name} {of_worker.get(name)} (here {own_versions[name]})" for name in names)
            raise ClusterError(f"{address}: worker {worker} has {differences}", address=address)


def versions() -> dict[str, str]:
    """Versions that must be the same on every worker."""
    import numpy

    from armkin import __version__

    return {"armkin": __version__, "numpy": numpy.__version__, "Python": platform.python_version().rpartition(".")[0]}


def _run_chunk(data: bytes, name: str, chunk: Any) -> Any:
    work, job = _unpack(_PackedJob(data, name))
    return work(job, chunk)


class _PackedJob:
    """The bytes of a job, compared by their name only."""

    def __init__(self, data: bytes, name: str) -> None:
        self.data, self.name = data, name

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _PackedJob) and self.name == other.name

    def __hash__(self) -> int:
        return hash(self.name)


@lru_cache(maxsize=4)
def _unpack(packed_job: _PackedJob) -> tuple[Callable[[Any, Any], Any], Any]:
    work, job = pickle.loads(packed_job.data)
    return work, job
