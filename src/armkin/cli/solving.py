"""Inverse kinematics for the command line: one answer a target, branches sorted, locked joints put back."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from armkin.cli import output
from armkin.cli.numbers import number, whole
from armkin.errors import UsageError
from armkin.model import units

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.inverse.closest import Closest
    from armkin.inverse.solutions import Solutions
    from armkin.model.arm import Arm

MOST_SWEEPS = 10_000


@dataclass(frozen=True)
class Request:
    """What to solve for and how to choose."""

    arm: Arm
    task: str | None = None
    near: Sequence[float] | None = None  # [deg | mm], by default home
    branch: str | None = None  # name of the branch wanted
    held: Mapping[str, float] = field(default_factory=dict)  # joint name -> value [deg | mm]
    swept: Mapping[str, Sequence[float]] = field(default_factory=dict)  # joint name -> values to try

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
    """Answer targets (N, ...) [mm, rad]."""
    import armkin
    from armkin.inverse.branches.names import find

    arm = request.arm
    near = units.joints_in(arm, request.near_out)
    parts: list[list[tuple[int, Answer, set[str]]]] = [[] for _ in targets]
    for held in _holds(request):
        one = armkin.lock(arm, held) if held else arm
        s = armkin.ik(one, targets, request.task, near=near[_kept(arm, held)])
        wanted = set(s.names)
        if request.branch is not None:
            wanted = {s.names[i] for i in find(s.names, request.branch)}
        for i, answer in enumerate(_answers(request, held, s, near)):
            parts[i].append((int(s.status[i]), answer, wanted))
    return [_merged(request, found) for found in parts]


def closest(request: Request, target: Array) -> Closest:
    """The pose within limits nearest to one target [mm, rad], with swept joints free."""
    from dataclasses import replace

    import armkin

    arm = request.arm
    near = units.joints_in(arm, request.near_out)
    held = _in(arm, request.held)
    one = armkin.lock(arm, held) if held else arm
    nearest = armkin.closest(one, target, request.task, near=near[_kept(arm, held)])
    return replace(nearest, q=armkin.unlock(arm, held, nearest.q)) if held else nearest


def turns(request: Request, branch: Branch) -> list[list[float]]:
    """All copies of a branch within limits, whole turns away, the nearest first [deg | mm]; held joints stay."""
    import numpy as np

    import armkin

    arm = request.arm
    copies = armkin.turns(arm, branch.q, near=units.joints_in(arm, request.near_out))
    held = [arm.joint_names.index(name) for name in (*request.held, *request.swept)]
    same = np.abs(copies[:, held] - branch.q[held]).max(axis=1, initial=0.0) < 1e-9
    return [list(row) for row in units.joints_out(arm, copies[same]).tolist()]


def locks(arm: Arm, words: Sequence[str] | None) -> dict[str, float]:
    """`--lock J=V`: joint name -> value [deg | mm]."""
    found: dict[str, float] = {}
    for text in words or ():
        name, value = _named(arm, text, "--lock", "J3=20", found)
        found[name] = number(value, f"--lock {name}")
        low, high = units.limits_out(arm)[arm.joint_names.index(name)]
        if not low <= found[name] <= high:
            output.warn(f"--lock {text}: the limits of {name} are {low:g} to {high:g}: all branches are outside")
    return found


def sweeps(arm: Arm, words: Sequence[str] | None, held: Mapping[str, float]) -> dict[str, list[float]]:
    """`--sweep J=LOW:HIGH:COUNT`: joint name -> values [deg | mm], both ends included."""
    found: dict[str, list[float]] = {}
    total = 1
    for text in words or ():
        name, value = _named(arm, text, "--sweep", "J3=-90:90:16", {**held, **found})
        parts = value.split(":")
        if len(parts) != 3:
            raise UsageError(f"--sweep {text}: write JOINT=LOW:HIGH:COUNT, for example J3=-90:90:16")
        low, high = number(parts[0], f"--sweep {name}"), number(parts[1], f"--sweep {name}")
        count = whole(parts[2], f"--sweep {name}: count", 1, MOST_SWEEPS)
        found[name] = [low + (high - low) * i / max(count - 1, 1) for i in range(count)]
        total *= count
    if total > MOST_SWEEPS:
        raise UsageError(f"--sweep: {total} combinations; at most {MOST_SWEEPS} are tried")
    return found


def _named(arm: Arm, text: str, option: str, example: str, taken: dict[str, Any]) -> tuple[str, str]:
    from armkin.model.lock import joint_index

    name, equals, value = text.partition("=")
    if not equals:
        raise UsageError(f"{option} {text}: write JOINT=VALUE, for example {example}")
    joint_index(arm, name)
    if name in taken:
        raise UsageError(f"{option} {text}: {name} is held already")
    return name, value


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
    import numpy as np

    import armkin
    from armkin.model import limits

    arm = request.arm
    q = armkin.unlock(arm, held, s.q) if held else s.q
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
        yield Answer(armkin.Status(status).name.lower(), s.method, s.why, sure, free, branches, None)


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
