"""The proof that a trajectory hits nothing, and the error for one that does."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from armkin.errors import NoSolutionError
from armkin.formula.arrays import Array
from armkin.keep_out.clearance import hits, whole_arm
from armkin.keep_out.motion_geometry import Cubics, JointMotion
from armkin.keep_out.motion_proof import Proof, prove_motion
from armkin.keep_out.motion_proof import hit_samples as find_hits
from armkin.model import units
from armkin.model.lock_joints import unlock
from armkin.motion.timing.curved_stretch import Curve
from armkin.motion.timing.limit_jerk import Smoothed
from armkin.motion.timing.profile import trapezoid
from armkin.motion.timing.trajectory import Straight, Stretch, Trajectory

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from armkin.keep_out.body_pairs import Guard
    from armkin.model.arm import Arm
    from armkin.motion.plan.path_plan import PathPlan


@dataclass(frozen=True)
class TrajectoryProof:
    """The result of a proof: the first hit of a trajectory, or its place of least clearance.

    mm: a lower bound of the clearance over the whole motion; stretch, cell: the place, as number of the stretch and
    position in its cells; joints: (n,) [rad | mm] there; body, keep_out: names of the pair, empty if there is none;
    escaping: pairs that were too near each other at the start; postures: how many were tested.
    """

    free: bool
    mm: float
    stretch: int
    cell: float
    joints: Array
    body: str
    keep_out: str
    escaping: tuple[tuple[str, str], ...]
    postures: int


class _SmoothedMotion:
    """A smoothed curve as the geometry of a motion, its cells as long as the grid intervals of the curve."""

    def __init__(self, smoothed_curve: Smoothed) -> None:
        self.smoothed, self.curve = smoothed_curve, smoothed_curve.curve
        self.inner = Cubics(_control_points(smoothed_curve.curve))
        self.step = float(np.median(np.diff(self.curve.times))) or smoothed_curve.duration
        self.cells = max(int(np.ceil(smoothed_curve.duration / self.step)), 1)

    @cached_property
    def _sums(self) -> Array:
        return self.inner._sums

    def joints_at(self, place: Array) -> Array:
        """Joint values at places along the way."""
        return self.smoothed.evaluate(self._time(place))

    def variation(self, begin: Array, end: Array) -> Array:
        """A bound of how far each joint of the moving average goes between two places.

        The speed of the average is the curve's travel within the window, divided by the window. Between two times it
        goes at most the share dt / window of the curve's travel from the first window's begin to the last one's end.
        """
        t0, t1 = self._time(begin), self._time(end)
        end_index = np.searchsorted(self.curve.times, t1, side="left")
        begin_index = np.searchsorted(self.curve.times, t0 - self.smoothed.window, side="right") - 1
        last = len(self.curve.times) - 1
        travel = self._sums[np.clip(end_index, 0, last)] - self._sums[np.clip(begin_index, 0, last)]
        return np.asarray(np.minimum((t1 - t0) / self.smoothed.window, 1.0)[:, None] * travel)

    def _time(self, place: Array) -> Array:
        return np.minimum(place / self.cells, 1.0) * self.smoothed.duration


def _control_points(stretch: Stretch) -> Array:
    """Control points (4, cells, n) of a straight line or a curve."""
    if isinstance(stretch, Curve):
        q, h = stretch.path.q, stretch.path.h[:, None]
        d = stretch.path.d
        return np.array([q[:-1], q[:-1] + h * d[:-1] / 3, q[1:] - h * d[1:] / 3, q[1:]])
    share = np.arange(4)[:, None, None] / 3
    return np.asarray(stretch.start + share * (stretch.end - stretch.start)).reshape(4, 1, -1)


def prove_trajectory(trajectory: Trajectory, *, tight: bool = False) -> TrajectoryProof | None:
    """Prove that a trajectory hits nothing; None for an arm without keep-outs.

    tight: see `prove_motion`; the bound is then that of the whole motion where it hits something, too. For an arm that
    ignores its keep-outs nothing is proved, and the bound alone is looked for.
    """
    arm = trajectory.arm
    full_arm, _ = whole_arm(arm, trajectory.start[None])
    if not full_arm.keep_out:
        return None
    from armkin.keep_out.body_pairs import guard

    bodies, parts = guard(full_arm), list[TrajectoryProof]()
    allowed: tuple[int, ...] | None = None
    escaping: tuple[int, ...] = ()
    postures = 0
    for first, geometry in _geometries(trajectory):
        may_hit = arm.ignores_keep_out or not all(part.free for part in parts)
        full_geometry = _UnlockedMotion(arm, geometry)
        proof = prove_motion(bodies, full_geometry, tight=tight, may_hit=may_hit, ignored_pairs=allowed)
        postures += proof.postures
        escaping = proof.escaping if allowed is None else escaping
        allowed = proof.escaping
        parts.append(_proof_on_trajectory(trajectory, bodies, first, proof, escaping, postures, geometry))
        if not proof.free and not tight:
            break
    if not parts:  # no stretch: the arm stays where it is
        return None
    nearest = min(parts, key=lambda part: part.mm)
    first_hit = next((part for part in parts if not part.free), nearest)
    return replace(first_hit, mm=nearest.mm, postures=postures)


def check_free(trajectory: Trajectory, place: str = "") -> None:
    """Raise NoSolutionError, naming body, obstacle and place, if a motion is not proved free of hits.

    Arms without keep-outs, and those that ignore them, are not tested.
    """
    if trajectory.arm.keep_out and not trajectory.arm.ignores_keep_out:
        proof = prove_trajectory(trajectory)
        if proof is not None and not proof.free:
            raise hit_refusal(trajectory, proof, place)


def prove_plan(plan: PathPlan) -> PathPlan:
    """A planned path with its clearance noted. Raises NoSolutionError, with the plan, if it is not proved free.

    Nor may its approach hit anything.
    """
    proof = prove_trajectory(plan.motion, tight=True)
    if proof is None:
        return plan
    s = float(plan.s(hit_time(plan.motion, proof)))
    least_clearance = proof.mm if np.isfinite(proof.mm) else None
    plan.clearance = {"mm": least_clearance, "s_mm": s, "body": proof.body, "with": proof.keep_out}
    if proof.free:
        if plan.approach is not None:
            check_free(plan.approach, " on the way to the path's start")
        return plan
    error = hit_refusal(plan.motion, proof, f" at {s:.3f} mm of the path", s_mm=s)
    error.plan = plan
    raise error


def hit_refusal(trajectory: Trajectory, hit: TrajectoryProof, place: str = "", **fields: object) -> NoSolutionError:
    """The error of a motion that hits something; place: words for where on a path."""
    arm = trajectory.arm
    values = units.joints_out(arm, hit.joints).tolist()
    joints_text = ", ".join(f"{name} = {value:.4g}" for name, value in zip(arm.joint_names, values, strict=True))
    escapes = (hit.body, hit.keep_out) in hit.escaping
    way_text = f" on the way to waypoint {hit.stretch + 1}" if len(trajectory.stretches) > 1 and not place else ""
    verb = "would go deeper into" if escapes else "would hit"
    details = {"body": hit.body, "with": hit.keep_out, "joints": values, **fields}
    return NoSolutionError(
        f"{hit.body} {verb} {hit.keep_out}{place or way_text}, at {joints_text}: nothing was moved", **details
    )


def free_way(arm: Arm, q: Array, goal: Array) -> tuple[float, NoSolutionError | None]:
    """The fraction, 0 to 1, of a joint line from q to goal, (n,), that is proved free, and the error behind it."""
    if not arm.keep_out or arm.ignores_keep_out or np.array_equal(q, goal):
        return 1.0, None
    trajectory = Trajectory(arm, q, (Straight(q, goal, trapezoid(1.0, 1.0, 1.0)),))
    proof = prove_trajectory(trajectory)
    if proof is None or proof.free:
        return 1.0, None
    return proof.cell, hit_refusal(trajectory, proof)


def hit_samples(arm: Arm, q: Array) -> NDArray[np.bool_] | None:
    """Which of neighbouring postures (N, n) hit something; None for an arm without keep-outs or that ignores them."""
    if not arm.keep_out or arm.ignores_keep_out:
        return None
    from armkin.keep_out.body_pairs import guard

    full_arm, full = whole_arm(arm, q)
    return find_hits(guard(full_arm), full)


def hit_text(arm: Arm, q: Array) -> str:
    """What a posture (n,) hits: ``q3 hits table``."""
    [(_, pairs)] = hits(arm, q[None])
    return f"{pairs[0]['body']} hits {pairs[0]['with']}" if pairs else "the arm hits something"


@dataclass(frozen=True)
class _UnlockedMotion:
    """The geometry of a motion in the joints of the whole arm, with the held ones at rest."""

    arm: Arm
    motion: JointMotion

    @property
    def cells(self) -> int:
        """How many cells the way has."""
        return self.motion.cells

    def joints_at(self, place: Array) -> Array:
        """Joint values at places along the way."""
        return whole_arm(self.arm, self.motion.joints_at(place))[1]

    def variation(self, begin: Array, end: Array) -> Array:
        """How far each joint of the whole arm goes between two places."""
        arm, travel = self.arm, self.motion.variation(begin, end)
        while arm.whole is not None:
            arm, held = arm.whole
            travel = unlock(arm, dict.fromkeys(held, 0.0), travel)
        return travel


def _geometries(trajectory: Trajectory) -> list[tuple[int, JointMotion]]:
    """The geometry of the stretches, consecutive cubics as one; each with the number of its first stretch."""
    geometries: list[tuple[int, JointMotion]] = []
    numbered = enumerate(trajectory.stretches)
    for is_smoothed, group in groupby(numbered, key=lambda item: isinstance(item[1], Smoothed)):
        part = list(group)
        if is_smoothed:
            geometries += [
                (number, _SmoothedMotion(stretch)) for number, stretch in part if isinstance(stretch, Smoothed)
            ]
        else:
            geometries.append(
                (part[0][0], Cubics(np.concatenate([_control_points(stretch) for _, stretch in part], axis=1)))
            )
    return geometries


def _proof_on_trajectory(
    trajectory: Trajectory,
    guard: Guard,
    first: int,
    proof: Proof,
    escaping: tuple[int, ...],
    postures: int,
    motion: JointMotion,
) -> TrajectoryProof:
    """Convert a proof of a part to stretches, joint values and names of the trajectory."""
    stretch, cell = first, proof.place
    if isinstance(motion, Cubics):
        sizes = [_cell_count(later_stretch) for later_stretch in trajectory.stretches[first:]]
        while cell >= sizes[stretch - first] and stretch + 1 < len(trajectory.stretches):
            if not isinstance(trajectory.stretches[stretch + 1], Straight | Curve):
                break
            cell -= sizes[stretch - first]
            stretch += 1
    body, keep_out = ("", "") if proof.pair is None else guard.pair_names(proof.pair)
    joints = motion.joints_at(np.array([proof.place]))[0]
    pairs = tuple(guard.pair_names(k) for k in escaping)
    return TrajectoryProof(
        free=proof.free,
        mm=proof.mm,
        stretch=stretch,
        cell=cell,
        joints=joints,
        body=body,
        keep_out=keep_out,
        escaping=pairs,
        postures=postures,
    )


def _cell_count(stretch: Stretch) -> int:
    return len(stretch.path.h) if isinstance(stretch, Curve) else 1


def hit_time(trajectory: Trajectory, hit: TrajectoryProof) -> float:
    """When, after the beginning, a trajectory is at the place that a proof has found [s]."""
    stretch = trajectory.stretches[hit.stretch]
    begin = float(trajectory.begins[hit.stretch])
    if isinstance(stretch, Smoothed):
        return begin + min(hit.cell / _SmoothedMotion(stretch).cells, 1.0) * stretch.duration
    if isinstance(stretch, Curve):
        times = stretch.times
        i = min(int(hit.cell), len(times) - 2)
        return begin + float(times[i] + (hit.cell - i) * (times[i + 1] - times[i]))
    return begin + _time_of_share(stretch, hit.cell)


def _time_of_share(stretch: Stretch, share: float) -> float:
    """The time at which a straight line has covered a share of its length, by bisection."""
    low, high = 0.0, stretch.duration
    change = stretch.end - stretch.start
    joint = int(np.argmax(np.abs(change)))
    if change[joint] == 0.0:
        return 0.0
    for _ in range(50):
        middle = (low + high) / 2
        covered_share = float((stretch.evaluate(np.array([middle]))[0, joint] - stretch.start[joint]) / change[joint])
        low, high = (middle, high) if covered_share < share else (low, middle)
    return low
