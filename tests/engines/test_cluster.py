"""A Dask cluster on this machine: the bytes of one process, whatever is killed."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from importlib import import_module
from pathlib import Path
from random import Random
from threading import Thread

import cluster_kills
import numpy as np
import pytest

import armkin
from armkin.cli.parsing import csv_to_numbers
from armkin.engines import dask_cluster
from armkin.engines.ordered_chunks import Engine, in_order
from armkin.errors import ClusterError
from command_line import ROOT, THREE_DOF, run
from killing_chunks import square_or_die


@pytest.fixture(scope="module")
def cluster_processes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[cluster_kills.Cluster]:
    """A scheduler with two worker processes, whose nanny starts another for one that is killed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.fspath(ROOT / "tests/helpers"))  # where the work is
        cluster = cluster_kills.Cluster(tmp_path_factory.mktemp("cluster"), 2)
        yield cluster
        cluster.close()


@pytest.fixture
def address(cluster_processes: cluster_kills.Cluster) -> str:
    """The scheduler's; one that was killed has a successor."""
    return cluster_processes.address


@pytest.mark.parametrize("engine_kind", ["cluster", "pool"])
def test_a_killed_worker_loses_its_chunk_alone(address: str, engine_kind: str, tmp_path: Path) -> None:
    engine = Engine(cluster=address) if engine_kind == "cluster" else Engine(workers=2)
    mark = tmp_path / "killed"
    assert list(in_order(engine, square_or_die, str(mark), range(8))) == [i * i for i in range(8)]
    assert mark.exists()


_POOL = """
import os, sys
from armkin.engines.ordered_chunks import Engine, in_order
from killing_chunks import wait_for_ever
if __name__ == "__main__":
    for found in in_order(Engine(workers=2), wait_for_ever, "", range(9)):
        print(found, flush=True)
"""


