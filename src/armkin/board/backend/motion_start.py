"""Where a motion begins: at the counts that the board gave, whatever its kind.

Every trajectory that becomes counts passes through `check_start`, and every plan that a board is about to carry out
through `from_counts`. What a motion may not do as a whole is refused in `check_start`, too: before anything moves.
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
from armkin.motion.plan.trajectory_proof import check_free, free_way
from armkin.motion.timing.trajectory import Straight
from armkin.motors import joints, legal_with_same_pulses, pulses, resolution

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Trajectory

_SAMPLES = 256  # samples of a curve that begins outside the limits


class StartError(RuntimeError):
    """A plan does not begin where the arm stands: a bug in armkin, found before anything has moved."""


@dataclass(frozen=True)
class StartedTrajectory:
    """A trajectory that begins at counts `start` (motors,) of a board. Raises as `check_start` does."""

    trajectory: Trajectory
    start: NDArray[np.int64]

    def __post_init__(self) -> None:
        check_start(self.trajectory, self.start)


def check_start(trajectory: Trajectory, start: NDArray[np.int64]) -> None:
    """Raise if a trajectory may not be carried out from counts (motors,).

    StartError: it begins elsewhere. NoSolutionError, naming joint, value and limit: it begins outside the limits,
    and takes a joint farther out, or it is not proved free of keep-outs.
    """
    arm = trajectory.arm
    first = pulses(arm, trajectory.start)
    # Of more motors than joints the joints are a least squares fit, which may round to the next count.
    if np.abs(first - start).max(initial=0) > (len(arm.motor_gain) > arm.n):
        raise StartError(f"a plan that begins at {first.tolist()} counts was made for an arm at {list(start)}")
    check_free(trajectory)
    excess = excess_over_limits(arm, trajectory.start)
    if not excess.any():
        return
    for stretch in trajectory.stretches:
        times = [stretch.duration] if isinstance(stretch, Straight) else np.linspace(0.0, stretch.duration, _SAMPLES)
        reached = stretch.evaluate(np.asarray(times, dtype=float))
        farther = excess_over_limits(arm, reached).max(axis=0) > excess + SLACK
        if farther.any():
            raise _farther_out_error(arm, int(farther.argmax()), trajectory.start)


def jog_goal(arm: Arm, standing: Array, joint: int, change: float, *, refuse: bool) -> Array:
    """Where a joint may go from here, (n,), by a change: to its limit, and to two steps before what it would hit.

    refuse: raise NoSolutionError if something is hit at once.
    """
    goal, end = standing.copy(), (arm.upper if change > 0 else arm.lower)[joint]
    goal[joint] = np.clip(standing[joint] + change, *sorted((standing[joint], end)))
    free, why = free_way(arm, standing, goal)
    if why is None:
        return goal
    step = float(resolution(arm)[joint] / abs(goal[joint] - standing[joint]))
    if free <= 2 * step and refuse:
        raise why
    return np.asarray(standing + max(free - 2 * step, 0.0) * (goal - standing))


def check_jog(arm: Arm, q: Array, joint: int, rate: float) -> None:
    """Raise NoSolutionError if a joint that stands outside its limits, arm at q (n,), is to move farther out."""
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
    """How far joints are outside their limits: (..., n) [rad | mm]; 0 inside, and for half a step outside."""
    values = legal_with_same_pulses(arm, q)
    return np.abs(values - np.clip(values, arm.lower, arm.upper))


def is_believable(arm: Arm, counts: Sequence[int]) -> bool:
    """Whether an arm may stand at counts: no joint more than a turn (a slide: its travel) outside its limits."""
    return why_impossible(arm, counts) is None


def why_impossible(arm: Arm, counts: Sequence[int]) -> str | None:
    """Why an arm cannot stand at counts, in words; None: it can."""
    try:
        q = joints(arm, counts)
    except UsageError as error:  # motors of one joint contradict each other
        return error.message
    most = np.where(arm.prismatic, arm.upper - arm.lower, TURN)
    for k in np.flatnonzero(np.abs(q - np.clip(q, arm.lower, arm.upper)) > most + SLACK):
        far = "its travel" if arm.prismatic[k] else "a whole turn"
        return f"{outside_text(arm, int(k), float(q[k]))} by more than {far}"
    return None


def from_counts(
    plans: Iterable[Any], counts: Callable[[], Sequence[int]], *, tolerance: int | None = None
) -> Iterator[Any]:
    """Pass plans on that begin where the arm stands: the first at `counts()`, each other where the one before it ends.

    tolerance: [counts] of a kind that measures where it stands, and does so before each plan. None in between:
    nothing to do yet. Raises StartError for a plan that begins elsewhere.
    """
    standing: NDArray[np.int64] | None = None
    for plan in plans:
        if plan is not None:
            expected = np.asarray(counts() if standing is None or tolerance is not None else standing, dtype=np.int64)
            if np.abs(plan.start - expected).max(initial=0) > (tolerance or 0):
                raise StartError(
                    f"a plan begins at {plan.start.tolist()} counts, the arm stands at {expected.tolist()}"
                )
            standing = plan.end
            LOG.info("motion from %s to %s in %.3f s", plan.start.tolist(), plan.end.tolist(), plan.duration)
        yield plan
