"""A pool of processes on this machine. A process that is killed takes its chunks with it: they are done again.

They are copies of this process, with all that it has loaded; a copy of a process with threads would have the threads'
locks without the threads, so then new interpreters are started. When this process is killed, those of the pool end.
"""

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from armkin.errors import ClusterError

Chunk = TypeVar("Chunk")
Result = TypeVar("Result")

CHUNKS_AHEAD = 2  # chunks for each process that wait for it, or for those before them
PATIENCE = 3  # times that the process of one chunk may end before the run ends

_job: tuple[Callable[[Any, Any], Any], Any] | None = None


def in_order(workers: int, work: Callable[[Any, Chunk], Result], job: Any, chunks: Iterable[Chunk]) -> Iterator[Result]:
    """See `armkin.engines.ordered_chunks.in_order`."""
    source = iter(chunks)
    futures: deque[tuple[Chunk, Future[Result]]] = deque()
    pool, lost_times = _start_pool(workers, work, job), 0
    try:
        while True:
            while len(futures) < CHUNKS_AHEAD * workers and (next_chunk := next(source, futures)) is not futures:
                futures.append((next_chunk, _submit(pool, next_chunk)))  # type: ignore[arg-type]
            if not futures:
                return
            try:
                answer = futures[0][1].result()
            except BrokenProcessPool:
                lost_times += 1
                if lost_times > PATIENCE:
                    message = f"the process of the same chunk has ended {lost_times} times: out of memory?"
                    raise ClusterError(message) from None
                pool.shutdown(wait=True, cancel_futures=True)
                pool = _start_pool(workers, work, job)
                futures = deque((chunk, _submit(pool, chunk)) for chunk, _ in futures)
                continue
            lost_times = 0
            futures.popleft()
            yield answer
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _start_pool(workers: int, work: Callable[[Any, Any], Any], job: Any) -> ProcessPoolExecutor:
    context = multiprocessing.get_context("fork" if _thread_count() == 1 else "spawn")
    return ProcessPoolExecutor(workers, context, _begin_worker, (work, job))


def _thread_count() -> int:
    """How many threads this process has, those of libraries among them; 0: the system does not tell."""
    try:
        return len(os.listdir("/proc/self/task"))
    except OSError:
        return 0


def _submit(pool: ProcessPoolExecutor, chunk: Any) -> Future[Any]:
    """A chunk given to the pool; of one that is broken already, a future that says so, as those given before do."""
    try:
        return pool.submit(_run_chunk, chunk)
    except BrokenProcessPool as error:
        failed_future: Future[Any] = Future()
        failed_future.set_exception(error)
        return failed_future


def _begin_worker(work: Callable[[Any, Any], Any], job: Any) -> None:
    """In a new process: Ctrl-C is the parent's matter, and without the parent there is nothing to do."""
    global _job
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _job = work, job


def _end_with_parent() -> None:
    """The queue of chunks never ends for a process of the pool, as it holds both ends of it."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run_chunk(chunk: Any) -> Any:
    assert _job is not None
    work, job = _job
    return work(job, chunk)
