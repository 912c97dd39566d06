"""A batch on a Dask cluster of processes of its own, of which any is killed with SIGKILL at any moment."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np

PATIENCE = 240.0  # [s] for anything: a crowded machine is slow


class Cluster:
    """A scheduler, and a nanny with so many workers."""

    def __init__(self, folder: Path, workers: int) -> None:
        self.folder, self.count = folder, workers
        self.start()

    def start_again(self) -> None:
        """A new scheduler with new workers."""
        self.close()
        self.start()

    def start(self) -> None:
        """Start all processes."""
        folder, workers = self.folder, self.count
        self.file = folder / f"scheduler-{time.monotonic_ns()}.json"
        common = ["--scheduler-file", str(self.file), "--no-dashboard"]
        self.scheduler = _start_dask("scheduler", "--host", "127.0.0.1", "--port", "0", *common)
        self.nanny = _start_dask("worker", *common, "--nworkers", str(workers), "--nthreads", "1")
        wait_until(lambda: self.file.exists() and self.file.stat().st_size > 0)
        # a nanny whose worker is killed before it has come up starts no other, and ends
        distributed: Any = import_module("distributed")
        with distributed.Client(self.address, timeout=PATIENCE, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=PATIENCE)

    @property
    def address(self) -> str:
        """Of the scheduler."""
        import json

        return str(json.loads(self.file.read_text())["address"])

    def workers(self) -> list[int]:
        """The processes that answer chunks."""
        return [pid for pid in all_children(self.nanny.pid) if b"spawn_main" in command_line(pid)]

    def close(self) -> None:
        """End all of it."""
        for process in (self.nanny, self.scheduler):
            pids = [process.pid, *all_children(process.pid)]
            for pid in pids:
                kill_process(pid)
            process.wait(PATIENCE)


class Told(NamedTuple):
    """How a command that was disturbed ended, and whether its bytes were those of an undisturbed one."""

    code: int
    err: str
    killed: bool  # the kill came before its end
    kept: int  # parts that were finished at the kill
    redone: int  # of these, answered again
    same: bool


def write_rows(path: Path, count: int) -> None:
    """Targets of a UR5e as CSV."""
    rng = np.random.default_rng(3)
    values = np.column_stack([rng.uniform(-500, 500, (count, 3)), rng.uniform(-180, 180, (count, 3))]).round(3)
    with path.open("w") as file:
        file.write("x,y,z,roll,pitch,yaw\n")
        np.savetxt(file, values, fmt="%.3f", delimiter=",")


def begin_batch(source: Path, out: Path, *more: str) -> subprocess.Popen[str]:
    """The command."""
    words = [sys.executable, "-m", "armkin", "ik", "ur5e", "--batch", str(source), "--out", str(out), *more]
    return subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def file_digest(path: Path) -> str:
    """Of a file's bytes."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def disturb_batch(
    source: Path, out: Path, expected: str, victim: str, cluster: Cluster, rng: Random, count: int
) -> Told:
    """A batch of `count` parts during which a worker, the scheduler or the client is killed; then it goes on.

    A killed scheduler has another in its place.
    """
    process = begin_batch(source, out, "--cluster", cluster.address)
    parts = Path(f"{out}.parts")
    least_parts = rng.randrange(count)
    wait_until(lambda: len(finished_parts(parts)) >= least_parts or process.poll() is not None)
    time.sleep(rng.uniform(0.0, 0.3))
    killed = process.poll() is None
    if victim == "worker":
        wait_until(lambda: bool(cluster.workers()) or process.poll() is not None)
        for pid in cluster.workers()[:1]:
            kill_process(pid)
    else:
        kill_process(process.pid if victim == "client" else cluster.scheduler.pid)
    _, err = process.communicate(timeout=PATIENCE)
    before = finished_parts(parts)
    if victim == "scheduler":
        cluster.start_again()
    if process.returncode in (0, 3):
        return Told(process.returncode, err, killed, len(before), 0, file_digest(out) == expected)
    again = begin_batch(source, out, "--cluster", cluster.address, "--resume")
    redone: set[str] = set()
    while again.poll() is None:  # a part that is written anew is another file
        parts_now = finished_parts(parts)
        redone |= {name for name, file in before.items() if name in parts_now and parts_now[name] != file}
        time.sleep(0.02)
    again.communicate(timeout=PATIENCE)
    good = again.returncode in (0, 3) and file_digest(out) == expected and not parts.exists()
    return Told(process.returncode, err, killed, len(before), len(redone), good)


def finished_parts(parts: Path) -> dict[str, int]:
    """The parts that are there, and which file each is."""
    inode_of = {}
    for path in parts.glob("[0-9]*[0-9]"):
        try:
            inode_of[path.name] = path.stat().st_ino
        except OSError:
            continue  # gone meanwhile
    return inode_of


def wait_until(ready: Any) -> None:
    """Wait for something."""
    end = time.monotonic() + PATIENCE
    while not ready():
        assert time.monotonic() < end
        time.sleep(0.01)


def kill_process(pid: int) -> None:
    """SIGKILL, to a process that may have ended."""
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return


def all_children(pid: int) -> list[int]:
    """All processes below one."""
    try:
        direct = [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []
    return [descendant for child in direct for descendant in (child, *all_children(child))]


def command_line(pid: int) -> bytes:
    """Of a process; empty for one that has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def _start_dask(*words: str) -> subprocess.Popen[bytes]:
    command: Sequence[str] = [sys.executable, "-m", "dask", *words]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