def test_a_killed_command_leaves_no_process(tmp_path: Path) -> None:
    """Of the pool; a chunk that is in hand is not waited for."""
    script = tmp_path / "pool.py"
    script.write_text(_POOL)
    finds = {**os.environ, "PYTHONPATH": os.fspath(ROOT / "tests/helpers")}
    with subprocess.Popen([sys.executable, script], env=finds, text=True, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        answered = {int(process.stdout.readline()) for _ in range(2)}
        process.kill()
        assert process.pid not in answered
        assert process.stdout.read() == ""  # ends when all that have it are gone


def test_a_batch_is_the_same_bytes_on_a_cluster(address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csv_to_numbers, "CHUNK_ROWS", 30)
    values = np.random.default_rng(2).uniform(-420, 420, (290, 3)).round(3)
    rows, alone, two = tmp_path / "in.csv", tmp_path / "one.csv", tmp_path / "two.csv"
    rows.write_text("x,y,z\n" + "\n".join(",".join(map(str, row)) for row in values.tolist()) + "\n")
    words = ("ik", THREE_DOF, "--batch", rows, "--out")
    assert run(*words, alone) == run(*words, two, "--cluster", address)
    assert alone.read_bytes() == two.read_bytes()


def test_work_is_shared_by_one_kind_of_engine(tmp_path: Path) -> None:
    """Before anything is connected to, or written."""
    words = ("reach", "three_dof", "--grid", 200, "--out", tmp_path / "one.npz")
    completed = run(*words, "--workers", 2, "--cluster", "tcp://127.0.0.1:1")
    assert completed.code == 2
    assert "workers and a cluster: the cluster has" in completed.err
    assert not [*tmp_path.iterdir()]


def test_reach_is_the_same_bytes_on_a_cluster(address: str, tmp_path: Path) -> None:
    alone, two = tmp_path / "one.npz", tmp_path / "two.npz"
    words = ("reach", "three_dof", "--grid", 60, "--out")
    assert run(*words, alone).code == run(*words, two, "--cluster", address).code == 0
    assert alone.read_bytes() == two.read_bytes()


@pytest.mark.parametrize("more", [(), ("--compiled",)])
def test_a_workspace_is_the_same_bytes_wherever_it_is_sampled(
    address: str, tmp_path: Path, more: tuple[str, ...], sample: Callable[[int, int], int]
) -> None:
    alone_file, two = tmp_path / "one.npz", tmp_path / "two.npz"
    words = ("workspace", "three_dof", "--samples", sample(150_000, 70_000), *more, "--json")
    alone = run(*words, "--out", alone_file).json
    spread = run(*words, "--out", two, "--cluster", address).json
    pool = run(*words, "--workers", 2).json if not more else alone
    for survey in (spread, pool):
        assert {**survey, "seconds": 0} == {**alone, "seconds": 0}
    assert alone_file.read_bytes() == two.read_bytes()


@pytest.fixture(scope="module")
def undisturbed_batch(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A batch's input, and the digest of its answers."""
    folder = tmp_path_factory.mktemp("undisturbed")
    source, target = folder / "in.csv", folder / "one.csv"
    cluster_kills.write_rows(source, 60_000)
    cluster_kills.begin_batch(source, target).communicate(timeout=cluster_kills.PATIENCE)
    return source, cluster_kills.file_digest(target)


@pytest.mark.parametrize("victim", ["worker", "client", "scheduler"])
def test_a_kill_costs_at_most_the_chunks_in_hand(
    victim: str, cluster_processes: cluster_kills.Cluster, undisturbed_batch: tuple[Path, str], tmp_path: Path
) -> None:
    """One of each here; twenty of each: tests/bench/bench_kills.py."""
    source, expected = undisturbed_batch
    disturbed = cluster_kills.disturb_batch(
        source, tmp_path / "two.csv", expected, victim, cluster_processes, Random(len(victim)), count=3
    )
    assert disturbed.same, disturbed
    assert disturbed.redone == 0
    assert disturbed.code in {"worker": (0, 3), "client": (0, 3, -9), "scheduler": (0, 1, 3)}[victim], disturbed
    if disturbed.code == 1:
        assert "the scheduler is gone" in disturbed.err


def test_no_scheduler_and_another_version_are_told(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(armkin, "__version__", "0.0.9")
    with pytest.raises(ClusterError, match="has armkin "):
        list(in_order(Engine(cluster=address), square_or_die, "", range(3)))
    monkeypatch.undo()
    monkeypatch.setattr(dask_cluster, "SECONDS", 0.5)
    with pytest.raises(ClusterError, match="no scheduler answers"):
        list(in_order(Engine(cluster="tcp://127.0.0.1:9"), square_or_die, "", range(3)))


@pytest.mark.parametrize(
    ("place", "says"),
    [
        ("tcp://127.0.0.1:9", "no scheduler answers (Connection refused); start one with: dask scheduler"),
        ("127.0.0.1:9", "no scheduler answers (Connection refused)"),
        ("tcp://127.0.0.1", "is no address of a scheduler, which is tcp://HOST:PORT"),
        ("scheduler", "is no address of a scheduler"),
        ("tcp://host:99999", "is no address of a scheduler"),
        ("tcp://a..b:8786", "no scheduler answers (a..b is no name of a computer)"),
    ],
)
def test_an_unreachable_address_is_said_within_three_seconds(place: str, says: str) -> None:
    import_module("distributed")  # whose time is that of every command with a cluster
    began = time.monotonic()
    with pytest.raises(ClusterError) as caught:
        list(in_order(Engine(cluster=place), square_or_die, "", range(3)))
    assert says in str(caught.value)
    assert time.monotonic() - began < 3


def test_a_name_that_nobody_knows_is_no_schedulers() -> None:
    """How long that takes to be known is the network's affair."""
    with pytest.raises(ClusterError, match="no scheduler answers \\("):
        list(in_order(Engine(cluster="tcp://nowhere.invalid:8786"), square_or_die, "", range(3)))


def test_an_address_that_drops_packets_is_said_within_three_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """A listener whose queue is full takes no connection and refuses none, as a firewall does."""
    with socket.socket() as deaf, ExitStack() as stack:
        deaf.bind(("127.0.0.1", 0))
        deaf.listen(0)
        for _ in range(8):
            client = stack.enter_context(socket.socket())
            client.setblocking(False)
            client.connect_ex(deaf.getsockname())
        import_module("distributed")
        began = time.monotonic()
        with pytest.raises(ClusterError, match=r"no connection in 1.5 s"):
            list(in_order(Engine(cluster=f"tcp://127.0.0.1:{deaf.getsockname()[1]}"), square_or_die, "", range(3)))
        assert time.monotonic() - began < 3


def test_another_program_at_the_address_is_no_scheduler() -> None:
    """A web server's answer, taken for a length, is more than any memory."""
    with socket.create_server(("127.0.0.1", 0)) as web:
        Thread(target=_serve_web, args=(web,), daemon=True).start()
        with pytest.raises(ClusterError, match="no scheduler answers \\(what answers there is no Dask scheduler"):
            list(in_order(Engine(cluster=f"tcp://127.0.0.1:{web.getsockname()[1]}"), square_or_die, "", range(3)))


def _serve_web(server: socket.socket) -> None:
    with suppress(OSError):  # until it is closed
        while True:
            with server.accept()[0] as connection, suppress(OSError):
                connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
                connection.recv(4096)
