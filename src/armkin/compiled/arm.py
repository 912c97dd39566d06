"""`armkin.compile`: the same kinematics from machine code."""

from __future__ import annotations

import ctypes
import math
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin import forward
from armkin.compiled import source, toolchain
from armkin.compiled.single import Single
from armkin.errors import UsageError
from armkin.formula import arrays
from armkin.formula.arrays import Array
from armkin.inverse import solve
from armkin.inverse.branches.names import branch_names
from armkin.inverse.branches.tracking import follow
from armkin.inverse.numeric.tolerances import FAR
from armkin.inverse.recognise import solver
from armkin.inverse.solutions import Solutions
from armkin.inverse.tasks.task import distance, read_targets
from armkin.model.arm import actual

if TYPE_CHECKING:
    from armkin.inverse.closed.geometry import Geometry
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm

SHARE = 8192  # poses that are worth a thread
UNREAD = 2  # state of a target that must be read (made a rotation, refused) first: parts/batch.c


@lru_cache(maxsize=16)
def compile(arm: Arm) -> CompiledArm:
    """An arm whose `fk` and `ik` run as machine code, built now by the system's C compiler and kept for later.

    The results are those of `armkin.fk` and `armkin.ik`, to rounding; targets on an edge (singular postures,
    merging branches) and classes without a form in C are solved by `armkin.ik` itself. Raises MissingExtraError
    without a C compiler.

    >>> import armkin
    >>> fast = armkin.compile(armkin.load("robots/three_dof.yaml"))
    >>> fast.ik([390, 80, 300]).valid.sum()
    np.int64(4)
    """
    return CompiledArm(arm)


class CompiledArm:
    """An arm's formulas as machine code; threads may share it."""

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self._tasks: dict[str | None, _CompiledTask] = {}
        self._lock = threading.Lock()
        self._of(None)

    def __repr__(self) -> str:
        return f"<CompiledArm {self.arm.name}>"

    def fk(self, q: ArrayLike, *, workers: int = 1) -> Array:
        """Pose of the tool, as `armkin.fk`: q (..., n) [rad | mm] -> (..., 4, 4) [mm]."""
        return self._of(None).fk(q, workers)

    def position(self, q: ArrayLike, *, workers: int = 1) -> Array:
        """Position of the tool alone: q (..., n) [rad | mm] -> (..., 3) [mm]."""
        return self._of(None).position(q, workers)

    def ik(
        self, targets: ArrayLike, task: str | None = None, near: ArrayLike | None = None, *, workers: int = 1
    ) -> Solutions:
        """All branches, as `armkin.ik`; workers: threads that share a large batch."""
        return self._of(task).ik(targets, near, workers)

    def _of(self, task: str | None) -> _CompiledTask:
        """The library for a task, built at its first use."""
        found = self._tasks.get(task)
        if found is None:
            with self._lock:
                found = self._tasks.get(task)
                if found is None:
                    found = self._tasks[task] = _CompiledTask(self.arm, task)
        return found


