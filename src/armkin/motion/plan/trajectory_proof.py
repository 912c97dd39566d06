"""Motions that hit nothing: a trajectory's geometry, the proof that it is free, and why it is not."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from armkin.errors import NoSolutionError
from armkin.formula.arrays import Array
from armkin.keep_out.clearance import hits, whole_arm
from armkin.keep_out.motion_geometry import Cubics, Way
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
    """What a proof has found of a trajectory.

    proof: of the part with the first hit, or with the least clearance; stretch: its number there, share: how far into
    that stretch's cells; joints: (n,) [rad | mm] there; body, keep_out: names of the pair, empty where nothing counts;
    escaping: pairs that were too near at the start.
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


class _SmoothedWay:
    """A smoothed curve as a way in time, one cell a grid interval of the curve."""

    def __init__(self, smoothed: Smoothed) -> None:
        self.smoothed, self.curve = smoothed, smoothed.curve
        self.inner = Cubics(_control_points(smoothed.curve))
        self.step = float(np.median(np.diff(self.curve.times))) or smoothed.duration
        self.cells = max(int(np.ceil(smoothed.duration / self.step)), 1)

    @cached_property
    def _sums(self) -> Array:
        return self.inner._sums

    def joints_at(self, place: Array) -> Array:
        """Joint values at places along the way."""
        return self.smoothed.evaluate(self._time(place))

    def variation(self, begin: Array, end: Array) -> Array:
        """The mean over a window goes no farther than the curve does within the windows that it sees.

        Its speed is what the curve moves within the window, by the window; so between two times it goes at most
        the share dt / window of the curve's way from the earlier window's begin to the later one's end.
        """
        t0, t1 = self._time(begin), self._time(end)
        after = np.searchsorted(self.curve.times, t1, side="left")
        before = np.searchsorted(self.curve.times, t0 - self.smoothed.window, side="right") - 1
        last = len(self.curve.times) - 1
        way = self._sums[np.clip(after, 0, last)] - self._sums[np.clip(before, 0, last)]
        return np.asarray(np.minimum((t1 - t0) / self.smoothed.window, 1.0)[:, None] * way)

    def _time(self, place: Array) -> Array:
        return np.minimum(place / self.cells, 1.0) * self.smoothed.duration


def _control_points(stretch: Stretch) -> Array:
    """Control points (4, cells, n) of a stretch that is no mean."""
    if isinstance(stretch, Curve):
        q, h = stretch.path.q, stretch.path.h[:, None]
        d = stretch.path.d
        return np.array([q[:-1], q[:-1] + h * d[:-1] / 3, q[1:] - h * d[1:] / 3, q[1:]])
    share = np.arange(4)[:, None, None] / 3
    return np.asarray(stretch.start + share * (stretch.end - stretch.start)).reshape(4, 1, -1)


def prove_trajectory(trajectory: Trajectory, *, tight: bool = False) -> TrajectoryProof | None:
    """What a proof finds of a trajectory; None for an arm without keep-outs. tight: see `prove_motion`."""
    arm = trajectory.arm
    full_arm, _ = whole_arm(arm, trajectory.start[None])
    if not full_arm.keep_out:
        return None
    from armkin.keep_out.body_pairs import guard

    bodies, postures = guard(full_arm), 0
    allowed, nearest = None, None
    escaping: tuple[int, ...] = ()
    for first, way in _geometries(trajectory):
        full_way = _UnlockedWay(arm, way)
        proof = prove_motion(bodies, full_way, tight=tight, ignored_pairs=allowed)
        postures += proof.postures
        if allowed is None:
            escaping = proof.escaping
        allowed = proof.escaping
        found_proof = _proof_on_trajectory(trajectory, bodies, first, proof, escaping, postures, way)
        if not proof.free:
            return found_proof
        if nearest is None or found_proof.mm < nearest.mm:
            nearest = found_proof
    if nearest is None:  # no stretch: the arm stays where it is
        return None
    return TrajectoryProof(**{**vars(nearest), "postures": postures})


