"""The library of one arm and task, and its calls with arrays."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.compiled import c_source, families_source, toolchain
from armkin.compiled.batch_results import Results
from armkin.compiled.elimination_rows import CompiledElimination
from armkin.compiled.followed_families import FollowedFamilies
from armkin.compiled.joint_functions import THREAD_POSES, JointFunctions
from armkin.compiled.one_target import Single
from armkin.engines.threads import share_rows
from armkin.errors import UsageError
from armkin.export import class_forms
from armkin.formula import arrays
from armkin.formula.arrays import Array
from armkin.inverse import solve
from armkin.inverse.answers import rounding as target_rounding
from armkin.inverse.answers.solutions import Solutions
from armkin.inverse.branches.names import branch_names
from armkin.inverse.branches.tracking import follow_branches
from armkin.inverse.numeric.tolerances import FAR_DISTANCE, SOLUTION
from armkin.inverse.singular import near_itself
from armkin.inverse.solvers.choose_redundant_joint import redundancy
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.task import distance, read_targets
from armkin.model.arm import actual_arm

if TYPE_CHECKING:
    from armkin.inverse.closed.geometry import Geometry
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm

BLOCK_POSES = 16384  # poses of an elimination that are solved together before empty columns are dropped
UNREAD = 2  # state in parts/batch.c of a target that Python must first read, that is normalise or refuse


class CompiledTask:
    """The library of one arm and task, and its calls with arrays."""

    def __init__(self, arm: Arm, task: str | None) -> None:
        self.arm, self.name, self.n = arm, task, arm.n
        self.turned = actual_arm(arm)  # formulas use actual joint values
        solved_task, form = _class_of(self.turned, task)
        if solved_task is not None and form is not None:  # an elimination named after a class is that elimination in C
            form = class_forms.plain_form(self.turned, solved_task, form) if form.places is not None else form
        followed = families_source.followed_redundancy(arm, task)
        library = c_source.library(arm, self.turned, solved_task, form, followed)
        code = toolchain.load_library(library.text, library.content, library.level)
        pointer, size = ctypes.c_void_p, ctypes.c_int64
        self.joint_functions = JointFunctions(arm, code)
        self.branches = library.branches
        self.families = FollowedFamilies(code) if followed is not None else None
        self.elimination: CompiledElimination | None = None
        if not self.branches:
            return
        self.task, self.geometry = solver(self.turned, task)
        self.goal_shape = (4, 4) if self.task.orientation == "full" else (len(self.task.labels),)
        self.names = branch_names(self.turned, self.task, self.geometry, self.branches)
        self._batch = code.arm_batch
        self._batch.argtypes, self._batch.restype = [size, pointer, pointer, size, size, *[pointer] * 7], size
        code.arm_single.argtypes, code.arm_single.restype = [pointer], size
        self._single = self._single_solver(code.arm_single)
        if form is not None and c_source.has_rows(self.task, form):
            code.arm_rows.argtypes, code.arm_rows.restype = [size, *[pointer] * 3], None
            self.elimination = CompiledElimination(self.geometry, form, code.arm_rows, self.branches, self.n)

    def ik(
        self, targets: ArrayLike, near: ArrayLike | None, workers: int, stated: ArrayLike | None = None
    ) -> Solutions:
        """All branches of targets in the task's shape; stated: rounding of the targets as stated by the caller."""
        is_single = self._single is not None and stated is None
        if (
            is_single
            and type(targets) is np.ndarray
            and targets.shape == self.goal_shape
            and (solutions := self._solve_alone(targets, near)) is not None
        ):
            return solutions
        return self._solve_batch(targets, near, workers, stated)

    def _solve_batch(
        self, targets: ArrayLike, near: ArrayLike | None, workers: int, stated: ArrayLike | None
    ) -> Solutions:
        """Solutions of `ik` for an arm with ratios of 1."""
        array = arrays.real_array(targets, "targets")
        target_axes = len(self.goal_shape)
        if array.shape[-target_axes:] != self.goal_shape or array.ndim < target_axes:
            # raises the error about the shape
            return solve.ik(self.arm, targets, self.name, near=near, rounding=stated)
        lead = array.shape[: array.ndim - target_axes]
        near_array = self.arm.home if near is None else arrays.real_array(near, "near")
        if near_array.shape not in ((self.n,), (*lead, self.n)) or not np.isfinite(near_array).all():
            return solve.ik(self.arm, targets, self.name, near=near, rounding=stated)
        target = np.ascontiguousarray(array.reshape(-1, *self.goal_shape))
        near_rows, rounding = np.ascontiguousarray(near_array), np.zeros(len(target))
        solve_all = self._solve_rows if self.geometry.pairs is not None else self._solve_blocks
        batch = solve_all(target, near_rows, workers, read=False)
        if batch is None:
            values, _, rounding = read_targets(self.task, target)  # raises UsageError for invalid targets
            target = np.ascontiguousarray(values)
            batch = solve_all(target, near_rows, workers, read=True)
            assert batch is not None
        single = arrays.is_single(targets)
        printed = array.reshape(target.shape), rounding
        rounding, tolerance = target_rounding.of_targets(self.arm, self.task, target, printed, single, stated, lead)
        rows = near_itself.solved_by_near(self.arm, self.task, target, near_rows, tolerance)
        if len(rows):
            self._solve_by_python(batch, rows, target, near_rows.reshape(-1, self.n), tolerance - SOLUTION)
        self._finish(batch, target)
        target = target.copy() if np.may_share_memory(target, array) else target  # the caller may change its arrays
        near_array = near_array.copy()
        q = batch.q
        B = q.shape[1]
        return Solutions(
            arm=self.arm,
            task=self.task,
            target=target.reshape(array.shape),
            near=near_array if near_array.shape == (*lead, self.n) else np.broadcast_to(near_array, (*lead, self.n)),
            q=q.reshape(*lead, B, self.n),
            valid=batch.valid.reshape(*lead, B),
            within_limits=batch.within.reshape(*lead, B),
            branch=batch.branch.reshape(*lead, B),
            status=batch.status.reshape(lead),
            free=batch.free.reshape(*lead, self.n),
            names=self._branch_names(B),
            method=self.geometry.name,
            why=self.geometry.why,
            complete=batch.complete.reshape(lead),
            rounding=rounding.reshape(lead),
        )

    def _finish(self, batch: Results, target: Array) -> None:
        """Mark far targets as incomplete, and number branches of classes without an order."""
        if self.arm.prismatic.any():
            batch.complete[distance(self.arm, self.task, target) > FAR_DISTANCE] = False
        if not self.geometry.ordered:
            batch.branch[...] = follow_branches(self.arm, self.task, batch.q, target)

    def _single_solver(self, call: Any) -> Single | None:
        """The fast solver of one target, for arms whose results C gives completely; else None."""
        if self.turned is not self.arm or self.geometry.places is not None:
            return None
        names = None if self.geometry.pairs is not None else self._branch_names
        shared_fields = {"arm": self.arm, "task": self.task, "names": self.names, "complete": self.geometry.complete}
        shared_fields |= {"method": self.geometry.name, "why": self.geometry.why}
        return Single(call, self.goal_shape, self.arm.home, self.branches, shared_fields, names)

    def _branch_names(self, count: int) -> tuple[str, ...]:
        if self.geometry.pairs is None:
            return branch_names(self.turned, self.task, self.geometry, count)
        return self.names + tuple(f"branch {i + 1}" for i in range(self.branches, count))

    def _solve_alone(self, target: Array, near: ArrayLike | None) -> Solutions | None:
        """Solutions of one target by the fast solver; None if it cannot solve the target."""
        assert self._single is not None
        if target.dtype != np.float64:
            return None
        if near is None:
            return self._single.solve(target, None)
        near_array = np.asarray(near)
        if near_array.shape != (self.n,) or near_array.dtype.kind not in "if":
            return None
        return self._single.solve(target, near_array.astype(np.float64))

    def _solve_rows(self, target: Array, near: Array, workers: int, *, read: bool) -> Results | None:
        """All branches of targets (N, ...); None if Python must first read some. near: (n,) or (N, n)."""
        batch = Results(len(target), self.branches, self.n)
        step = self.n if near.size != self.n or len(target) == 1 else 0
        near_rows = near.reshape(-1, self.n)

        def solve_part(rows: slice) -> int:
            outputs = (batch.q, batch.valid, batch.within, batch.branch, batch.status, batch.free, batch.state)
            pointers = (a[rows].ctypes.data for a in outputs)
            near_part = near_rows[rows] if step else near_rows
            count = rows.stop - rows.start
            return int(self._batch(count, target[rows].ctypes.data, near_part.ctypes.data, step, read, *pointers))

        thread_rows = THREAD_POSES if self.geometry.pairs is not None else THREAD_POSES // 64
        open_count = sum(share_rows(solve_part, len(target), workers, thread_rows))
        if open_count and not read and (batch.state == UNREAD).any():
            return None
        batch.complete[...] = self.geometry.complete
        if self.geometry.places is not None:
            self._place_branches(batch, target)
        if open_count:
            # after reading, each state is 0 or 1, and flags are faster than numbers
            rows = np.flatnonzero(batch.state.view(np.bool_))
            self._solve_by_python(batch, rows, target, near_rows)
        return batch

    def _solve_by_python(
        self, batch: Results, rows: NDArray[np.intp], target: Array, near: Array, rounding: Array | None = None
    ) -> None:
        """Solve some targets in Python and write their results; near: (1, n) or (N, n)."""
        elimination = self.elimination
        in_c = np.zeros(len(rows), bool) if elimination is None else elimination.is_complete(target[rows])
        for part, geometry in ((rows[in_c], elimination and elimination.geometry), (rows[~in_c], self.geometry)):
            if len(part) and geometry:
                near_q, of_rows = near[part] if len(near) > 1 else near[0], None if rounding is None else rounding[part]
                batch.write(part, solve.solve_by(self.arm, self.task, geometry, target[part], near_q, rounding=of_rows))

    def _place_branches(self, batch: Results, target: Array) -> None:
        """Sort and number branches from C as the class that names them does."""
        assert self.geometry.places is not None
        solved_rows = np.flatnonzero(batch.state == 0)
        width = int(batch.valid[solved_rows].sum(axis=1).max(initial=0))  # branches are in the first columns
        q, valid = batch.q[solved_rows, :width], batch.valid[solved_rows, :width]
        within_limits = batch.within[solved_rows, :width]
        branch = self.geometry.places(q, target[solved_rows])
        order = np.argsort(np.where(valid, branch, np.iinfo(np.int8).max), axis=1, kind="stable")
        batch.q[solved_rows, :width] = np.take_along_axis(q, order[:, :, None], axis=1)
        for values, found_values in ((batch.within, within_limits), (batch.branch, branch)):
            values[solved_rows, :width] = np.take_along_axis(found_values, order, axis=1)

    def _solve_blocks(self, target: Array, near: Array, workers: int, *, read: bool) -> Results | None:
        """Results of `_solve_rows` for an elimination, in blocks without unused columns."""
        batch = Results(len(target), 0, self.n)
        for start in range(0, max(len(target), 1), BLOCK_POSES):
            rows = slice(start, min(start + BLOCK_POSES, len(target)))
            near_part = near if near.size == self.n else near.reshape(-1, self.n)[rows]
            block = self._solve_rows(target[rows], near_part, workers, read=read)
            if block is None:
                return None
            block.narrow()
            batch.write(rows, block)
        if self.geometry.places is not None:
            batch.widen(max(self.geometry.branches or 0, int(batch.branch.max(initial=-1)) + 1))
        return batch


def _class_of(arm: Arm, name: str | None) -> tuple[Task | None, Geometry | None]:
    """The task and the solver of an arm; None for an arm with a redundant joint, or whose usual task does not fit it,
    as the arm then still has poses."""
    if redundancy(arm, name) is not None:
        return None, None
    try:
        return solver(arm, name)
    except UsageError:
        if name is not None:
            raise
        return None, None