class _CompiledTask:
    """One arm and task: the library, and the way from arrays to it and back."""

    def __init__(self, arm: Arm, task: str | None) -> None:
        self.arm, self.name, self.n = arm, task, arm.n
        self.turned = actual(arm)  # formulas are those of actual joint values
        library = source.library(arm, self.turned, *_class_of(self.turned, task))
        code = toolchain.load(library.text, library.content, library.level)
        pointer, size = ctypes.c_void_p, ctypes.c_int64
        self._poses, self._points = code.arm_poses, code.arm_points
        for function in (self._poses, self._points):
            function.argtypes, function.restype = [size, *[pointer] * 3], size
        self.branches = library.branches
        if not self.branches:
            return
        self.task, self.geometry = solver(self.turned, task)
        self.goal_shape = (4, 4) if self.task.orientation == "full" else (len(self.task.labels),)
        self.names = branch_names(self.turned, self.task, self.geometry, self.branches)
        self._batch = code.arm_batch
        self._batch.argtypes, self._batch.restype = [size, pointer, pointer, size, size, *[pointer] * 6], size
        code.arm_single.argtypes, code.arm_single.restype = [pointer], size
        self._single = self._quick(code.arm_single)

    def fk(self, q: ArrayLike, workers: int) -> Array:
        """Poses (..., 4, 4) of joint values (..., n)."""
        return self._of_joints(self._poses, forward.fk, (4, 4), q, workers)

    def position(self, q: ArrayLike, workers: int) -> Array:
        """Positions (..., 3) of the tool for joint values (..., n)."""
        return self._of_joints(self._points, forward.position, (3,), q, workers)

    def _of_joints(
        self, call: Any, python: Callable[[Arm, Array], Array], shape: tuple[int, ...], q: ArrayLike, workers: int
    ) -> Array:
        """A function of joint values: in C, and in Python for angles that C leaves."""
        values = forward.as_joints(self.arm, q)
        flat = np.ascontiguousarray(values.reshape(-1, self.n))
        out, wild = np.empty((len(flat), *shape)), np.empty(len(flat), np.uint8)

        def part(rows: slice) -> int:
            pointers = (a[rows].ctypes.data for a in (flat, out, wild))
            return int(call(rows.stop - rows.start, *pointers))

        if sum(_shared(part, len(flat), workers)):
            far = np.flatnonzero(wild)
            out[far] = python(self.arm, flat[far])
        return out.reshape(*values.shape[:-1], *shape)

    def ik(self, targets: ArrayLike, near: ArrayLike | None, workers: int) -> Solutions:
        """All branches of targets in the task's shape."""
        if not self.branches:
            return solve.ik(self.arm, targets, self.name, near=near)
        if self._single is not None and type(targets) is np.ndarray and targets.shape == self.goal_shape:
            found = self._alone(targets, near)
            if found is not None:
                return found
        if self.turned is not self.arm:
            return self._commanded(targets, near, workers)
        given = arrays.real(targets, "targets")
        m = len(self.goal_shape)
        if given.shape[-m:] != self.goal_shape or given.ndim < m:
            return solve.ik(self.arm, targets, self.name, near=near)  # says what is wrong
        lead = given.shape[: given.ndim - m]
        close = self.arm.home if near is None else arrays.real(near, "near")
        if close.shape not in ((self.n,), (*lead, self.n)) or not np.isfinite(close).all():
            return solve.ik(self.arm, targets, self.name, near=near)
        target = np.ascontiguousarray(given.reshape(-1, *self.goal_shape))
        out = _Out(len(target), self.branches, self.n)
        each, rounding = np.ascontiguousarray(close), np.zeros(len(target))
        left = self._run(target, each, out, workers, read=False)
        if left and (out.state == UNREAD).any():
            read = read_targets(self.task, target)  # refuses what is no target
            target, rounding = np.ascontiguousarray(read.values), read.rounding
            left = self._run(target, each, out, workers, read=True)
        q, complete = out.q, np.full(len(target), self.geometry.complete)
        if left:
            q = self._in_python(target, close.reshape(-1, self.n), out, complete)
        if self.arm.prismatic.any():
            complete[distance(self.arm, self.task, target) > FAR] = False
        if self.geometry.pairs is None:  # as many columns as the target with most branches has
            q = out.narrow()
        if not self.geometry.ordered:
            out.branch[...] = follow(self.arm, self.task, q, target)
        B = q.shape[1]
        return Solutions(
            arm=self.arm,
            task=self.task,
            target=target.reshape(given.shape),
            near=close if close.shape == (*lead, self.n) else np.broadcast_to(close, (*lead, self.n)),
            q=q.reshape(*lead, B, self.n),
            valid=out.valid.reshape(*lead, B),
            within_limits=out.within.reshape(*lead, B),
            branch=out.branch.reshape(*lead, B),
            status=out.status.reshape(lead),
            free=out.free.reshape(*lead, self.n),
            names=self._names(B),
            method=self.geometry.name,
            why=self.geometry.why,
            complete=complete.reshape(lead),
            rounding=rounding.reshape(lead),
        )

    def _quick(self, call: Any) -> Single | None:
        """The short way of one target, for arms whose branches and joint values need no more than C gives."""
        if self.turned is not self.arm:
            return None
        names = None if self.geometry.pairs is not None else self._names
        same = {"arm": self.arm, "task": self.task, "names": self.names, "rounding": np.zeros(())}
        same |= {"method": self.geometry.name, "why": self.geometry.why}
        complete = self.geometry.complete
        return Single(call, self.goal_shape, self.arm.home, self.branches, complete, same, names)

    def _names(self, count: int) -> tuple[str, ...]:
        if self.geometry.pairs is None:
            return branch_names(self.turned, self.task, self.geometry, count)
        return self.names + tuple(f"branch {i + 1}" for i in range(self.branches, count))

    def _alone(self, target: Array, near: ArrayLike | None) -> Solutions | None:
        """One target the short way; None if there is more to it."""
        assert self._single is not None
        close = near if near is None else np.asarray(near)
        if target.dtype != np.float64 or (
            close is not None and (close.shape != (self.n,) or close.dtype.kind not in "if")
        ):
            return None
        return self._single.solve(target, close if close is None else close.astype(np.float64))

    def _run(self, target: Array, near: Array, out: _Out, workers: int, *, read: bool) -> int:
        """Solve what can be solved in C; how many targets are left."""
        step = self.n if near.size != self.n or len(target) == 1 else 0

        def part(rows: slice) -> int:
            close = near.reshape(-1, self.n)[rows] if step else near
            arrays_ = (out.q, out.valid, out.within, out.branch, out.status, out.state)
            pointers = (a[rows].ctypes.data for a in arrays_)
            count = rows.stop - rows.start
            return int(self._batch(count, target[rows].ctypes.data, close.ctypes.data, step, read, *pointers))

        return sum(_shared(part, len(target), workers))

    def _in_python(self, target: Array, near: Array, out: _Out, complete: NDArray[np.bool_]) -> Array:
        """The targets that C has left open, by `armkin.ik`; all joint values (N, B, n)."""
        rows = np.flatnonzero(out.state)
        some = solve.ik(self.arm, target[rows], self.name, near=near[rows] if len(near) > 1 else near[0])
        out.widen(some.q.shape[1])
        B = some.q.shape[1]
        out.q[rows, :B], out.q[rows, B:] = some.q, math.nan
        for mine, theirs, none in (
            (out.valid, some.valid, False),
            (out.within, some.within_limits, False),
            (out.branch, some.branch, -1),
        ):
            mine[rows, :B], mine[rows, B:] = theirs, none
        out.status[rows], out.free[rows], complete[rows] = some.status, some.free, some.complete
        return out.q

    def _commanded(self, targets: ArrayLike, near: ArrayLike | None, workers: int) -> Solutions:
        """A calibrated arm, by way of its actual joint values."""
        inner = compile(self.turned)
        close = solve._actual_near(self.arm, near)
        return solve._commanded(self.arm, inner.ik(targets, self.name, close, workers=workers))


