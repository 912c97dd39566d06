"""One function for each kind of move: it adds a target, a piece of tool path, a joint move or an event to a walk."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.errors import UsageError
from armkin.forward import fk
from armkin.motion.tool_path import path_numbers, piece_shapes
from armkin.motion.tool_path.dense_points import Polyline

if TYPE_CHECKING:
    from armkin.motion.path_planner.move_walk import Walk
    from armkin.path_file import Move


def _do_joint_move(walk: Walk, move: Move, value: Any) -> None:
    walk.close_group()
    walk.untried_postures, walk.refusal = (), None
    goal = path_numbers.joint_values(walk.arm, walk.q, value)
    walk.append_joint_move(goal, move)
    walk.begin_group(None)


def _do_point(walk: Walk, move: Move, value: list[float]) -> None:
    goal = walk.target(value)
    walk.close_group()
    walk.leads, walk.untried_postures, walk.refusal = move, (), None
    walk.begin_group(goal, move.branch)


def _add_line(walk: Walk, move: Move, value: list[float], is_inner: bool = False) -> None:
    corner = walk.corner_blend(move, is_inner)
    if corner is not None and walk.dense is None:
        walk.add_piece(move, piece_shapes.line(walk.task, walk.spot, walk.target(value)))
        return
    _gather_points(walk, move, [value])
    if corner is not None:
        walk.fit_dense(corner)


def _add_polyline(walk: Walk, move: Move, value: list[list[float]]) -> None:
    if walk.corner_blend(move, is_inner=True) is None:  # the inner points form one curve; the last has its own corner
        _gather_points(walk, move, value[:-1])
        value = value[-1:]
    for index, target in enumerate(value):
        _add_line(walk, move, target, is_inner=index < len(value) - 1)


def _gather_points(walk: Walk, move: Move, targets: list[list[float]]) -> None:
    """Add targets to the points through which one smooth curve will be fitted."""
    if walk.dense is None:
        walk.dense = Polyline(walk.task, walk.spot)
        walk.group = (
            (walk.group if walk.goal is not None or walk.pieces else walk.current_moves)[0],
            walk.current_moves[1],
        )
    speed = None if move.speed is None else move.speed / 100 * walk.pace.speed
    walk.dense.add(targets, speed, move.tool_speed)
    walk.group = walk.group[0], walk.current_moves[1]


def _add_arc(walk: Walk, move: Move, value: Any) -> None:
    via = path_numbers.coordinates(walk.task, value.via)
    walk.add_piece(move, piece_shapes.arc(walk.task, walk.spot, via, walk.target(value.to)))


def _add_circle(walk: Walk, move: Move, value: Any) -> None:
    if value.turns == 0:
        raise UsageError("circle: turns 0 is no circle")
    is_planar = walk.task.position == 2
    normal = np.array([0.0, 0.0, 1.0]) if is_planar else path_numbers.coordinates(walk.task, value.normal)
    if np.linalg.norm(normal) < 1e-9:
        raise UsageError(f"circle: its normal {value.normal} has no length; give the direction of the circle's axis")
    centre, angle = path_numbers.coordinates(walk.task, value.centre), 2 * np.pi * value.turns
    walk.add_piece(move, piece_shapes.circle(walk.task, walk.spot, centre, normal, angle, value.rise, None))


def _add_spline(walk: Walk, move: Move, value: list[list[float]]) -> None:
    walk.add_piece(move, piece_shapes.spline(walk.task, walk.spot, [walk.target(target) for target in value]))


def _add_offset(walk: Walk, move: Move, value: Any) -> None:
    """A straight line by a displacement in the base's frame or the tool's."""
    displacement = path_numbers.coordinates(walk.task, value.xyz)
    if value.frame == "tool":
        if walk.task.orientation == "full":
            assert walk.spot.orientation is not None
            displacement = walk.spot.orientation @ displacement
        else:  # the tool's axes depend on the joints, so a posture has to be chosen first
            typed_sums = walk.spot.sums
            walk.take_posture()
            walk.begin_group(None)
            walk.keep_typed_turns(typed_sums)
            displacement = (fk(walk.arm, walk.q)[:3, :3] @ np.append(displacement, 0.0)[:3])[: len(displacement)]
    walk.add_piece(
        move, piece_shapes.line(walk.task, walk.spot, replace(walk.spot, position=walk.spot.position + displacement))
    )


def _queue_wait(walk: Walk, move: Move, value: float) -> None:
    walk.queue_event("wait", value)


def _queue_grip(walk: Walk, move: Move, value: Any) -> None:
    path_numbers.check_grip(walk.arm, value)
    walk.queue_event("grip", value)


MOVES: dict[str, Callable[[Walk, Move, Any], None]] = {
    "joint": _do_joint_move,
    "point": _do_point,
    "line": _add_line,
    "polyline": _add_polyline,
    "arc": _add_arc,
    "circle": _add_circle,
    "spline": _add_spline,
    "offset": _add_offset,
    "wait": _queue_wait,
    "grip": _queue_grip,
}
