"""Coordinated moves: joint values in, lines of device segments out.

A move is a straight line in joint space, and so in the motors' counts, because motors are linear in
joints: `armkin.board.firmware.segments` cuts it. What a move may not do is refused here, before anything moves: joints
outside their limits, missing rates, rates that the board cannot make.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from armkin.board.firmware.segments import CLOCK, EASE, MIN_INTERVAL, Counts, Move, line, progress
from armkin.errors import NoSolutionError, UsageError
from armkin.formula.arrays import Array
from armkin.forward import frames
from armkin.model.limits import outside, said
from armkin.motors import joints as joints_of
from armkin.motors import motor_names, pulses

if TYPE_CHECKING:
    from armkin.model.arm import Arm


@dataclass(frozen=True)
class Plan:
    """Moves through waypoints, at rest in each: what `armkin send` does, and `--dry-run` prints."""

    arm: Arm
    start: Counts  # (motors,)
    moves: tuple[Move, ...]
    clock: int = CLOCK

    @property
    def end(self) -> Counts:
        """Counts at the end: (motors,)."""
        return self.moves[-1].end if self.moves else self.start

    @property
    def duration(self) -> float:
        """Seconds from the first tick to the last."""
        return sum(move.cycles for move in self.moves) / self.clock

    @property
    def segments(self) -> int:
        """Number of device segments."""
        return sum(len(move.segments) for move in self.moves)

    @property
    def top_speed(self) -> Array:
        """Greatest speed of every joint: (n,) [rad/s | mm/s]."""
        spans = [np.abs(_span(self.arm, move)) * move.peak for move in self.moves]
        return np.max(spans, axis=0) if spans else np.zeros(self.arm.n)

    @property
    def top_rate(self) -> Array:
        """Greatest rate of every motor: (motors,) [counts/s]."""
        rates = [np.abs(move.end - move.start) * move.peak for move in self.moves]
        return np.max(rates, axis=0) if rates else np.zeros(len(self.start))

    def trace(self, step: float = 0.01) -> Trace:
        """The path in time, sampled every `step` seconds, with the end of every move."""
        times, joints, begin = [np.zeros(1)], [joints_of(self.arm, self.start)[None]], 0.0
        for move in self.moves:
            seconds = move.cycles / self.clock
            t = np.append(np.arange(step, seconds - step / 4, step), seconds)
            done = progress(move, t * self.clock)
            times.append(begin + t)
            joints.append(joints_of(self.arm, move.start) + done[:, None] * _span(self.arm, move))
            begin += seconds
        q = np.concatenate(joints)
        position = frames(self.arm, q)[..., :3, 3]
        return Trace(np.concatenate(times), q, position)


@dataclass(frozen=True)
class Trace:
    """A plan sampled in time."""

    time: Array  # (T,) [s]
    joints: Array  # (T, n) [rad | mm]
    position: Array  # (T, n + 2, 3) [mm] base, every joint's frame, tool


def plan(
    arm: Arm,
    start: ArrayLike,
    targets: ArrayLike,
    *,
    speed: float = 1.0,
    clock: int = CLOCK,
    min_interval: int = MIN_INTERVAL,
) -> Plan:
    """Moves from counts through joint targets, stopping at each.

    start: (motors,) counts; targets: (n,) or (w, n) [rad | mm]; speed: fraction of each joint's max_speed.
    Raises NoSolutionError for a target outside the limits, UsageError if max_speed, max_accel or a drive
    is missing, or if the device cannot make steps that fast.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("robots/three_dof.yaml")
    >>> p = plan(arm, [0, 0, 0], np.deg2rad([-30, 5, -5]))
    >>> p.end.tolist(), round(p.duration, 2), np.rad2deg(p.top_speed).round().tolist()
    ([-1067, -10144, 5667], 1.98, [21.0, 60.0, 60.0])
    """
    check_rates(arm)
    if not 0 < speed <= 1:
        raise UsageError(f"speed {100 * speed:g} % is not possible; it goes from above 0 to 100 percent")
    at = np.asarray(start, dtype=np.int64)
    goals = np.atleast_2d(np.asarray(targets, dtype=float))
    check_limits(arm, goals)
    moves = []
    for goal in pulses(arm, goals):
        moves.append(_joint_move(arm, at, goal, speed, clock, min_interval))
        at = goal
    first = moves[0].start if moves else at
    return Plan(arm, first, tuple(moves), clock)


def motor_accel(arm: Arm) -> Array:
    """Greatest acceleration of every motor: (motors,) [counts/s^2].

    That of a motor which turns several joints suits the most delicate of them, whichever moves: so a hold,
    of which the board knows motors only, is within the joints' max_accel.
    """
    each = np.abs(arm.motor_gain) * arm.max_accel
    return np.asarray(np.where(each > 0, each, np.inf).min(axis=1))


def check_rates(arm: Arm) -> None:
    """Raise UsageError, naming the joint, if a max_speed or max_accel is missing."""
    for key, values in (("max_speed", arm.max_speed), ("max_accel", arm.max_accel)):
        for name, value in zip(arm.joint_names, values, strict=True):
            if math.isnan(value):
                where = f" in {arm.path}" if arm.path else ""
                raise UsageError(f"joint {name} has no {key}: motion needs one; add {key}: to it{where}")


def check_limits(arm: Arm, targets: Array) -> None:
    """Raise NoSolutionError, naming row and joint, if a target (w, n) is outside the joint limits.

    A straight line between two poses within the limits stays within them.
    """
    if targets.shape[-1] != arm.n:
        raise UsageError(f"{arm.name} has {arm.n} joints: expected {arm.n} values, got {targets.shape[-1]}")
    if not np.all(np.isfinite(targets)):
        raise UsageError("joint values must be finite to be sent")
    for row, joint in np.argwhere(outside(arm, targets)):
        which = f"waypoint {row + 1}: " if len(targets) > 1 else ""
        raise NoSolutionError(f"{which}{said(arm, joint, targets[row, joint])}: nothing was moved")


def _joint_move(arm: Arm, start: Counts, end: Counts, speed: float, clock: int, min_interval: int) -> Move:
    change = np.abs(joints_of(arm, end) - joints_of(arm, start))
    moving = change > 1e-12
    if not moving.any():
        return Move(start, end, (), 0, 0.0)
    top = float((arm.max_speed[moving] / change[moving]).min()) * speed
    accel = float((arm.max_accel[moving] / change[moving]).min())
    accel = min(accel, float((motor_accel(arm) / np.maximum(np.abs(end - start), 1)).min()))
    rates = np.abs(end - start) * min(top, math.sqrt(accel * EASE))
    if rates.max() > clock / min_interval:
        k = int(rates.argmax())
        joint = int(np.argmax(np.abs(arm.motor_gain[k]) * change))
        unit, word = (1.0, "mm/s") if arm.prismatic[joint] else (math.pi / 180, "deg/s")
        fast = change[joint] * rates[k] / abs(end - start)[k] / unit
        allowed = clock / min_interval
        raise UsageError(
            f"joint {arm.joint_names[joint]} at {fast:.4g} {word} needs {rates[k]:,.0f} counts/s of motor "
            f"{motor_names(arm)[k]}; the board makes {allowed:,.0f}\n"
            f"lower its max_speed, or send with --speed {math.floor(100 * speed * allowed / rates[k])}"
        )
    brakes = motor_accel(arm)
    return line(start.tolist(), end.tolist(), top, accel, brakes=brakes, clock=clock, min_interval=min_interval)


def _span(arm: Arm, move: Move) -> Array:
    """Change of every joint over a move: (n,)."""
    return joints_of(arm, move.end) - joints_of(arm, move.start)
