"""CPU time a row of `ik --batch`, processes, memory, rows that nothing reaches, and what a Dask cluster costs.

python tests/bench/bench_columns.py [--rows N] [rows] [unsolvable] [workers] [memory] [cluster]

Typed poses: random ones of a UR5e, rounded to three decimals. "whole" is the command from its start; "slope" leaves out
what does not grow with the rows (imports, the compiled arm). CPU time is that of all processes, the least of three.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import armkin
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.task import targets_of
from armkin.model.target_numbers import targets_out

LABELS = ("x", "y", "z", "roll", "pitch", "yaw")
BARS = {"csv": 6.0, "npz": 3.0, "parquet": 3.0, "all branches": 20.0}  # [us] a row
UNSOLVABLE = 3_000  # [rows a second]
MEMORY = 300  # [MB]
FASTER = 1.7  # times by two processes on two cores
OVERHEAD = 0.03  # of chunks of a second
AT_REST = 0.56  # [us] a pose of a UR5e, all branches


class Spent(NamedTuple):
    """Of a command and its processes: CPU and wall time [s]."""

    cpu: float
    wall: float


def poses(count: int) -> np.ndarray:
    """Random typed targets (count, 6) of a UR5e."""
    return typed_targets(armkin.load("ur5e"), np.random.default_rng(3).uniform(-np.pi, np.pi, (count, 6)))


def typed_targets(arm: Any, q: np.ndarray) -> np.ndarray:
    """Targets (N, 6) [mm, deg] of joint values as people write them."""
    return np.round(targets_out(LABELS, targets_of(task_for(arm, None), armkin.fk(arm, q), q)), 3)


def write_targets(values: np.ndarray, folder: Path, name: str) -> dict[str, Path]:
    """The targets in each format, and "all branches" as CSV."""
    import pyarrow as pa
    import pyarrow.parquet as parquet

    columns = dict(zip(LABELS, values.T, strict=True))
    path_of = {end: folder / f"{name}.{end}" for end in ("csv", "npz", "parquet")}
    with path_of["csv"].open("w") as file:
        file.write(",".join(LABELS) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in values.tolist())
    np.savez(path_of["npz"], **columns)
    parquet.write_table(pa.table(columns), path_of["parquet"])
    return path_of | {"all branches": path_of["csv"]}


def least_cost(*words: Any, times: int = 3) -> Spent:
    """The least CPU time of some runs of a command, with byte code as an installed package has it."""
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": ""}
    least = Spent(np.inf, np.inf)
    for _ in range(times):
        began, clock = _children_cpu(), time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "armkin", *map(str, words)],
            env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False,
        )  # fmt: skip
        cost = Spent(_children_cpu() - began, time.perf_counter() - clock)
        least = Spent(min(cost.cpu, least.cpu), min(cost.wall, least.wall))
    return least


def _children_cpu() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def batch_command(source: Path, folder: Path, *more: Any) -> tuple[Any, ...]:
    """The command."""
    target = folder / f"out{source.suffix}"
    return ("ik", "ur5e", "--batch", source, "--compiled", "--out", target, *more)


def numpy_us_a_pose() -> float:
    """CPU time of a pose solved in numpy [us], the least of five: how busy the machine is."""
    arm, least = armkin.load("ur5e"), np.inf
    T = armkin.fk(arm, np.random.default_rng(1).uniform(-3.0, 3.0, (16_384, 6)))
    for _ in range(5):
        began = time.process_time()
        armkin.ik(arm, T)
        least = min(least, time.process_time() - began)
    return least / len(T) * 1e6


def meets_row_bar(folder: Path, count: int) -> bool:
    """CPU time a row, best branch and all."""
    values, good = poses(count), True
    print(
        f"a pose solved in numpy: {numpy_us_a_pose():.2f} us here, {AT_REST:g} on a machine at rest (docs/figures.md)",
        flush=True,
    )
    tenth, every_row = write_targets(values[: count // 10], folder, "few"), write_targets(values, folder, "many")
    for name, bar in BARS.items():
        more = ("--all-branches",) if name == "all branches" else ()
        small, large = (least_cost(*batch_command(files[name], folder, *more)).cpu for files in (tenth, every_row))
        slope, with_start = (large - small) / (0.9 * count) * 1e6, large / count * 1e6
        good &= slope <= bar
        print(
            f"{name:13}{count:,} rows: {slope:5.2f} us a row, {with_start:5.2f} with the start (bar {bar:g})",
            flush=True,
        )
    return good


def meets_unsolvable_bar(folder: Path, count: int) -> bool:
    """Rows far away, outside the limits, and of a straight elbow, which rounding takes a little too far."""
    good, count = True, count // 4
    rng, arm, tight = np.random.default_rng(4), armkin.load("ur5e"), armkin.load("irb120")
    q = rng.uniform(-np.pi, np.pi, (count * 20, 6))
    bent = q[(np.abs(q[:, 4]) > 2.2) & (np.abs(q[:, 2]) > 2.2)][:count]
    straight = np.where(np.arange(6) == 2, 0.0, q[: count // 50])
    cases = {
        "far away": ("ur5e", poses(count) * [3.0, 3.0, 3.0, 1.0, 1.0, 1.0]),
        "outside limits": ("irb120", typed_targets(tight, bent)),
        "a little too far": ("ur5e", typed_targets(arm, straight)),
    }
    for name, (robot, values) in cases.items():
        every_row = write_targets(values, folder, "off")["csv"]
        tenth = write_targets(values[: len(values) // 10], folder, "few")["csv"]
        costs = [least_cost("ik", robot, *batch_command(path, folder)[2:]).cpu for path in (tenth, every_row)]
        rate = 0.9 * len(values) / max(costs[1] - costs[0], 1e-3)
        good &= rate >= UNSOLVABLE
        print(f"{name:17}{len(values):,} rows: {rate:,.0f} a second (bar {UNSOLVABLE:,})", flush=True)
    return good


def meets_worker_bar(folder: Path, count: int) -> bool:
    """Two processes against one: wall time, and what it would be on two cores that do nothing else."""
    source = write_targets(poses(count), folder, "many")["csv"]
    alone, two = (least_cost(*batch_command(source, folder, "--workers", n)) for n in (1, 2))
    print(f"workers      1: {alone.cpu:.2f} s of CPU, {alone.wall:.2f} s; 2: {two.cpu:.2f} s, {two.wall:.2f} s")
    faster, most = alone.wall / two.wall, 2 * alone.cpu / two.cpu
    print(f"{'':13}{faster:.2f} times as fast (bar {FASTER}), at most {most:.2f} by the CPU time")
    return alone.wall / two.wall >= FASTER


def meets_memory_bar(folder: Path, count: int) -> bool:
    """Memory of a process for some rows, and for ten times as many: the same hundred thousand again and again."""
    block, peak_of = min(count // 10, 100_000), {}
    heading, _, lines = write_targets(poses(block), folder, "block")["csv"].read_text().partition("\n")
    for name, size in (("few", count // 10), ("many", count)):
        source = folder / f"{name}.csv"
        with source.open("w") as file:
            file.write(f"{heading}\n")
            file.writelines(lines for _ in range(size // block))
        words = [sys.executable, "-m", "armkin", *map(str, batch_command(source, folder))]
        # by way of a small process: what a process had before it became the command counts as the command's
        completed = subprocess.run([sys.executable, "-c", _LARGEST, *words], capture_output=True, text=True, check=True)
        peak_of[name] = int(completed.stdout) / 1024
        print(f"memory       {size:,} rows: {peak_of[name]:.0f} MB (bar {MEMORY})", flush=True)
    return peak_of["many"] <= MEMORY


_LARGEST = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""


def busy_chunk(job: float, chunk: bytes) -> bytes:
    """A chunk that takes `job` seconds of CPU time."""
    end = time.thread_time() + job
    while time.thread_time() < end:
        pass
    return chunk


def waiting_chunk(job: float, chunk: bytes) -> bytes:
    """A chunk that takes `job` seconds and no CPU time: all of what its worker takes is Dask's."""
    time.sleep(job)
    return chunk