def check_free(trajectory: Trajectory, place: str = "") -> None:
    """Raise NoSolutionError, naming body, obstacle and place, if a motion is not proved free of what it must not touch.

    Costs nothing for an arm without keep-outs, or one that ignores them.
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
    mm = proof.mm if np.isfinite(proof.mm) else None
    plan.clearance = {"mm": mm, "s_mm": s, "body": proof.body, "with": proof.keep_out}
    if proof.free or plan.arm.ignores_keep_out:
        if plan.approach is not None:
            check_free(plan.approach, " on the way to the path's start")
        return plan
    error = hit_refusal(plan.motion, proof, f" at {s:.3f} mm of the path", s_mm=s)
    error.plan = plan
    raise error


def hit_refusal(trajectory: Trajectory, hit: TrajectoryProof, place: str = "", **fields: object) -> NoSolutionError:
    """Why a motion is refused; place: where on a path."""
    arm = trajectory.arm
    values = units.joints_out(arm, hit.joints).tolist()
    joints_text = ", ".join(f"{name} = {value:.4g}" for name, value in zip(arm.joint_names, values, strict=True))
    stands = (hit.body, hit.keep_out) in hit.escaping
    way_text = f" on the way to waypoint {hit.stretch + 1}" if len(trajectory.stretches) > 1 and not place else ""
    verb = "would go deeper into" if stands else "would hit"
    details = {"body": hit.body, "with": hit.keep_out, "joints": values, **fields}
    return NoSolutionError(
        f"{hit.body} {verb} {hit.keep_out}{place or way_text}, at {joints_text}: nothing was moved", **details
    )


def free_way(arm: Arm, q: Array, goal: Array) -> tuple[float, NoSolutionError | None]:
    """How far a straight line in joint space from q to goal, (n,), is proved free, 0 to 1; and why no farther."""
    if not arm.keep_out or arm.ignores_keep_out or np.array_equal(q, goal):
        return 1.0, None
    way = Trajectory(arm, q, (Straight(q, goal, trapezoid(1.0, 1.0, 1.0)),))
    proof = prove_trajectory(way)
    if proof is None or proof.free:
        return 1.0, None
    return proof.cell, hit_refusal(way, proof)


def hit_samples(arm: Arm, q: Array) -> NDArray[np.bool_] | None:
    """Which of neighbouring postures (N, n) hit something; None for an arm that need not look."""
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
class _UnlockedWay:
    """The way of the whole arm, where joints are held."""

    arm: Arm
    way: Way

    @property
    def cells(self) -> int:
        """How many cells the way has."""
        return self.way.cells

    def joints_at(self, place: Array) -> Array:
        """Joint values at places along the way."""
        return whole_arm(self.arm, self.way.joints_at(place))[1]

    def variation(self, begin: Array, end: Array) -> Array:
        """How far each joint of the whole arm goes between two places."""
        arm, way = self.arm, self.way.variation(begin, end)
        while arm.whole is not None:
            arm, held = arm.whole
            way = unlock(arm, dict.fromkeys(held, 0.0), way)
        return way


def _geometries(trajectory: Trajectory) -> list[tuple[int, Way]]:
    """The stretches' geometry, those that are cubics together; and the number of the first stretch of each."""
    geometries: list[tuple[int, Way]] = []
    numbered = enumerate(trajectory.stretches)
    for smooth, group in groupby(numbered, key=lambda item: isinstance(item[1], Smoothed)):
        part = list(group)
        if smooth:
            geometries += [(k, _SmoothedWay(stretch)) for k, stretch in part if isinstance(stretch, Smoothed)]
        else:
            geometries.append(
                (part[0][0], Cubics(np.concatenate([_control_points(stretch) for _, stretch in part], axis=1)))
            )
    return geometries


def _proof_on_trajectory(
    trajectory: Trajectory, held: Guard, first: int, proof: Proof, escaping: tuple[int, ...], postures: int, way: Way
) -> TrajectoryProof:
    """A proof in the terms of the trajectory."""
    stretch, cell = first, proof.place
    if isinstance(way, Cubics):
        sizes = [_cell_count(later) for later in trajectory.stretches[first:]]
        while cell >= sizes[stretch - first] and stretch + 1 < len(trajectory.stretches):
            if not isinstance(trajectory.stretches[stretch + 1], Straight | Curve):
                break
            cell -= sizes[stretch - first]
            stretch += 1
    body, keep_out = ("", "") if proof.pair is None else held.pair_names(proof.pair)
    joints = way.joints_at(np.array([proof.place]))[0]
    pairs = tuple(held.pair_names(k) for k in escaping)
    return TrajectoryProof(proof.free, proof.mm, stretch, cell, joints, body, keep_out, pairs, postures)


def _cell_count(stretch: Stretch) -> int:
    return len(stretch.path.h) if isinstance(stretch, Curve) else 1


def hit_time(trajectory: Trajectory, hit: TrajectoryProof) -> float:
    """When, after the beginning, a trajectory is at the place that a proof has found [s]."""
    stretch = trajectory.stretches[hit.stretch]
    begin = float(trajectory.begins[hit.stretch])
    if isinstance(stretch, Smoothed):
        return begin + min(hit.cell / _SmoothedWay(stretch).cells, 1.0) * stretch.duration
    if isinstance(stretch, Curve):
        times = stretch.times
        i = min(int(hit.cell), len(times) - 2)
        return begin + float(times[i] + (hit.cell - i) * (times[i + 1] - times[i]))
    return begin + _time_of_share(stretch, hit.cell)


def _time_of_share(stretch: Stretch, share: float) -> float:
    """When a straight line has gone so far: its law never goes back."""
    low, high = 0.0, stretch.duration
    way = stretch.end - stretch.start
    j = int(np.argmax(np.abs(way)))
    if way[j] == 0.0:
        return 0.0
    for _ in range(50):
        middle = (low + high) / 2
        gone = float((stretch.evaluate(np.array([middle]))[0, j] - stretch.start[j]) / way[j])
        low, high = (middle, high) if gone < share else (low, middle)
    return low
