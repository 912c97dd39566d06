"""Checks that a motion begins at the counts that its board reports, for every kind of board.

Every trajectory that becomes counts passes through `check_start`, and every plan that a board is about to carry out
through `from_counts`. `check_start` also refuses motions that hit something or leave the limits, before the arm moves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.board.ports import LOG
from armkin.errors import NoSolutionError, UsageError
from armkin.model.limits import SLACK, limit_fields, outside_text
from armkin.model.units import TURN
from armkin.motion.joint_moves import straight_move
from armkin.motion.plan.trajectory_proof import check_free, free_way
from armkin.motion.timing.trajectory import Straight, Trajectory
from armkin.motors import joints, legal_with_same_pulses, pulses, resolution

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm

_SAMPLES = 256  # samples of a curve that are tested if it begins outside the limits


class StartError(RuntimeError):
    """A plan does not begin at the arm's position: a bug in armkin, found before the arm has moved."""


@dataclass(frozen=True)
class StartedTrajectory:
    """A trajectory that begins at counts `start` (motors,) of a board. Raises as `check_start` does."""

    trajectory: Trajectory
    start: NDArray[np.int64]

    def __post_init__(self) -> None:
        check_start(self.trajectory, self.start)


def check_start(trajectory: Trajectory, start: NDArray[np.int64]) -> None:
    """Raise if a trajectory may not be carried out from counts (motors,).

    Raises StartError if it begins elsewhere; NoSolutionError, naming joint, value and limit, if it begins outside the
    limits and takes a joint farther out, or if it is not proved free of keep-outs.
    """
    arm = trajectory.arm
    first_counts = pulses(arm, trajectory.start)
    # With more motors than joints, joint values are a least-squares fit, which may round to the next count.
    if np.abs(first_counts - start).max(initial=0) > (len(arm.motor_gain) > arm.n):
        raise StartError(f"a plan that begins at {first_counts.tolist()} counts was made for an arm at {list(start)}")
    check_free(trajectory)
    excess = excess_over_limits(arm, trajectory.start)
    if not excess.any():
        return
    for stretch in trajectory.stretches:
        times = [stretch.duration] if isinstance(stretch, Straight) else np.linspace(0.0, stretch.duration, _SAMPLES)
        q = stretch.evaluate(np.asarray(times, dtype=float))
        goes_farther = excess_over_limits(arm, q).max(axis=0) > excess + SLACK
        if goes_farther.any():
            raise _farther_out_error(arm, int(goes_farther.argmax()), trajectory.start)


def jog_motion(arm: Arm, start: Array, joint: int, rate: float, seconds: float, *, refuse: bool = False) -> Trajectory:
    """The motion of a jog of one joint [rad/s | mm/s] from joint values (n,), stopped at its limit and before a hit.

    It lasts no time where the joint stands at its limit. refuse: raise NoSolutionError if it cannot move at all before
    a hit.
    """
    goal = _jog_goal(arm, legal_with_same_pulses(arm, start), joint, rate * seconds, refuse=refuse)
    move = straight_move(arm, start, goal, min(float(abs(rate) / arm.max_speed[joint]), 1.0))
    return Trajectory(arm, start, (move,))


def _jog_goal(arm: Arm, present: Array, joint: int, change: float, *, refuse: bool) -> Array:
    """The joint values (n,) after a change of one joint, stopped at its limit and two steps before a hit.

    refuse: raise NoSolutionError if the joint cannot move at all before a hit.
    """
    goal, end = present.copy(), (arm.upper if change > 0 else arm.lower)[joint]
    goal[joint] = np.clip(present[joint] + change, *sorted((present[joint], end)))
    free_share, hit_error = free_way(arm, present, goal)
    if hit_error is None:
        return goal
    step = float(resolution(arm)[joint] / abs(goal[joint] - present[joint]))
    if free_share <= 2 * step and refuse:
        raise hit_error
    return np.asarray(present + max(free_share - 2 * step, 0.0) * (goal - present))


def check_jog(arm: Arm, q: Array, joint: int, rate: float) -> None:
    """Raise NoSolutionError if a joint of an arm at q (n,) is outside its limits and would move farther out."""
    if excess_over_limits(arm, q)[joint] > 0 and (q[joint] > arm.upper[joint]) == (rate > 0):
        raise _farther_out_error(arm, joint, q)


def _farther_out_error(arm: Arm, joint: int, q: Array) -> NoSolutionError:
    value = float(q[joint])
    return NoSolutionError(
        f"{outside_text(arm, joint, value)}, where the arm stands, and this takes it farther out: nothing was moved",
        advice=f"move {arm.joint_names[joint]} inside its limits first",
        **limit_fields(arm, joint, value),
    )


def excess_over_limits(arm: Arm, q: Array) -> Array:
    """How far joints are outside their limits: (..., n) [rad | mm]; half a step outside still counts as 0."""
    values = legal_with_same_pulses(arm, q)
    return np.abs(values - np.clip(values, arm.lower, arm.upper))


def why_impossible(arm: Arm, counts: Sequence[int]) -> str | None:
    """Why an arm cannot stand at counts, in words; None: it can."""
    try:
        q = joints(arm, counts)
    except UsageError as error:  # motors of one joint contradict each other
        return error.message
    max_excess = np.where(arm.prismatic, arm.upper - arm.lower, TURN)
    for joint in np.flatnonzero(np.abs(q - np.clip(q, arm.lower, arm.upper)) > max_excess + SLACK):
        distance = "its travel" if arm.prismatic[joint] else "a whole turn"
        return f"{outside_text(arm, int(joint), float(q[joint]))} by more than {distance}"
    return None


def from_counts(
    plans: Iterable[Any], counts: Callable[[], Sequence[int]], *, tolerance: int | None = None
) -> Iterator[Any]:
    """Pass plans on, checking that the first begins at `counts()` and each other one at the end of the one before.

    tolerance: [counts] for kinds that measure their position, which is then read before each plan. A None among the
    plans is passed on. Raises StartError for a plan that begins elsewhere.
    """
    last: NDArray[np.int64] | None = None
    for plan in plans:
        if plan is not None:
            expected = np.asarray(counts() if last is None or tolerance is not None else last, dtype=np.int64)
            if np.abs(plan.start - expected).max(initial=0) > (tolerance or 0):
                raise StartError(
                    f"a plan begins at {plan.start.tolist()} counts, the arm stands at {expected.tolist()}"
                )
            last = plan.end
            LOG.info("motion from %s to %s in %.3f s", plan.start.tolist(), plan.end.tolist(), plan.duration)
        yield plan
