"""`armkin.compile`: the kinematics of an arm by machine code."""

from __future__ import annotations

import threading
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from armkin.compiled.compiled_curves import compiled_curves
from armkin.compiled.compiled_task import CompiledTask
from armkin.engines.threads import check_workers
from armkin.formula.arrays import Array
from armkin.inverse import solve
from armkin.inverse.answers.solutions import Solutions
from armkin.inverse.redundant.families import CurvesOf, families
from armkin.inverse.solvers.choose_redundant_joint import Redundancy, redundancy
from armkin.inverse.tasks.choose_task import default_task

if TYPE_CHECKING:
    from armkin.keep_out.clearance import Clearance
    from armkin.model.arm import Arm


def compile(arm: Arm, task: str | None = None) -> CompiledArm:  # noqa: A001 - `armkin.compile`
    """An arm whose `fk` and `ik` run as machine code, built now by the system's C compiler and kept for later.

    The results are those of `armkin.fk` and `armkin.ik`, to rounding; targets on an edge that C does not tell (singular
    postures, roots in doubt) and classes without a form in C are solved by `armkin.ik` itself.

    Args:
        arm: the arm, as `armkin.load` gives it.
        task: for whose `ik` it is built now, the arm's usual one if None; for another task it is built at its first
            use.

    Returns:
        The compiled arm.

    Raises:
        MissingExtraError: there is no C compiler, or it fails.
        UsageError: the task does not fit the arm.
        FileError: there is no room to build in, or no folder from which programs may run.

    >>> import armkin
    >>> fast = armkin.compile(armkin.load("robots/three_dof.yaml"))
    >>> fast.ik([390, 80, 300]).valid.sum()
    np.int64(4)
    """
    compiled = _compiled_arm(arm)
    library = compiled._library_for(task)
    if not library.branches and (redundant := redundancy(arm, library.name)) is not None:
        compiled._curves_of(library, redundant)
    return compiled


@lru_cache(maxsize=16)
def _compiled_arm(arm: Arm) -> CompiledArm:
    return CompiledArm(arm)


class CompiledArm:
    """An arm's formulas as machine code, as `armkin.compile` gives them; threads may share it.

    Args:
        arm: the arm.
    """

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self._tasks: dict[str | None, CompiledTask] = {}
        self._lock = threading.Lock()

    def __repr__(self) -> str:
        return f"<CompiledArm {self.arm.name}>"

    def fk(self, q: ArrayLike, *, workers: int = 1) -> Array:
        """Pose of the tool, as `armkin.fk`.

        Args:
            q: (..., n) [rad | mm] joint values; leading axes are a batch.
            workers: threads that share a large batch.

        Returns:
            (..., 4, 4) [mm] homogeneous transforms.
        """
        return self._any_library().joint_functions.fk(q, workers)

    def position(self, q: ArrayLike, *, workers: int = 1) -> Array:
        """Position of the tool alone.

        Args:
            q: (..., n) [rad | mm] joint values; leading axes are a batch.
            workers: threads that share a large batch.

        Returns:
            (..., 3) [mm] x, y, z.
        """
        return self._any_library().joint_functions.position(q, workers)

    def clearance(self, q: ArrayLike) -> Clearance:
        """How far the arm is from hitting anything, as `armkin.clearance`.

        Args:
            q: (..., n) [rad | mm] joint values; leading axes are a batch.

        Returns:
            The least distances (...) [mm] and the names of the pairs that have them.
        """
        return self._any_library().joint_functions.clearance(q)

    def ik(
        self,
        targets: ArrayLike,
        task: str | None = None,
        near: ArrayLike | None = None,
        *,
        workers: int = 1,
        rounding: ArrayLike | None = None,
    ) -> Solutions:
        """All branches, as `armkin.ik`.

        Args:
            targets: (..., m) [mm, rad] by the task, or (..., 4, 4) [mm] for task "pose".
            task: what targets prescribe; by default the arm's own task.
            near: (n,) or (..., n) [rad | mm] joint values to stay close to; by default home.
            workers: threads that share a large batch, but for families, which take one.
            rounding: () or (...) [reaches, rad] how far the targets' numbers may be off; by default what the arrays
                show.

        Returns:
            The branches, as `armkin.ik` returns them.
        """
        if workers != 1:
            check_workers(workers)
        library = self._tasks.get(task) or self._library_for(task)
        if library.turned is not self.arm:
            return self._solve_commanded(library, targets, near, workers, rounding)
        if not library.branches:
            return self._solve_without_form(library, targets, near, rounding)
        return library.ik(targets, near, workers, rounding)

    def _solve_without_form(
        self, library: CompiledTask, targets: ArrayLike, near: ArrayLike | None, rounding: ArrayLike | None
    ) -> Solutions:
        """Solutions of `armkin.ik`; for a redundant joint by machine code for its families, or for the other joints."""
        if (redundant := redundancy(self.arm, library.name)) is not None:
            curves_of = self._curves_of(library, redundant)
            others = _solve_others if curves_of is None else solve.ik  # asked for names of branches, and by few targets
            return families(others, self.arm, redundant, targets, near, rounding, curves_of)
        return solve.ik(self.arm, targets, library.name, near=near, rounding=rounding)

    def _curves_of(self, library: CompiledTask, redundant: Redundancy) -> CurvesOf | None:
        """What finds curves of families in machine code, followed or traced; None where numpy does."""
        if library.families is not None:
            return library.families.curves_of
        traced = compiled_curves(self.arm, redundant)
        if traced is None:
            return None
        for held_arm in traced.held_arms:
            compile(held_arm, "pose")
        return traced.of(_held_answers)

    def _solve_commanded(
        self,
        library: CompiledTask,
        targets: ArrayLike,
        near: ArrayLike | None,
        workers: int,
        rounding: ArrayLike | None,
    ) -> Solutions:
        """Solutions for a calibrated arm, computed in actual joint values."""
        inner = compile(library.turned, library.name)
        near_q = solve._actual_near(self.arm, near)
        return solve._as_commanded(
            self.arm, inner.ik(targets, library.name, near_q, workers=workers, rounding=rounding)
        )

    def _any_library(self) -> CompiledTask:
        """Any library, as all contain the chain."""
        return next(iter(self._tasks.values()))

    def _library_for(self, task: str | None) -> CompiledTask:
        """The library for a task, built at its first use."""
        library = self._tasks.get(task)
        if library is None:
            with self._lock:
                library = self._tasks.get(task)
                if library is None:
                    name = task or self.arm.task or default_task(self.arm)
                    candidates = (
                        solver for solver in self._tasks.values() if solver.branches and solver.task.name == name
                    )
                    library = self._tasks[task] = next(candidates, None) or CompiledTask(self.arm, task)
        return library


def _solve_others(arm: Arm, targets: ArrayLike, task: str, *, examine: bool = True, **options: Any) -> Solutions:
    """`armkin.ik` by machine code for an arm with its redundant joint held."""
    return compile(arm, task).ik(targets, task, **options)


def _held_answers(arm: Arm, targets: Array) -> Array:
    """All answers (N, B, n) of targets (N, 4, 4) by machine code for an arm with a joint held, nan for none."""
    elimination = compile(arm, "pose")._library_for("pose").elimination
    return solve.ik(arm, targets, "pose", examine=False).q if elimination is None else elimination.answers(targets)