def _class_of(arm: Arm, name: str | None) -> tuple[Task | None, Geometry | None]:
    """The task and the solver of an arm; none of both for one whose usual task does not fit it: it still has poses."""
    try:
        return solver(arm, name)
    except UsageError:
        if name is not None:
            raise
        return None, None


class _Out:
    """Results of a batch of N targets, in the layout of `Solutions`."""

    def __init__(self, N: int, B: int, n: int) -> None:
        self.q = np.empty((N, B, n))
        self.valid, self.within = np.empty((N, B), bool), np.empty((N, B), bool)
        self.branch = np.empty((N, B), np.int8)
        self.status, self.state = np.zeros(N, np.int8), np.empty(N, np.uint8)
        self.free = np.zeros((N, n), bool)

    def widen(self, B: int) -> None:
        """Make room for B branches a target."""
        more = B - self.q.shape[1]
        if more > 0:
            self.q = np.pad(self.q, ((0, 0), (0, more), (0, 0)), constant_values=math.nan)
            self.valid, self.within = (np.pad(a, ((0, 0), (0, more))) for a in (self.valid, self.within))
            self.branch = np.pad(self.branch, ((0, 0), (0, more)), constant_values=-1)

    def narrow(self) -> Array:
        """Leave columns away that no target needs; the joint values."""
        B = int(self.valid.sum(axis=1).max(initial=0))
        self.q, self.valid, self.within, self.branch = (
            np.ascontiguousarray(a[:, :B]) for a in (self.q, self.valid, self.within, self.branch)
        )
        return self.q


def _shared(part: Callable[[slice], int], count: int, workers: int) -> list[int]:
    """``part(rows)`` for all rows, by that many threads: C code runs without Python's lock."""
    if workers < 1:
        raise UsageError(f"workers: {workers}; at least 1 thread is needed")
    share = max(SHARE, -(-count // (4 * workers)))  # four each: one that is slow does not keep the others waiting
    rows = [slice(start, min(start + share, count)) for start in range(0, count, share)]
    if workers == 1 or len(rows) < 2:
        return [part(slice(0, count))]
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(part, rows))
