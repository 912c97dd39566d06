"""What each kind of move does: a target, a piece of the tool's way, a joint move, or an event between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.errors import UsageError
from armkin.forward import fk
from armkin.motion.tool_path import path_numbers, path_pieces
from armkin.motion.tool_path.dense_points import Polyline

if TYPE_CHECKING:
    from armkin.motion.plan_moves import Walk
    from armkin.path_file import Move


def _joint(walk: Walk, move: Move, value: Any) -> None:
    walk.close()
    walk.untried_postures, walk.refused = (), None
    goal = path_numbers.joints(walk.arm, walk.q, value)
    walk.append_joint_move(goal, move)
    walk.clear(None)


def _point(walk: Walk, move: Move, value: list[float]) -> None:
    goal = walk.target(value)
    walk.close()
    walk.leads, walk.untried_postures, walk.refused = move, (), None
    walk.clear(goal, move.branch)


def _line(walk: Walk, move: Move, value: list[float], inner: bool = False) -> None:
    corner = walk.corner(move, inner)
    if corner is not None and walk.dense is None:
        walk.add(move, path_pieces.line(walk.task, walk.spot, walk.target(value)))
        return
    _gather(walk, move, [value])
    if corner is not None:
        walk.lay_dense(corner)


def _polyline(walk: Walk, move: Move, value: list[list[float]]) -> None:
    if walk.corner(move, inner=True) is None:  # all its inner points gather, the last one as its own corner says
        _gather(walk, move, value[:-1])
        value = value[-1:]
    for k, target in enumerate(value):
        _line(walk, move, target, inner=k < len(value) - 1)


def _gather(walk: Walk, move: Move, targets: list[list[float]]) -> None:
    """Put targets to the points that become one smooth curve."""
    if walk.dense is None:
        walk.dense = Polyline(walk.task, walk.spot)
        walk.group = (
            (walk.group if walk.goal is not None or walk.pieces else walk.current_moves)[0],
            walk.current_moves[1],
        )
    speed = None if move.speed is None else move.speed / 100 * walk.pace.speed
    walk.dense.add(targets, speed, move.tool_speed)
    walk.group = walk.group[0], walk.current_moves[1]


def _arc(walk: Walk, move: Move, value: Any) -> None:
    via = path_numbers.place(walk.task, value.via)
    walk.add(move, path_pieces.arc(walk.task, walk.spot, via, walk.target(value.to)))


def _circle(walk: Walk, move: Move, value: Any) -> None:
    if value.turns == 0:
        raise UsageError("circle: turns 0 is no circle")
    flat = walk.task.position == 2
    normal = np.array([0.0, 0.0, 1.0]) if flat else path_numbers.place(walk.task, value.normal)
    if np.linalg.norm(normal) < 1e-9:
        raise UsageError("circle: its normal has no length")
    centre, angle = path_numbers.place(walk.task, value.centre), 2 * np.pi * value.turns
    walk.add(move, path_pieces.circle(walk.task, walk.spot, centre, normal, angle, value.rise, None))


def _spline(walk: Walk, move: Move, value: list[list[float]]) -> None:
    walk.add(move, path_pieces.spline(walk.task, walk.spot, [walk.target(target) for target in value]))


def _offset(walk: Walk, move: Move, value: Any) -> None:
    d = path_numbers.place(walk.task, value.xyz)
    if value.frame == "tool":
        if walk.task.orientation == "full":
            assert walk.spot.turned is not None
            d = walk.spot.turned @ d
        else:  # the tool's axes are known once the joints are
            typed = walk.spot.sums
            walk.take_posture()
            walk.clear(None)
            walk.typed(typed)
            d = (fk(walk.arm, walk.q)[:3, :3] @ np.append(d, 0.0)[:3])[: len(d)]
    walk.add(move, path_pieces.line(walk.task, walk.spot, replace(walk.spot, p=walk.spot.p + d)))


def _wait(walk: Walk, move: Move, value: float) -> None:
    walk.queue_event("wait", value)


def _grip(walk: Walk, move: Move, value: Any) -> None:
    path_numbers.check_grip(walk.arm, value)
    walk.queue_event("grip", value)


MOVES: dict[str, Callable[[Walk, Move, Any], None]] = {
    "joint": _joint,
    "point": _point,
    "line": _line,
    "polyline": _polyline,
    "arc": _arc,
    "circle": _circle,
    "spline": _spline,
    "offset": _offset,
    "wait": _wait,
    "grip": _grip,
}
