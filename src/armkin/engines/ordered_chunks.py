"""Runs chunks on an engine and returns their results in the order of the chunks."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple, TypeVar

from armkin.errors import UsageError

Chunk = TypeVar("Chunk")
Result = TypeVar("Result")


class Engine(NamedTuple):
    """workers: processes on this machine; cluster: the address of a Dask scheduler instead."""

    workers: int = 1
    cluster: str | None = None

    @property
    def uses_pool(self) -> bool:
        """Whether chunks run in other processes of this machine."""
        return self.workers > 1 and self.cluster is None


def in_order(
    engine: Engine, work: Callable[[Any, Chunk], Result], job: Any, chunks: Iterable[Chunk]
) -> Iterator[Result]:
    """``work(job, chunk)`` of every chunk; work is a function of a module, job and chunks can be pickled.

    Chunks are taken as they are needed. Raises what `work` raises; ClusterError; UsageError for both kinds of engine.
    """
    if engine.cluster is not None and engine.workers != 1:
        raise UsageError("workers and a cluster: the cluster has workers of its own; leave one of the two away")
    if engine.cluster is not None:
        from armkin.engines import dask_cluster

        return dask_cluster.in_order(engine.cluster, work, job, chunks)
    if engine.workers > 1:
        from armkin.engines import process_pool

        return process_pool.in_order(engine.workers, work, job, chunks)
    return (work(job, chunk) for chunk in chunks)
