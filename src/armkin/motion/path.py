"""`armkin.path`: moves of the tool and the joints as one plan in time, on the right branch, within all limits."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import NoSolutionError, UsageError
from armkin.formula.arrays import Array
from armkin.forward import fk
from armkin.inverse.branches.names import find
from armkin.inverse.solutions import Status
from armkin.inverse.solve import ik
from armkin.inverse.tasks.fitting import task_for
from armkin.inverse.tasks.task import targets_of
from armkin.model.limits import check_limits, outside, said
from armkin.motion import branch_report, geometry, path_numbers
from armkin.motion.branch_path import Pace, carry, deviation, stretches
from armkin.motion.curve import Curve, Smoothed
from armkin.motion.free import checked
from armkin.motion.geometry import Piece, Spot
from armkin.motion.path_plan import Marker, PathPlan
from armkin.motion.plan import approach, check_jerk, check_rates, check_share, straight
from armkin.motion.profile import at_rest
from armkin.motion.route import joined
from armkin.motion.trajectory import Straight, Stretch
from armkin.motors import settled, undriven

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm
    from armkin.motion.branch_chains import Run
    from armkin.motion.route import Route
    from armkin.path_file import Move, PathFile

TOLERANCE = 0.05  # [mm]
HOLD = 1.5  # of max_accel, on a hold
_OF_JOINTS = ("joint", "wait", "grip")  # moves that need no targets


def path(
    arm: Arm,
    moves: str | os.PathLike[str] | PathFile | Mapping[str, Any] | ArrayLike,
    *,
    start: ArrayLike | None = None,
    near: ArrayLike | None = None,
    branch: str | None = None,
    task: str | None = None,
    tolerance: float | None = None,
    blend: float | None = None,
    speed: float = 1.0,
    accel: float = 1.0,
    tool_speed: float | None = None,
    jerk: ArrayLike | None = None,
    hold: float | None = HOLD,
    split: bool = False,
    samples: int | None = None,
) -> PathPlan:
    """A plan through moves: time-optimal, on the branch that carries the whole way.

    moves: a path file's name, its model or its data (millimetres, degrees), or targets (w, m) or (w, 4, 4)
    [mm, rad] to pass on straight lines. start: (n,) where the arm stands, by default home; near: (n,) which
    branches are preferred, by default the start. speed, accel: fractions of the joints' limits; tool_speed:
    [mm/s]; jerk: [rad/s3 | mm/s3] for all joints or each; hold: how many times max_accel a joint may be asked for
    when the board holds on the path, None: no matter. split: change the branch, by a joint move, where none
    carries on. Where the moves begin elsewhere than at `start`, the plan's `approach` is the joint move from there to
    its first posture, and no part of its motion. Raises UsageError for moves that make no sense, NoSolutionError if
    some part is not carried: its `plan` then tells how far every branch goes.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("three_dof")
    >>> plan = armkin.path(arm, [[390, 80, 300], [390, -80, 300]], tool_speed=100.0)
    >>> armkin.fk(arm, plan.q(plan.duration))[:3, 3].round(6).tolist()
    [390.0, -80.0, 300.0]
    """
    from armkin.path_file import check_robot
    from armkin.path_file.model import LEAST_TOLERANCE, LEAST_TOOL_SPEED

    check_rates(arm)
    file = path_numbers.moves(arm, moves, task)
    check_robot(file, arm.name, arm.path)
    for name, value in (("speed", speed), ("accel", accel)):
        check_share(name, value)
    for name, least, given in (("tool_speed", LEAST_TOOL_SPEED, tool_speed), ("tolerance", LEAST_TOLERANCE, tolerance)):
        if given is not None and not least <= given < np.inf:
            raise UsageError(
                f"{name} {given:g} is not possible; it is at least {least:g} mm{'/s' * (name == 'tool_speed')}"
            )
    pace = Pace(
        (file.speed or 100.0) / 100 * speed,
        accel,
        tool_speed if tool_speed is not None else file.tool_speed,
        check_jerk(arm, jerk),
        hold,
        tolerance or file.tolerance or TOLERANCE,
    )
    here = arm.home if start is None else np.asarray(start, dtype=float)
    if arm.motors and not undriven(arm):
        here = settled(arm, here)
    near = None if near is None else np.asarray(near, dtype=float)
    return checked(_Walk(arm, file, pace, here, _Wishes(task, blend, near, branch, split, samples)).walked())


@dataclass(frozen=True)
class _Wishes:
    """What `path` was asked for beside the moves and their pace."""

    task: str | None
    blend: float | None
    near: Array | None
    branch: str | None
    split: bool
    samples: int | None


class _Walk:
    """Goes through the moves: joint moves at once, moves of the tool in groups that keep one branch."""

    _spot: Spot | None = None
    opening = False  # whether the path's first posture is not chosen yet
    leads: Move | None = None  # the move of the file that leads to a group's first point
    at = group = 0, 0  # first and last move, from 0: what is done now, and what has gathered

    def __init__(self, arm: Arm, file: PathFile, pace: Pace, here: Array, wishes: _Wishes) -> None:
        self.arm, self.file, self.pace, self.wishes = arm, file, pace, wishes
        with _of_key(file, "task"):
            self.plan = PathPlan(arm, _task(arm, file, wishes.task or file.task), pace.tolerance, pace.speed)
        self.blend = file.blend if wishes.blend is None else wishes.blend
        self.q = here  # where the joints are when all so far is done
        self.made: list[Stretch] = []
        self.markers: list[Marker] = []  # what happens between stretches
        self._clear(None)

    @property
    def task(self) -> Task:
        """What targets prescribe. Raises UsageError if no task fits the arm."""
        return self.plan.task or task_for(self.arm, None)

    @property
    def spot(self) -> Spot:
        """Where the tool is when all that has gathered is done."""
        if self._spot is None:
            self._spot = geometry.spot(self.task, targets_of(self.task, fk(self.arm, self.q)[None], self.q[None])[0])
        return self._spot

    def _clear(self, goal: Spot | None, branch: str | None = None) -> None:
        """Begin a group: at a target whose branch is free, or where the joints are."""
        self.goal, self.goal_branch, self.group = goal, branch, self.at
        self._spot = goal
        self.pieces: list[Piece] = []
        self.blends: list[float] = []
        self.pauses: dict[int, list[tuple[str, Any]]] = {}

    def walked(self) -> PathPlan:
        """The plan of all moves."""
        here = self.q
        with _of_key(self.file, "start"):
            self._begin()
        for number, move in enumerate(self.file.moves):
            self.at = number, number
            with _of_moves(self):
                getattr(self, f"_{move.kind}")(move, getattr(move, move.kind))
        with _of_moves(self):
            self._close()
        self.plan.approach = approach(self.arm, here, self.begun, self.pace.speed, self.pace.accel, self.pace.jerk)
        return self.plan.finished(self.begun, self.made, self.markers)

    def _begin(self) -> None:
        """Where the path begins: where the arm stands, in a posture, or at a point, which the first moves choose."""
        start = self.file.start
        value = start if start is None or isinstance(start, str) else start.joints
        if start is not None and value is None:
            goal = self._target(start.point)  # type: ignore[union-attr, arg-type]
            self._reached(goal, None)  # refused here, of this key
            self._clear(goal)
            self.opening = True
        elif value is not None:
            self.q = path_numbers.joints(self.arm, self.q, value)
            check_limits(self.arm, self.q[None])
            self._clear(None)
        self.begun = self.q

    # Moves

    def _joint(self, move: Move, value: Any) -> None:
        self._close()
        goal = path_numbers.joints(self.arm, self.q, value)
        self._go(goal, move)
        self._clear(None)

    def _point(self, move: Move, value: list[float]) -> None:
        goal = self._target(value)
        self._close()
        self.leads = move
        self._clear(goal, move.branch)

    def _line(self, move: Move, value: list[float]) -> None:
        self._add(move, geometry.line(self.task, self.spot, self._target(value)))

    def _polyline(self, move: Move, value: list[list[float]]) -> None:
        for target in value:
            self._line(move, target)

    def _arc(self, move: Move, value: Any) -> None:
        via = path_numbers.place(self.task, value.via)
        self._add(move, geometry.arc(self.task, self.spot, via, self._target(value.to)))

    def _circle(self, move: Move, value: Any) -> None:
        if value.turns == 0:
            raise UsageError("circle: turns 0 is no circle")
        flat = self.task.position == 2
        normal = np.array([0.0, 0.0, 1.0]) if flat else path_numbers.place(self.task, value.normal)
        if np.linalg.norm(normal) < 1e-9:
            raise UsageError("circle: its normal has no length")
        centre, angle = path_numbers.place(self.task, value.centre), 2 * np.pi * value.turns
        self._add(move, geometry.circle(self.task, self.spot, centre, normal, angle, value.rise, None))

    def _spline(self, move: Move, value: list[list[float]]) -> None:
        self._add(move, geometry.spline(self.task, self.spot, [self._target(target) for target in value]))

    def _offset(self, move: Move, value: Any) -> None:
        d = path_numbers.place(self.task, value.xyz)
        if value.frame == "tool":
            if self.task.orientation == "full":
                assert self.spot.turned is not None
                d = self.spot.turned @ d
            else:  # the tool's axes are known once the joints are
                self._close()
                self._clear(None)
                d = (fk(self.arm, self.q)[:3, :3] @ np.append(d, 0.0)[:3])[: len(d)]
        self._add(move, geometry.line(self.task, self.spot, replace(self.spot, p=self.spot.p + d)))

    def _wait(self, move: Move, value: float) -> None:
        self._between("wait", value)

    def _grip(self, move: Move, value: Any) -> None:
        path_numbers.check_grip(self.arm, value)
        self._between("grip", value)

    def _between(self, kind: str, value: Any) -> None:
        if self.goal is None and not self.pieces:
            self._mark(kind, value)
        else:
            self.pauses.setdefault(len(self.pieces), []).append((kind, value))

    def _mark(self, kind: str, value: Any) -> None:
        if kind == "wait":
            self.made.append(Straight(self.q, self.q, at_rest(float(value))))
        else:
            self.markers.append(Marker(len(self.made), kind, value))

    def _add(self, move: Move, piece: Piece) -> None:
        speed = None if move.speed is None else move.speed / 100 * self.pace.speed
        self.group = (self.group if self.goal is not None or self.pieces else self.at)[0], self.at[1]
        self.pieces.append(replace(piece, speed=speed, tool_speed=move.tool_speed or piece.tool_speed))
        self.blends.append(self.blend if move.blend is None else move.blend)
        self._spot = piece.last

    def _target(self, value: list[float]) -> Spot:
        return path_numbers.target(self.task, self.spot, value)

    # Groups

    def _close(self) -> None:
        """Plan the group of tool moves that has gathered; what is wrong with it is said of its moves."""
        now, self.at = self.at, self.group
        self._plan_group()
        self.at = now

    def _plan_group(self) -> None:
        if not self.pieces:
            if self.goal is not None:
                self._go(self._reached(self.goal, self.goal_branch), self.leads)
                for kind, value in self.pauses.get(0, ()):
                    self._mark(kind, value)
            self.goal = None
            return
        route, order = joined(self.task, self.pieces, self.blends, frozenset(self.pauses))
        if route.length < geometry.SMALL:
            raise UsageError("the tool's way has no length: its points are all the same")
        free = self.goal is not None
        near = self.q if self.wishes.near is None else self.wishes.near
        s, runs = self._runs(route, near, free=free)
        for k, run in enumerate(runs):
            if run.first == run.last:
                continue
            fixed = self.q if not free and k == 0 else None
            curves = stretches(self.arm, route, s, run, near, self.pace, fixed=fixed)
            if free or k:
                self._go(curves[0].start, self.leads if k == 0 else None)
            self._lay(route, curves, order)
            near = self.q
        for kind, value in self.pauses.get(len(self.pieces), ()):
            self._mark(kind, value)
        self.plan.length += route.length
        self.goal = None
        self.pieces, self.blends, self.pauses = [], [], {}

    def _runs(self, route: Route, near: Array, *, free: bool) -> tuple[Array, list[Run]]:
        """A route's samples and the runs that carry it; the other branches, of many samples, are forgotten."""
        branch = (self.goal_branch or self.wishes.branch) if free else None
        carried = carry(
            self.arm, route, near=near, tolerance=self.pace.tolerance, pace=self.pace,
            fixed=None if free else self.q, branch=branch, count=self.wishes.samples,
        )  # fmt: skip
        branch_report.note(self.plan, carried, near)
        if not carried.whole and not (self.wishes.split and carried.covered):
            raise branch_report.refused(self.plan, carried, branch)
        return carried.columns.s, carried.runs

    def _lay(self, route: Route, curves: list[Curve | Smoothed], order: dict[int, int]) -> None:
        """Put a run's curves into the plan, with the pauses where they begin."""
        at = {round(float(route.ends[order[k]]), 6): self.pauses[k] for k in self.pauses if k in order}
        for curve in curves:
            path_ = curve.path if isinstance(curve, Curve) else curve.curve.path
            for kind, value in at.pop(round(float(path_.s[0]), 6), ()):
                self._mark(kind, value)
            self.plan.along(len(self.made), curve, self.plan.length)
            self.made.append(curve)
            self.q = curve.end
            self.plan.deviation = max(self.plan.deviation, deviation(self.arm, route, path_))
            self.plan.nearer_singularity(path_.q, path_.s)

    # Joint moves

    def _go(self, goal: Array, move: Move | None) -> None:
        """A joint move to joint values."""
        bad = np.flatnonzero(outside(self.arm, goal))
        if len(bad):
            raise NoSolutionError(f"{said(self.arm, int(bad[0]), float(goal[bad[0]]))}: nothing was moved")
        speed = self.pace.speed * (1.0 if move is None or move.speed is None else move.speed / 100)
        if self.opening:  # the path begins here, and what leads here is none of its moves
            self.begun, self.opening = goal, False
        else:
            one = straight(self.arm, self.q, goal, speed, self.pace.accel, self.pace.jerk)
            self.made += [one] if one.duration > 0 else []
        self.q = goal

    def _reached(self, goal: Spot, branch: str | None) -> Array:
        """Joint values of a target: the branch within limits nearest to where the arm comes from, or the named."""
        found = ik(self.arm, geometry.line(self.task, goal, goal).targets(np.zeros(1))[0], self.task.name, near=self.q)
        meant = find(found.names, wanted) if (wanted := branch or self.wishes.branch) else None
        free = found.clear if self.arm.keep_out and not self.arm.ignores_keep_out else None
        for b in found.order:
            named = meant is None or found.branch[b] in meant
            if found.valid[b] and found.within_limits[b] and named and (free is None or free[b]):
                return np.asarray(found.q[b])
        what = f"the point {', '.join(f'{x:g}' for x in goal.p.round(3).tolist())}"
        if found.status == Status.UNREACHABLE:
            raise NoSolutionError(f"{what} is out of reach: nothing was moved")
        on = f" on branch '{wanted}'" if wanted else ""
        if free is not None and (found.within_limits & ~free).any():
            raise NoSolutionError(f"{what} has no solution{on} that hits nothing: nothing was moved")
        raise NoSolutionError(f"{what} has no solution within the limits{on}: nothing was moved")


def _task(arm: Arm, file: PathFile, name: str | None) -> Task | None:
    """What targets prescribe; None: no task fits the arm, and joint moves alone need none."""
    try:
        return task_for(arm, name)
    except UsageError:
        if name is None and all(move.kind in _OF_JOINTS for move in file.moves):
            return None
        raise


@contextmanager
def _of_key(file: PathFile, key: str) -> Iterator[None]:
    """Errors inside are said of a key of the file, if it has that."""
    try:
        yield
    except (UsageError, NoSolutionError) as error:
        if getattr(file, key) is None or not (place := file.place(key)):
            raise
        raise error.within(place) from None


@contextmanager
def _of_moves(walk: _Walk) -> Iterator[None]:
    """Errors inside are said of the moves that a walk does then."""
    try:
        yield
    except (UsageError, NoSolutionError) as error:
        if not (place := walk.file.place_of(*walk.at)):
            raise
        raise error.within(place, move=walk.at[0] + 1) from None