def meets_cluster_bar(folder: Path, count: int) -> bool:
    """What a Dask worker of one thread takes beside chunks of a second, a megabyte each way; scheduler and client.

    Chunks that wait are a second long however busy the machine is, so that heartbeats and the worker's profiler weigh
    what they weigh beside a core of its own. Chunks that work show, on two cores at rest, the same by the clock.
    """
    import distributed

    environment = {**os.environ, "PYTHONPATH": os.fspath(Path(__file__).parent)}
    file = folder / "scheduler.json"
    words = [sys.executable, "-m", "dask"]
    with (
        subprocess.Popen([*words, "scheduler", "--scheduler-file", file, "--host", "127.0.0.1", "--port", "0",
                          "--no-dashboard"], env=environment, stderr=subprocess.DEVNULL) as scheduler,
        subprocess.Popen([*words, "worker", "--scheduler-file", file, "--no-nanny", "--nthreads", "1",
                          "--no-dashboard"], env=environment, stderr=subprocess.DEVNULL) as worker,
    ):  # fmt: skip
        try:
            sys.modules.setdefault("bench_columns", sys.modules["__main__"])
            busy_chunk.__module__ = waiting_chunk.__module__ = "bench_columns"
            address, pids = _scheduler_address(file), (worker.pid, scheduler.pid)
            with distributed.Client(address) as client:  # type: ignore[no-untyped-call]
                client.wait_for_workers(1, timeout=120)
            _cost_a_chunk(address, pids, waiting_chunk, 0.01, 3)  # imports
            share = _cost_a_chunk(address, pids, waiting_chunk, 1.0, 24)
            work = _cost_a_chunk(address, pids, busy_chunk, 1.0, 12)
        finally:
            worker.kill()
            scheduler.kill()
    print(f"cluster      worker {share.worker:.2%} of chunks of a second (bar {OVERHEAD:.0%}), scheduler", end=" ")
    print(f"{share.scheduler:.2%}, client {share.client:.2%} on the other core; {share.wall - 1:.2%} more by the clock")
    print(
        f"{'':13}chunks that work: {work.worker - 1:.2%} more CPU time in the worker; a chunk and what is beside it",
        end=" ",
    )
    print(f"{work.wall:.2f} s by the clock, which tells on a machine at rest alone")
    return share.worker <= OVERHEAD


