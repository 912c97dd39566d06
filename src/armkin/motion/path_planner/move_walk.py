"""Plans the moves of a path in order: joint moves one by one, moves of the tool in groups that keep one branch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from armkin.errors import NoSolutionError, UsageError
from armkin.formula.arrays import Array
from armkin.forward import fk
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.task import targets_of
from armkin.model.limits import check_limits, outside_limits, outside_text
from armkin.motion.branches.branch_path import Pace, carry_route, starts_at
from armkin.motion.branches.wrist_window import add_detours
from armkin.motion.joint_moves import approach_move, straight_move
from armkin.motion.path_planner import branch_report
from armkin.motion.path_planner.target_postures import target_postures
from armkin.motion.path_planner.timed_run import TimedRun, note_deviation, timed_run
from armkin.motion.plan.path_plan import Marker, PathPlan, copy_plan
from armkin.motion.timing.limit_jerk import joint_path
from armkin.motion.timing.profile import rest_profile
from armkin.motion.timing.trajectory import Straight, Stretch
from armkin.motion.tool_path import path_numbers
from armkin.motion.tool_path.dense_points import FIT_SHARE, Polyline
from armkin.motion.tool_path.path_numbers import OF_JOINTS
from armkin.motion.tool_path.path_pieces import MIN_LENGTH, Piece, Spot, split_target
from armkin.motion.tool_path.route import join_pieces

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm
    from armkin.motion.branches.branch_chains import Run
    from armkin.motion.tool_path.route import Route
    from armkin.path_file import Move, PathFile


@dataclass(frozen=True)
class PathOptions:
    """The options of `armkin.path` that are neither moves nor pace."""

    task: str | None
    corner: float | Literal["default"] | None  # blend of corners without their own; None: by the tolerance
    near: Array | None
    branch: str | None
    split: bool
    samples: int | None


class Walk:
    """The state of the planner between two moves: joint values, motion so far, and the tool moves not planned yet."""

    _spot: Spot | None = None
    opening = False  # whether the path's first posture is still to be chosen
    leads: Move | None = None  # the move of the file that goes to a group's first point
    untried_postures: tuple[Array, ...] = ()  # postures of the last target that are still to be tried
    refusal: NoSolutionError | None = None  # the error of the first posture that failed
    before_posture: Walk | None = None  # a copy of the walk before it moved to that target
    current_moves = group = 0, 0  # numbers, from 0, of the first and last move: of this step, of the group

    def __init__(self, arm: Arm, file: PathFile, pace: Pace, start: Array, options: PathOptions) -> None:
        self.arm, self.file = arm, file
        self.pace, self.options = pace, options
        with _errors_of_key(file, "task"):
            self.plan = PathPlan(arm, _task_or_none(arm, file, options.task or file.task), pace.tolerance, pace.speed)
        self.q = start  # joint values at the end of the moves so far
        self.stretches: list[Stretch] = []
        self.markers: list[Marker] = []  # grips and pauses between stretches
        self.begin_group(None)

    @property
    def task(self) -> Task:
        """What targets prescribe. Raises UsageError if no task fits the arm."""
        return self.plan.task or task_for(self.arm, None)

    @property
    def spot(self) -> Spot:
        """The target of the tool at the end of the moves gathered so far."""
        if self.dense is not None:
            return self.dense.last
        if self._spot is None:
            self._spot = split_target(self.task, targets_of(self.task, fk(self.arm, self.q)[None], self.q[None])[0])
        return self._spot

    def begin_group(self, goal: Spot | None, branch: str | None = None) -> None:
        """Begin a group at a target, whose branch may be chosen, or (goal None) at the present joint values."""
        self.goal, self.goal_branch, self.group = goal, branch, self.current_moves
        self._spot = goal
        self.pieces: list[Piece] = []
        self.blends: list[float | None] = []
        self.dense: Polyline | None = None  # points for one fitted curve
        self.pauses: dict[int, list[tuple[str, Any]]] = {}

    def plan_all(self, kinds: Mapping[str, Callable[[Walk, Move, Any], None]]) -> PathPlan:
        """The plan of all moves; kinds: the function that carries out each kind of move."""
        walk, start, number = self, self.q, 0
        with _errors_of_key(self.file, "start"):
            self._begin()
        while number <= len(self.file.moves):
            try:
                walk._carry_out_move(kinds, number)
                number += 1
            except NoSolutionError as error:
                walk.refusal = walk.refusal or error
                saved_posture, postures, refusal = walk.before_posture, walk.untried_postures, walk.refusal
                if saved_posture is None or not postures:
                    raise refusal from None
                walk = _copy_walk(saved_posture)
                walk.before_posture, walk.untried_postures, walk.refusal = saved_posture, postures, refusal
                number = walk.current_moves[0]
        plan, pace = walk.plan, self.pace
        plan.approach = approach_move(self.arm, start, walk.begun, pace.speed, pace.accel, pace.jerk)
        return plan.set_motion(walk.begun, walk.stretches, walk.markers)

    def _carry_out_move(self, kinds: Mapping[str, Callable[[Walk, Move, Any], None]], number: int) -> None:
        """Carry out a move; the number after the last one closes the group that is still open."""
        if number == len(self.file.moves):
            with _errors_of_moves(self):
                self.close_group()
            return
        move = self.file.moves[number]
        self.current_moves = number, number
        with _errors_of_moves(self):
            kinds[move.kind](self, move, getattr(move, move.kind))

    def take_posture(self) -> None:
        """Move to the nearest posture of the group's only target; the others are tried if a later move fails."""
        if self.goal is None or self.pieces:
            self.close_group()
            return
        postures = self.untried_postures or self.postures(self.goal, self.goal_branch)
        self.goal_branch, self.untried_postures = None, postures[1:]
        if self.untried_postures:
            self.before_posture = None
            self.before_posture = _copy_walk(self)
        self.append_joint_move(postures[0], self.leads)
        for kind, value in self.pauses.get(0, ()):
            self.emit_event(kind, value)
        self.goal = None

    def _begin(self) -> None:
        """Set the path's first posture: the arm's, the file's joint values, or a point whose branch is chosen later."""
        start = self.file.start
        value = start if start is None or isinstance(start, str) else start.joints
        if start is not None and value is None:
            goal = self.target(start.point)  # type: ignore[union-attr, arg-type]
            self.postures(goal, None)  # raises here, so that the error names the key start
            self.begin_group(goal)
            self.opening = True
        elif value is not None:
            self.q = path_numbers.joint_values(self.arm, self.q, value)
            check_limits(self.arm, self.q[None])
            self.begin_group(None)
        self.begun = self.q

    def fit_dense(self, corner: float | None = None) -> None:
        """Fit curves through the gathered points; corner: the blend at the last point."""
        if self.dense is None:
            return
        dense, self.dense = self.dense, None
        self._spot = dense.last
        pieces = dense.pieces(self.pace.tolerance)
        self.pieces += pieces
        # fitted curves meet where the path turns back; a blend there would miss the neighbouring points
        self.blends += [None if a.dense is None and b.dense is None else 0.0 for a, b in pairwise(pieces)] + [corner]

    def corner_blend(self, move: Move, is_inner: bool = False) -> float | None:
        """The radius [mm] of the blend at the end of a move; None: the tolerance decides."""
        if move.blend is not None:
            return move.blend
        if self.options.corner == "default":
            return None if is_inner else 0.0
        return self.options.corner

    def keep_typed_turns(self, sums: Array) -> None:
        """Add to the present target the whole turns of angle sums that the user typed."""
        turns = np.rint((sums - self.spot.sums) / (2 * np.pi))
        self._spot = replace(self.spot, sums=self.spot.sums + 2 * np.pi * turns)

    def queue_event(self, kind: str, value: Any) -> None:
        """Queue a wait or grip after the gathered moves; without any it is emitted at once."""
        self.fit_dense()
        if self.goal is None and not self.pieces:
            self.emit_event(kind, value)
        else:
            self.pauses.setdefault(len(self.pieces), []).append((kind, value))

    def emit_event(self, kind: str, value: Any) -> None:
        """Append a grip, a pause or a rest to the motion."""
        if kind == "wait" and value == "enter":
            self.markers.append(Marker(len(self.stretches), "pause", None))
        elif kind == "wait":
            self.stretches.append(Straight(self.q, self.q, rest_profile(float(value))))
        else:
            self.markers.append(Marker(len(self.stretches), kind, value))

    def add_piece(self, move: Move, piece: Piece) -> None:
        """Add a piece of tool path to the group, with the speed and blend of its move."""
        speed = None if move.speed is None else move.speed / 100 * self.pace.speed
        first_move = (self.group if self.goal is not None or self.pieces else self.current_moves)[0]
        self.group = first_move, self.current_moves[1]
        self.fit_dense()
        self.pieces.append(replace(piece, speed=speed, tool_speed=move.tool_speed or piece.tool_speed))
        self.blends.append(self.corner_blend(move))
        self._spot = piece.last

    def target(self, value: list[float]) -> Spot:
        """A target from the numbers of a move; numbers that it leaves out are those of the present target."""
        return path_numbers.target_spot(self.task, self.spot, value)

    def postures(self, goal: Spot, branch: str | None) -> tuple[Array, ...]:
        """Joint values of a target, nearest to the present ones first; branch: its name, None: that of the options."""
        return target_postures(self.arm, self.task, goal, self.q, branch or self.options.branch)

    # Groups

    def close_group(self) -> None:
        """Plan the group of tool moves; errors then name the moves of the group."""
        moves_before, self.current_moves = self.current_moves, self.group
        self.fit_dense()
        self._plan_group()
        self.current_moves = moves_before

    def _plan_group(self) -> None:
        """Plan the group: a joint move to a single target, else the runs of its route, with waits and grips."""
        if not self.pieces:
            if self.goal is not None:
                self.append_joint_move(self.postures(self.goal, self.goal_branch)[0], self.leads)
                for kind, value in self.pauses.get(0, ()):
                    self.emit_event(kind, value)
            self.goal = None
            return
        tolerance = self.pace.tolerance
        pauses, fit = frozenset(self.pauses), FIT_SHARE * tolerance
        route, order = join_pieces(self.task, self.pieces, self.blends, pauses, fit, self.plan.reduced)
        if route.length < MIN_LENGTH:
            raise UsageError("the tool's way has no length: its points are all the same")
        any_branch = self.goal is not None
        near = self.q if self.options.near is None else self.options.near
        s, runs = self._runs(route, near, any_branch=any_branch)
        for number, run in enumerate(runs):
            fixed = self.q if not any_branch and run.first == number == 0 and starts_at(run.chain, self.q) else None
            timed = timed_run(self.arm, self.pace, route, s, run, near, fixed)
            if fixed is None:
                self.append_joint_move(timed.curves[0].start, self.leads if number == 0 else None)
            self.append_run(add_detours(route, run.chain.windows), timed, order)
            near = self.q
        for kind, value in self.pauses.get(len(self.pieces), ()):
            self.emit_event(kind, value)
        self.plan.length += route.length
        self.goal = None
        self.pieces, self.blends, self.pauses = [], [], {}

    def _runs(self, route: Route, near: Array, *, any_branch: bool) -> tuple[Array, list[Run]]:
        """A route's samples and the runs that carry it; all other branches are dropped to free their memory."""
        branch = (self.goal_branch or self.options.branch) if any_branch else None
        carried_route = carry_route(
            self.arm, route, near=near, tolerance=self.pace.tolerance, pace=self.pace,
            fixed=None if any_branch else self.q, branch=branch, count=self.options.samples
        )  # fmt: skip
        branch_report.note_runs(self.plan, carried_route, near)
        if not carried_route.in_one_run and not (self.options.split and carried_route.is_covered):
            raise branch_report.path_refusal(self.plan, carried_route, branch)
        return carried_route.columns.s, carried_route.moving_runs

    def append_run(self, route: Route, timed: TimedRun, number_of_curve: dict[int, int]) -> None:
        """Append a run's curves to the plan, with the events at their beginnings."""
        begins = {k: round(float(route.ends[number_of_curve[k]]), 6) for k in self.pauses if k in number_of_curve}
        events = {begin: self.pauses[k] for k, begin in begins.items()}
        for curve in timed.curves:
            knots = joint_path(curve)
            for kind, value in events.pop(round(float(knots.s[0]), 6), ()):
                self.emit_event(kind, value)
            self.plan.note_stretch(len(self.stretches), curve, self.plan.length)
            self.stretches.append(curve)
            self.q = curve.end
        note_deviation(self.plan, route, timed)

    def append_joint_move(self, goal: Array, move: Move | None) -> None:
        """A joint move to joint values."""
        illegal = np.flatnonzero(outside_limits(self.arm, goal))
        if len(illegal):
            raise NoSolutionError(f"{outside_text(self.arm, int(illegal[0]), goal[illegal[0]])}: nothing was moved")
        speed = self.pace.speed * (1.0 if move is None or move.speed is None else move.speed / 100)
        if self.opening:  # the path begins here: the move to this posture is its approach
            self.begun, self.opening = goal, False
        else:
            stretch = straight_move(self.arm, self.q, goal, speed, self.pace.accel, self.pace.jerk)
            self.stretches += [stretch] if stretch.duration > 0 else []
        self.q = goal


