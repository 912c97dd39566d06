"""One answer for each target: the sorted branches of the whole arm, and the best one or the reason for none.

It also handles joints that are held or swept. These answers are for users and pages, in mm and degrees.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from armkin.errors import NoBranchError, NoSolutionError, UsageError
from armkin.formula.arrays import Array
from armkin.forward import fk
from armkin.inverse.answers.closest import Closest, closest_each
from armkin.inverse.answers.solutions import Solutions, Status
from armkin.inverse.branches import whole_turns
from armkin.inverse.branches.names import find_branches
from armkin.inverse.branches.whole_turns import nearest_row
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.families import intervals_out
from armkin.inverse.redundant.position_first import closest_positions
from armkin.inverse.solve import ik
from armkin.inverse.solvers.choose_redundant_joint import arm_without, redundant_alone, without_held
from armkin.keep_out.clearance import Hit, hits, hits_text
from armkin.model import limits, units
from armkin.model.arm import Arm
from armkin.model.lock_joints import unlock

MAX_SWEEPS = 10_000  # most combinations of swept values
_RANKS = Status.EXACT, Status.BOUNDARY, Status.SINGULAR, Status.POSITION, Status.UNREACHABLE  # best first
_THIN = 20  # with more branches of a target, those that no answer shows are dropped
_MAX_ANSWERS = 16_384  # most answers of 6.5 kB in memory, one for each target and swept value


@dataclass(frozen=True)
class Request:
    """What to solve for and how to choose."""

    arm: Arm
    task: str | None = None
    near: Sequence[float] | None = None  # [deg | mm], by default home
    branch: str | None = None  # name of the branch wanted
    held: Mapping[str, float] = field(default_factory=dict)  # joint name -> value [deg | mm]
    swept: Mapping[str, Sequence[float]] = field(default_factory=dict)  # joint name -> values to try
    ignore: bool = False  # whether a branch with hits is accepted if none is free
    position_first: bool = False  # exact position and nearest rotation
    every: bool = True  # keep all branches; False: only those that an answer shows
    ik: Callable[..., Solutions] = ik  # solver, called like `armkin.ik`
    fk: Callable[[Arm, Array], Array] = fk  # forward kinematics, called like `armkin.fk`

    @property
    def near_out(self) -> list[float]:
        """The pose to stay close to [deg | mm]."""
        return units.home_out(self.arm) if self.near is None else list(self.near)


class TargetBranch(NamedTuple):
    """One branch of one target, as joint values of the whole arm."""

    q: Array  # (n,) [rad | mm]
    joints: list[float]  # values in [deg | mm]
    name: str
    within_limits: bool
    outside: list[int]  # indices of the joints outside their limits
    residual_mm: float
    residual_deg: float
    motion: float  # sum of |change| from near [deg | mm]
    clearance: float | None = None  # [mm] where there are keep-outs that count
    hits: Sequence[Hit] = ()
    interval: tuple[float, float] | None = None  # range of the redundant joint [deg | mm], where there is one

    @property
    def may_be_taken(self) -> bool:
        """Whether it is within limits and hits nothing."""
        return self.within_limits and not self.hits


class Answer(NamedTuple):
    """The answer for one target."""

    status: str
    method: str
    why: str
    complete: bool
    free: list[str]
    branches: list[TargetBranch]  # those within limits first, of these the free ones, then by motion
    best: int | None
    refused: str | None = None  # why no branch of the requested name is the best one
    total: int = 0  # number of branches found, which may exceed `branches`
    within_limits: int = 0  # number of branches within limits
    names: tuple[str, ...] = ()  # names of all branches that the arm may have


def solve(request: Request, targets: Array, rounding: Array | None = None) -> list[Answer]:
    """Answer targets (N, ...) [mm, rad]; with swept joints and `every` no more than `most_targets`.

    rounding: (N,) of the targets, see `armkin.ik`.

    Raises UsageError if the task does not fit the arm, no branch has that name, or more than MAX_SWEEPS are swept.
    """
    if (count := combinations(request)) > MAX_SWEEPS:
        message = f"{count} combinations of swept values; at most {MAX_SWEEPS} are tried"
        raise UsageError(message, combinations=count, most=MAX_SWEEPS)
    arm = request.arm
    near = units.joints_in(arm, request.near_out)
    collected = [_SweptTarget() for _ in targets]
    options: dict[str, Any] = {"position_first": True} if request.position_first else {"rounding": rounding}
    for swept in itertools.product(*request.swept.values()):
        held = _held_values(arm, {**request.held, **dict(zip(request.swept, swept, strict=True))})
        one, goals = without_held(arm, request.task, held, targets)
        s = request.ik(one, goals, request.task, near=near[_kept_joints(arm, held)], **options)
        wanted_names = set(s.names)
        if request.branch is not None:
            wanted_names = {s.names[i] for i in find_branches(s.names, request.branch)}
        for i, answer in enumerate(_answers_of_call(request, held, s, near)):
            collected[i].add(int(s.status[i]), answer, wanted_names)
            if not request.every and len(collected[i].branches) > _THIN:
                collected[i].thin_out(request)
    return [one.answer(request) for one in collected]


def combinations(request: Request) -> int:
    """The number of combinations of swept values for each target."""
    return math.prod(len(values) for values in request.swept.values())


def most_targets(request: Request) -> int:
    """How many targets to solve at once, so that the branches of all swept values stay within 100 MB."""
    return max(_MAX_ANSWERS // combinations(request), 1) if request.every else _MAX_ANSWERS


def locked_arm(request: Request) -> Arm:
    """The arm that is solved, with the joints that are neither held nor swept."""
    held = {**request.held, **{name: values[0] for name, values in request.swept.items()}}
    return arm_without(request.arm, tuple(_held_values(request.arm, held).items()))


def prepared_arm(request: Request) -> Arm:
    """The arm of `locked_arm`, or the arm that serves all values of a redundant joint, for transformed targets."""
    free = redundant_alone(request.arm, request.task, request.held)
    return locked_arm(request) if free is None else free.rest


def follow_targets(request: Request, answers: Sequence[Answer]) -> Iterator[tuple[Request, Answer]]:
    """Answers of targets along a path, each relative to the previous target's best branch instead of one pose.

    Yields the request of each target, whose `near` is the last best branch, and the answer with the copies nearest to
    it, sorted and chosen again. A target without a best branch does not change `near`.
    """
    held = [request.arm.joint_names.index(name) for name in (*request.held, *request.swept)]
    for answer in answers:
        near = units.joints_in(request.arm, request.near_out)
        copies = (_nearest_copy(request.arm, branch, near, held) for branch in answer.branches)
        branches = sorted(copies, key=partial(_rank, request))
        names = tuple(dict.fromkeys(branch.name for branch in branches))
        wanted_names = set(names)
        if request.branch is not None:
            with suppress(UsageError):  # no branch of that name reaches this target
                wanted_names = {names[i] for i in find_branches(names, request.branch)}
            wanted_names = wanted_names if answer.best is not None else set()
        best = _best_branch(request, [(branch, branch.name in wanted_names) for branch in branches])
        yield request, answer._replace(branches=branches, best=best)
        if best is not None:
            request = replace(request, near=branches[best].joints)


def _nearest_copy(arm: Arm, branch: TargetBranch, near: Array, held: Sequence[int]) -> TargetBranch:
    """The copy of a branch nearest to a pose (n,); held joints keep their values."""
    rows, _ = nearest_row(arm, branch.q[None], near[None])
    q = rows[0]
    q[held] = branch.q[held]
    motion = float(np.abs(units.joints_out(arm, q - near)).sum())
    return branch._replace(q=q, joints=units.joints_out(arm, q).tolist(), motion=motion)


def closest(request: Request, targets: Array) -> list[Closest]:
    """The poses within limits nearest to targets (N, ...) [mm, rad], with swept joints free."""
    arm = request.arm
    near = units.joints_in(arm, request.near_out)
    held = _held_values(arm, request.held)
    free_arm = arm_without(arm, tuple(held.items()))
    if request.position_first:
        nearest_each = closest_positions(free_arm, targets, near[_kept_joints(arm, held)])
    else:
        nearest_each = closest_each(free_arm, targets, request.task, near=near[_kept_joints(arm, held)])
    return [replace(nearest, q=unlock(arm, held, nearest.q)) for nearest in nearest_each] if held else nearest_each


def turns(request: Request, branch: TargetBranch) -> list[list[float]]:
    """All copies of a branch within limits, whole turns away, the nearest first [deg | mm]; held joints stay."""
    arm = request.arm
    copies = whole_turns.turns(arm, branch.q, near=units.joints_in(arm, request.near_out))
    held = [arm.joint_names.index(name) for name in (*request.held, *request.swept)]
    keeps_held = np.abs(copies[:, held] - branch.q[held]).max(axis=1, initial=0.0) < tol.HELD_DIFFERENCE
    return [list(row) for row in units.joints_out(arm, copies[keeps_held]).tolist()]


def refusal_error(request: Request, answer: Answer, distance: float) -> NoSolutionError:
    """The error of an answer without a best branch; distance: [mm] of the nearest pose within limits."""
    arm = request.arm
    free_text = f"with {', '.join(request.swept)} free " if request.swept else ""
    nearest_text = f"{free_text}the nearest pose within limits is {distance:.4f} mm away"
    legal = answer.within_limits
    fields: dict[str, Any] = {"robot": arm.name, "status": answer.status}
    fields |= {"distance_mm": distance, "branches_within_limits": legal}
    if answer.status == "unreachable":
        return NoSolutionError(f"{arm.name} cannot reach this target; {nearest_text}", **fields)
    if answer.refused is not None:
        return NoBranchError(answer.refused if legal else f"{answer.refused}; {nearest_text}", **fields)
    if legal:
        return blocked_error(request, answer)
    return NoBranchError(f"no branch is within limits; {nearest_text}", **fields)


def blocked_error(request: Request, answer: Answer) -> NoBranchError:
    """The error of a target whose branches within limits all hit something."""
    words = {f"{b.name or 'it'} {hits_text(list(b.hits))}": b.hits for b in answer.branches if b.within_limits}
    return NoBranchError(
        f"every branch within limits hits something: {'; '.join(words)}",
        robot=request.arm.name,
        status=answer.status,
        branches_within_limits=answer.within_limits,
        hits=[hit for branch_hits in words.values() for hit in branch_hits],
    )


def _best_branch(request: Request, branches: Sequence[tuple[TargetBranch, bool]]) -> int | None:
    """Index of the first wanted branch (by its flag) within limits and free of hits, unless hits are ignored."""
    free = (i for i, (branch, wanted) in enumerate(branches) if wanted and branch.may_be_taken)
    hit = (i for i, (branch, wanted) in enumerate(branches) if wanted and branch.within_limits and request.ignore)
    return next(free, next(hit, None))


def _held_values(arm: Arm, held: Mapping[str, float]) -> dict[str, float]:
    """{joint: value}, converted from [deg | mm] to [rad | mm]."""
    values = units.joints_in(arm, [held.get(name, 0.0) for name in arm.joint_names]).tolist()
    return {name: value for name, value in zip(arm.joint_names, values, strict=True) if name in held}


def _kept_joints(arm: Arm, held: Mapping[str, float]) -> list[int]:
    return [i for i, name in enumerate(arm.joint_names) if name not in held]


def _answers_of_call(request: Request, held: dict[str, float], s: Solutions, near: Array) -> Iterator[Answer]:
    """The answers of one call of the solver, in joints of the whole arm."""
    arm = request.arm
    q = unlock(arm, held, s.q) if held else s.q
    outside = limits.outside_limits(arm, q)  # nan compares as inside
    within = s.within_limits & ~outside.any(axis=-1)
    mm, rad = s.residual()
    motions = units.joints_out(arm, np.abs(q - near)).sum(axis=-1)
    columns = units.joints_out(arm, q), s.branch, within, mm, units.angles_out(rad), motions
    # Plain Python from here on, as numpy is slow at single numbers and a batch has many.
    joints, names, legal, miss, turn, motion = (column.tolist() for column in columns)
    unheld = [name for name in arm.joint_names if name not in held]
    families = intervals_out(s)
    near_by = iter(hits(arm, q[s.valid])) if arm.keep_out else itertools.repeat((None, ()))
    flags = zip(s.valid.tolist(), s.status.tolist(), s.complete.tolist(), strict=True)
    for i, (valid, status, proved) in enumerate(flags):
        branches = [
            TargetBranch(
                q=q[i, b],
                joints=joints[i][b],
                name=s.names[names[i][b]],
                within_limits=legal[i][b],
                outside=[] if legal[i][b] else np.flatnonzero(outside[i, b]).tolist(),
                residual_mm=miss[i][b],
                residual_deg=turn[i][b],
                motion=motion[i][b],
                clearance=clearance,
                hits=hit,
                interval=None if families is None else (families[i][b][0], families[i][b][1]),
            )
            for b, (clearance, hit) in zip((b for b, is_branch in enumerate(valid) if is_branch), near_by, strict=False)
        ]
        free = [name for name, is_free in zip(unheld, s.free[i].tolist(), strict=True) if is_free]
        legal_count = sum(branch.within_limits for branch in branches)
        name = Status(status).name.lower()
        yield Answer(name, s.method, s.why, proved, free, branches, None, None, len(branches), legal_count, s.names)


@dataclass
class _SweptTarget:
    """The answer of one target, collected over all swept values."""

    best: tuple[int, Answer] | None = None  # the best status, and the first answer with it
    names: dict[str, None] = field(default_factory=dict)  # names in the order of occurrence
    last: tuple[str, ...] = ()  # names in the last answer
    free: set[str] = field(default_factory=set)
    total: int = 0
    legal: int = 0
    branches: list[tuple[TargetBranch, bool]] = field(default_factory=list)  # each, and whether its name is requested

    def add(self, status: int, answer: Answer, wanted_names: set[str]) -> None:
        """Add the answer for one combination of values."""
        rank = _RANKS.index(status)
        if self.best is None or rank < self.best[0]:
            self.best = rank, answer._replace(branches=[])
        if answer.names != self.last:
            self.last = answer.names
            self.names.update(dict.fromkeys(answer.names))
        self.free.update(answer.free)
        self.total += answer.total
        self.legal += answer.within_limits
        self.branches += [(branch, branch.name in wanted_names) for branch in answer.branches]

    def thin_out(self, request: Request) -> None:
        """Keep only the nearest branch of every name, inside and outside limits."""
        nearest: dict[tuple[str, bool, bool], tuple[TargetBranch, bool]] = {}
        for item in sorted(self.branches, key=lambda item: _rank(request, item[0])):
            nearest.setdefault((item[0].name, item[0].within_limits, item[0].may_be_taken), item)
        # Copy q, which is a row of the large array of all targets.
        self.branches = [(branch._replace(q=branch.q.copy()), named) for branch, named in nearest.values()]

    def answer(self, request: Request) -> Answer:
        """The combined answer, with the best status and the sorted branches."""
        assert self.best is not None
        first = self.best[1]
        ranked = sorted(self.branches, key=lambda item: _rank(request, item[0]))
        best = _best_branch(request, ranked)
        refused = None
        if request.branch is not None and best is None:
            refused = _refusal_reasons(request, [branch for branch, named in ranked if named])
        status = first.status
        if request.position_first and best is not None:
            row = ranked[best][0]
            missed = math.hypot(row.residual_mm / request.arm.reach, math.radians(row.residual_deg))
            status = (Status.EXACT if missed <= tol.SOLUTION else Status.POSITION).name.lower()
        return first._replace(
            status=status, complete=first.complete and not request.swept, free=sorted(self.free),
            branches=[branch for branch, _ in ranked], best=best, refused=refused,
            total=self.total, within_limits=self.legal, names=tuple(self.names),
        )  # fmt: skip


def _rank(request: Request, branch: TargetBranch) -> tuple[bool, bool, float, float]:
    hit = branch.within_limits and bool(branch.hits)  # hits outside limits do not count
    angle = round(branch.residual_deg, tol.EQUAL_DECIMALS) if request.position_first else 0.0
    return not branch.within_limits, hit, angle, round(branch.motion, tol.EQUAL_DECIMALS)


def _refusal_reasons(request: Request, named: Sequence[TargetBranch]) -> str:
    """The reasons why the branches of the requested name are refused: limits or hits."""
    if not named:
        return f"no branch called '{request.branch}' reaches this target"
    reasons: dict[str, str] = {}  # several poses may share a name, as with --sweep: the nearest counts
    for branch in named:
        if branch.within_limits and branch.hits:
            reasons.setdefault(branch.name, f"'{branch.name}' {hits_text(list(branch.hits))}")
            continue
        joints = ", ".join(request.arm.joint_names[i] for i in branch.outside)
        reasons.setdefault(branch.name, f"'{branch.name}' is outside limits" + (f": {joints}" if joints else ""))
    return "; ".join(reasons.values())
