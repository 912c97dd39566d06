"""What `armkin export --c` writes, built as a library and asked many poses: does it say what Python says?"""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import armkin
from armkin.export.c.c_program import identifier, program
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.task import targets_of


@dataclass(frozen=True)
class Agreement:
    """Of so many poses, how many the C calls an edge, and how many others differ, by what: a list of words."""

    poses: int
    edges: int
    different: list[str]
    largest: float  # difference of a joint value, and of an fk entry in reaches
    largest_fk: float


# what is written of an arm and compiled of that is the same for all tests of a process
texts_of = cache(program)
_libraries: dict[tuple[str, ...], ctypes.CDLL] = {}


def build_library(arm: armkin.Arm, folder: Path, level: str = "-O0", *, single: bool = False) -> ctypes.CDLL:
    """The generated source as a shared library; some dozen targets take less time than optimising does."""
    texts = texts_of(arm, "arm.c", None, single)
    key = texts.source, texts.header, level
    if key not in _libraries:
        (folder / "arm.c").write_text(texts.source)
        (folder / "arm.h").write_text(texts.header)
        words = ["gcc", "-std=c99", level, "-shared", "-fPIC", "arm.c", "-o", "arm.so", "-lm"]
        subprocess.run(words, cwd=folder, check=True)
        _libraries[key] = ctypes.CDLL(str(folder / "arm.so"))
    return _libraries[key]


class Exported:
    """The functions of an exported arm, for one target at a time."""

    def __init__(self, arm: armkin.Arm, folder: Path, single: bool = False) -> None:
        self.arm, self.real = arm, np.dtype(np.float32 if single else np.float64)
        code, prefix = build_library(arm, folder, single=single), identifier(arm.name)
        number = ctypes.c_float if single else ctypes.c_double

        class Solution(ctypes.Structure):
            _fields_ = (("q", number * arm.n), ("branch", ctypes.c_int), ("within", ctypes.c_int), ("residual", number))

        self._found, self._edge = (Solution * 64)(), ctypes.c_int()
        self._ik, self._best, self._fk = (code[f"{prefix}_{name}"] for name in ("ik", "best", "fk"))

    def fk(self, q: np.ndarray) -> np.ndarray:
        """The tool's pose (4, 4), in the export's own precision."""
        T, values = np.empty((4, 4), self.real), np.ascontiguousarray(q, self.real)
        self._fk(ctypes.c_void_p(values.ctypes.data), ctypes.c_void_p(T.ctypes.data))
        return T.astype(float)

    def ik(self, target: np.ndarray, near: np.ndarray) -> tuple[int, bool, np.ndarray, int]:
        """How many branches, or -1; whether the target is at an edge; their joint values (count, n); the best one."""
        goal, close = (np.ascontiguousarray(values, self.real) for values in (target, near))
        pointers = [ctypes.c_void_p(values.ctypes.data) for values in (goal, close)]
        count = self._ik(*pointers, self._found, ctypes.byref(self._edge))
        q = np.array([self._found[b].q[:] for b in range(max(count, 0))], self.real).reshape(-1, self.arm.n)
        best = self._best(self._found, count, pointers[1])
        return count, bool(self._edge.value), q, best


def random_postures(arm: armkin.Arm, count: int) -> np.ndarray:
    """Random joint values: anywhere, a quarter of them within limits."""
    rng = np.random.default_rng(3)
    turn = np.where(arm.prismatic, arm.reach / 4, np.pi)
    low = np.where(np.isfinite(arm.lower), np.maximum(arm.lower, -turn), -turn)
    high = np.where(np.isfinite(arm.upper), np.minimum(arm.upper, turn), turn)
    return np.concatenate(
        [rng.uniform(-turn, turn, (count - count // 4, arm.n)), rng.uniform(low, high, (count // 4, arm.n))]
    )


def compare_answers(arm: armkin.Arm, folder: Path, count: int) -> Agreement:
    """Compare on random poses."""
    code, n, prefix = build_library(arm, folder, "-O1"), arm.n, identifier(arm.name)
    task, _ = solver(arm, None)
    q = random_postures(arm, count)
    T = armkin.fk(arm, q)
    target = targets_of(task, T, q)
    solutions = armkin.ik(arm, target)
    doubles = ctypes.c_double * n

    class Solution(ctypes.Structure):
        _fields_ = (("q", doubles), ("branch", ctypes.c_int), ("within", ctypes.c_int), ("residual", ctypes.c_double))

    answers, edge, near = (Solution * 64)(), ctypes.c_int(), doubles(*arm.home)
    ik, fk = code[f"{prefix}_ik"], code[f"{prefix}_fk"]
    pose, edges, different, largest, largest_fk = np.empty(16), 0, [], 0.0, 0.0
    rows = np.ascontiguousarray(target.reshape(count, -1))
    fk.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
    ik.argtypes = [ctypes.c_void_p, doubles, Solution * 64, ctypes.POINTER(ctypes.c_int)]
    valid, mine, legal, status = solutions.valid, solutions.q, solutions.within_limits, solutions.status
    q = np.ascontiguousarray(q)
    unit = np.where(arm.prismatic, arm.reach, 1.0)
    for k in range(count):
        fk(q[k].ctypes.data, pose.ctypes.data)
        largest_fk = max(largest_fk, float(np.abs(pose.reshape(4, 4) - T[k]).max()) / arm.reach)
        total = ik(rows[k].ctypes.data, near, answers, edge)
        if edge.value or status[k]:
            edges += 1
            continue
        theirs = np.array([answers[b].q[:] for b in range(total)]).reshape(total, n)
        inside = np.array([bool(answers[b].within) for b in range(total)])
        python, inside_own = mine[k][valid[k]], legal[k][valid[k]]
        if len(python) != total:
            different.append(f"pose {k}: {total} branches, Python {len(python)}")
            continue
        order = [np.abs((theirs - row) / unit).max(axis=1).argmin() for row in python]
        apart = float(np.abs((theirs[order] - python) / unit).max(initial=0.0))
        if sorted(order) != list(range(total)) or apart > 1e-6:
            different.append(f"pose {k}: joint values {apart:.1e} apart")
        elif (inside[order] != inside_own).any():
            different.append(f"pose {k}: limits")
        largest = max(largest, apart)
    return Agreement(count, edges, different, largest, largest_fk)