def _copy_walk(walk: Walk) -> Walk:
    """A copy of a walk and its plan; the moves that follow change the lists of one of both only."""
    twin = copy(walk)
    twin.stretches, twin.markers = walk.stretches.copy(), walk.markers.copy()
    twin.pieces, twin.blends, twin.pauses = walk.pieces.copy(), walk.blends.copy(), walk.pauses.copy()
    twin.plan = copy_plan(walk.plan)
    return twin


def _task_or_none(arm: Arm, file: PathFile, name: str | None) -> Task | None:
    """The task of a file's targets; None: no task fits the arm, and a file of joint moves needs none."""
    try:
        return task_for(arm, name)
    except UsageError:
        if name is None and all(move.kind in OF_JOINTS for move in file.moves):
            return None
        raise


@contextmanager
def _errors_of_key(file: PathFile, key: str) -> Iterator[None]:
    """Name a key of the file as the place of errors raised inside, if the file has that key."""
    try:
        yield
    except (UsageError, NoSolutionError) as error:
        if getattr(file, key) is None or not (place := file.place(key)):
            raise
        raise error.within(place) from None


@contextmanager
def _errors_of_moves(walk: Walk) -> Iterator[None]:
    """Name the moves in progress as the place of errors raised inside."""
    try:
        yield
    except (UsageError, NoSolutionError) as error:
        if not (place := walk.file.place_of(*walk.current_moves)):
            raise
        raise error.within(place, move=walk.current_moves[0] + 1) from None