class Beside(NamedTuple):
    """CPU time and wall time of chunks, each of a second [s]."""

    worker: float
    scheduler: float
    client: float
    wall: float


def _cost_a_chunk(address: str, pids: tuple[int, int], work: Any, job: float, count: int) -> Beside:
    """What `count` chunks take of worker, scheduler and this process, a chunk."""
    from armkin.engines.ordered_chunks import Engine, in_order

    before = [*map(_process_cpu, pids), time.process_time(), time.perf_counter()]
    for _ in in_order(Engine(cluster=address), work, job, [bytes(1 << 20)] * count):
        pass
    after = [*map(_process_cpu, pids), time.process_time(), time.perf_counter()]
    return Beside(*((end - begin) / count for begin, end in zip(before, after, strict=True)))


def _scheduler_address(file: Path) -> str:
    import json

    while not (file.exists() and file.stat().st_size):
        time.sleep(0.05)
    return str(json.loads(file.read_text())["address"])


def _process_cpu(pid: int) -> float:
    """CPU time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


PARTS = {
    "rows": meets_row_bar,
    "unsolvable": meets_unsolvable_bar,
    "workers": meets_worker_bar,
    "memory": meets_memory_bar,
    "cluster": meets_cluster_bar,
}


def results() -> Iterator[bool]:
    """Whether each part that is asked for meets its bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--rows", type=int, default=200_000)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], default=[])
    arguments = parser.parse_args()
    for name in arguments.parts or PARTS:
        with tempfile.TemporaryDirectory() as folder:
            yield PARTS[name](Path(folder), arguments.rows)


if __name__ == "__main__":
    sys.exit(0 if all([*results()]) else 1)
