"""One answer a target: joints held or swept, branches of the whole arm sorted, one chosen, or why none is.

`ik` gives arrays; this gives what a person or a page wants to know of each target, in mm and degrees
(`armkin.model.units`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from armkin.errors import NoBranchError, NoSolutionError, UsageError
from armkin.inverse.branches.names import find
from armkin.inverse.branches.turns import nearest_row
from armkin.inverse.branches.turns import turns as copies_of
from armkin.inverse.closest import Closest
from armkin.inverse.closest import closest as nearest_pose
from armkin.inverse.solutions import Solutions, Status
from armkin.inverse.solve import ik
from armkin.model import limits, units
from armkin.model.lock import lock, unlock

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm

MOST_SWEEPS = 10_000  # combinations of swept values that are tried


@dataclass(frozen=True)
class Request:
    """What to solve for and how to choose."""

    arm: Arm
    task: str | None = None
    near: Sequence[float] | None = None  # [deg | mm], by default home
    branch: str | None = None  # name of the branch wanted
    held: Mapping[str, float] = field(default_factory=dict)  # joint name -> value [deg | mm]
    swept: Mapping[str, Sequence[float]] = field(default_factory=dict)  # joint name -> values to try
    ik: Callable[..., Solutions] = ik  # what solves: called as `armkin.ik` is

    @property
    def near_out(self) -> list[float]:
        """The pose to stay close to [deg | mm]."""
        return units.home_out(self.arm) if self.near is None else list(self.near)


class Branch(NamedTuple):
    """One branch of one target, as joint values of the whole arm."""

    q: Array  # (n,) [rad | mm]
    joints: list[float]  # the same in [deg | mm]
    name: str
    within_limits: bool
    outside: list[int]  # indices of the joints outside their limits
    residual_mm: float
    residual_deg: float
    motion: float  # sum of |change| from near [deg | mm]


@dataclass(frozen=True)
class Answer:
    """All there is to say about one target."""

    status: str
    method: str
    why: str
    complete: bool
    free: list[str]
    branches: list[Branch]  # within limits first, then by motion
    best: int | None
    refused: str | None = None  # why no branch of the name asked for is the best one


def solve(request: Request, targets: Array) -> list[Answer]:
    """Answer targets (N, ...) [mm, rad].

    Raises UsageError if the task does not fit the arm, no branch has the name asked for, or more than
    MOST_SWEEPS combinations are swept.
    """
    combinations = math.prod(len(values) for values in request.swept.values())
    if combinations > MOST_SWEEPS:
        message = f"{combinations} combinations of swept values; at most {MOST_SWEEPS} are tried"
        raise UsageError(message, combinations=combinations, most=MOST_SWEEPS)
    arm = request.arm
    near = units.joints_in(arm, request.near_out)
    parts: list[list[tuple[int, Answer, set[str]]]] = [[] for _ in targets]
    for held in _holds(request):
        one = lock(arm, held) if held else arm
        s = request.ik(one, targets, request.task, near=near[_kept(arm, held)])
        wanted = set(s.names)
        if request.branch is not None:
            wanted = {s.names[i] for i in find(s.names, request.branch)}
        for i, answer in enumerate(_answers(request, held, s, near)):
            parts[i].append((int(s.status[i]), answer, wanted))
    return [_merged(request, found) for found in parts]


def continued(request: Request, answers: Sequence[Answer]) -> Iterator[tuple[Request, Answer]]:
    """Answers of targets along a path, each compared with the one before instead of one pose for all.

    Yields the request that holds for each target (its `near` is the best branch of the target before) and the
    answer with the copies nearest to that, sorted and chosen anew. A target without a best branch is passed over.
    """
    held = [request.arm.joint_names.index(name) for name in (*request.held, *request.swept)]
    for answer in answers:
        near = units.joints_in(request.arm, request.near_out)
        branches = sorted(
            (_nearer(request.arm, branch, near, held) for branch in answer.branches),
            key=lambda branch: (not branch.within_limits, branch.motion),
        )
        names = tuple(dict.fromkeys(branch.name for branch in branches))
        wanted = set(names)
        if request.branch is not None:
            with suppress(UsageError):  # none of that name reaches this target
                wanted = {names[i] for i in find(names, request.branch)}
            wanted = wanted if answer.best is not None else set()
        best = next((i for i, b in enumerate(branches) if b.within_limits and b.name in wanted), None)
        yield request, replace(answer, branches=branches, best=best)
        if best is not None:
            request = replace(request, near=branches[best].joints)


def _nearer(arm: Arm, branch: Branch, near: Array, held: Sequence[int]) -> Branch:
    """The copy of a branch nearest to a pose (n,); held joints stay."""
    rows, _ = nearest_row(arm, branch.q[None], near[None])
    q = rows[0]
    q[held] = branch.q[held]
    motion = float(np.abs(units.joints_out(arm, q - near)).sum())
    return branch._replace(q=q, joints=units.joints_out(arm, q).tolist(), motion=motion)


def closest(request: Request, target: Array) -> Closest:
    """The pose within limits nearest to one target [mm, rad], with swept joints free."""
    arm = request.arm
    near = units.joints_in(arm, request.near_out)
    held = _in(arm, request.held)
    one = lock(arm, held) if held else arm
    nearest = nearest_pose(one, target, request.task, near=near[_kept(arm, held)])
    return replace(nearest, q=unlock(arm, held, nearest.q)) if held else nearest


def turns(request: Request, branch: Branch) -> list[list[float]]:
    """All copies of a branch within limits, whole turns away, the nearest first [deg | mm]; held joints stay."""
    arm = request.arm
    copies = copies_of(arm, branch.q, near=units.joints_in(arm, request.near_out))
    held = [arm.joint_names.index(name) for name in (*request.held, *request.swept)]
    same = np.abs(copies[:, held] - branch.q[held]).max(axis=1, initial=0.0) < 1e-9
    return [list(row) for row in units.joints_out(arm, copies[same]).tolist()]


def refusal(request: Request, answer: Answer, distance: float) -> NoSolutionError:
    """Why an answer has no best branch; distance: how far away the nearest pose within limits is [mm]."""
    arm = request.arm
    away = f"the nearest pose within limits is {distance:.4f} mm away"
    legal = sum(branch.within_limits for branch in answer.branches)
    fields: dict[str, Any] = {
        "robot": arm.name,
        "status": answer.status,
        "distance_mm": distance,
        "branches_within_limits": legal,
    }
    if answer.status == "unreachable":
        return NoSolutionError(f"{arm.name} cannot reach this target; {away}", **fields)
    if answer.refused is not None:
        return NoBranchError(answer.refused if legal else f"{answer.refused}; {away}", **fields)
    return NoBranchError(f"no branch is within limits; {away}", **fields)


def _holds(request: Request) -> Iterator[dict[str, float]]:
    """Every combination of held and swept joints [rad | mm]; one empty one if there are none."""
    for choice in itertools.product(*request.swept.values()):
        yield _in(request.arm, {**request.held, **dict(zip(request.swept, choice, strict=True))})


def _in(arm: Arm, held: Mapping[str, float]) -> dict[str, float]:
    """Joint name -> value, from [deg | mm] to [rad | mm]."""
    values = units.joints_in(arm, [held.get(name, 0.0) for name in arm.joint_names]).tolist()
    return {name: value for name, value in zip(arm.joint_names, values, strict=True) if name in held}


def _kept(arm: Arm, held: Mapping[str, float]) -> list[int]:
    return [i for i, name in enumerate(arm.joint_names) if name not in held]


def _answers(request: Request, held: dict[str, float], s: Solutions, near: Array) -> Iterator[Answer]:
    """The answers of one solver call, for the whole arm."""
    arm = request.arm
    q = unlock(arm, held, s.q) if held else s.q
    outside = limits.outside(arm, q)  # nan is not outside anything
    within = s.within_limits & ~outside.any(axis=-1)
    mm, rad = s.residual()
    columns = (
        units.joints_out(arm, q),
        s.branch,
        within,
        mm,
        units.angles_out(rad),
        units.joints_out(arm, np.abs(q - near)).sum(axis=-1),
    )
    # From here on plain Python: numpy is slow at single numbers, and a batch has many.
    joints, names, legal, miss, turn, motion = (column.tolist() for column in columns)
    kept = [name for name in arm.joint_names if name not in held]
    told = zip(s.valid.tolist(), s.status.tolist(), s.complete.tolist(), strict=True)
    for i, (valid, status, sure) in enumerate(told):
        branches = [
            Branch(
                q[i, b],
                joints[i][b],
                s.names[names[i][b]],
                legal[i][b],
                [] if legal[i][b] else np.flatnonzero(outside[i, b]).tolist(),
                miss[i][b],
                turn[i][b],
                motion[i][b],
            )
            for b in range(len(valid))
            if valid[b]
        ]
        free = [name for name, is_free in zip(kept, s.free[i].tolist(), strict=True) if is_free]
        yield Answer(Status(status).name.lower(), s.method, s.why, sure, free, branches, None)


def _merged(request: Request, found: list[tuple[int, Answer, set[str]]]) -> Answer:
    """One answer of those for all locked values: the best status, all branches, sorted."""
    _, first, _ = min(found, key=lambda item: item[0])
    both = [(branch, branch.name in wanted) for _, answer, wanted in found for branch in answer.branches]
    both.sort(key=lambda item: (not item[0].within_limits, item[0].motion))
    best = next((i for i, (branch, named) in enumerate(both) if branch.within_limits and named), None)
    refused = None
    if request.branch is not None and best is None:
        refused = _refused(request, [branch for branch, named in both if named])
    return Answer(
        first.status,
        first.method,
        first.why,
        first.complete and not request.swept,
        sorted({name for _, answer, _ in found for name in answer.free}),
        [branch for branch, _ in both],
        best,
        refused,
    )


def _refused(request: Request, named: Sequence[Branch]) -> str:
    """What keeps the branches of the name asked for from being taken: all of them are outside limits."""
    if not named:
        return f"no branch called '{request.branch}' reaches this target"
    said: dict[str, str] = {}  # of several poses with one name, as of --sweep, the nearest
    for branch in named:
        joints = ", ".join(request.arm.joint_names[i] for i in branch.outside)
        said.setdefault(branch.name, f"'{branch.name}' is outside limits" + (f": {joints}" if joints else ""))
    return "; ".join(said.values())
