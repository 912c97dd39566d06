"""What people ask: round postures, singular surfaces, rounded targets; and whether the answers are true.

A posture asked for must come back as a branch, or lie on a self-motion that the answer reports. All judgements
are made with the oracle's screws, never with armkin's own chain.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import oracle
from numpy.typing import NDArray
from oracle import Goal, Screws

import armkin
from armkin import Status
from armkin.inverse.answers.rounding import last_place, last_place_of_position
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.model.arm import Arm
from armkin.model.rotation import rpy

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]

SOLVES = 1e-9  # residual in lengths of the arm's reach and in rad that makes a posture a solution
CLOSE = 0.2  # [rad, sizes] branches this close may be one
PARTS = np.arange(1, 180) / 180.0  # of a way from one to the other: what parts two manifolds may be 3 degrees wide


# ---- postures ----------------------------------------------------------------------------------------------


def round_postures(arm: Arm, step: float, most: int, seed: int = 0) -> Array:
    """Joint values that are multiples of step [deg]; slides anywhere within their limits, or up to half a reach."""
    rng = np.random.default_rng([seed, int(step)])
    turns = round(360 / step)
    total = turns**arm.n
    pick = rng.choice(total, most, replace=False) if total > most else np.arange(total)
    index = np.stack(np.unravel_index(pick, [turns] * arm.n), axis=1) - turns // 2 + 1
    low, high = np.maximum(arm.lower, -arm.reach / 2), np.minimum(arm.upper, arm.reach / 2)
    return np.where(arm.prismatic, rng.uniform(low, high, index.shape), np.radians(index * step))


def singular_postures(arm: Arm, screw: Screws, task: str | None, count: int, seed: int = 0) -> dict[str, Array]:
    """Postures on the arm's singular surfaces, by the joint that leads there from a random posture.

    A joint at a multiple of 90 degrees where the Jacobian has no full rank whatever the others are; and the
    zeros and minima of its smallest singular value along each joint.
    """
    rng = np.random.default_rng(seed)
    definition, _ = solver(arm, task)

    anything = oracle.goal_of_joints(
        definition, screw, np.zeros((1, arm.n))
    )  # what a Jacobian sees is the task's alone

    def weak(q: Array) -> Array:
        return oracle.weakness(screw, anything, q)

    def anywhere(k: int) -> Array:
        q = rng.uniform(-np.pi, np.pi, (k, arm.n))
        return np.where(arm.prismatic, q / np.pi * arm.reach / 2, q)

    postures: dict[str, Array] = {}
    valleys: list[tuple[int, Array, Array]] = []  # joint, postures, how far a minimum is along it
    for joint in np.flatnonzero(~arm.prismatic).tolist():
        values = np.array([0.0, 90.0, 180.0, -90.0])
        q = anywhere(4 * count).reshape(4, count, arm.n)
        q[:, :, joint] = np.radians(values)[:, None]
        on_surface = weak(q[:, :20].reshape(-1, arm.n)).reshape(4, -1).max(axis=1) < 1e-12
        postures |= {f"{arm.joint_names[joint]} = {value:g}": q[k] for k, value in enumerate(values) if on_surface[k]}
        # from random postures on to the nearest minimum of the smallest singular value along this joint
        q1 = anywhere(3 * count)
        line = np.linspace(-0.3, 0.3, 13)
        grid = np.repeat(q1[:, None], len(line), axis=1)
        grid[:, :, joint] += line
        size = weak(grid.reshape(-1, arm.n)).reshape(len(q1), -1)
        k = size.argmin(axis=1)
        inside = (k > 0) & (k < len(line) - 1) & (size.min(axis=1) < 0.5 * size.max(axis=1))
        valleys.append((joint, q1[inside], line[k[inside]]))
    if not valleys:
        return postures
    q, centre = (np.concatenate([valley[part] for valley in valleys]) for part in (1, 2))
    along = np.eye(arm.n)[np.repeat([joint for joint, *_ in valleys], [len(rows) for _, rows, _ in valleys])]
    low, high = centre - 0.05, centre + 0.05
    for _ in range(60):  # golden section, of all at once; the minimum of |x| is found to rounding
        a, b = high - 0.618034 * (high - low), low + 0.618034 * (high - low)
        sizes = weak(np.concatenate([q + a[:, None] * along, q + b[:, None] * along]))
        left = sizes[: len(q)] < sizes[len(q) :]
        low, high = np.where(left, low, a), np.where(left, b, high)
    q = q + 0.5 * (low + high)[:, None] * along
    on_surface = weak(q) < 1e-7
    for joint, *_ in valleys:
        mine = on_surface & (along[:, joint] > 0)
        if mine.sum() >= 5:
            postures[f"{arm.joint_names[joint]} moved"] = q[mine][:count]
    return postures


# ---- targets -----------------------------------------------------------------------------------------------


def round_numbers(values: Array, digits: float) -> Array:
    """Numbers as printed with that many significant digits; 7.5 of them stand for float32."""
    if digits == 7.5:
        return np.asarray(values, dtype=np.float32).astype(float)
    text = [f"{v:.{int(digits)}g}" for v in np.ravel(values)]
    return np.array([float(t) for t in text]).reshape(np.shape(values))


def typed_targets(task: Any, target: Array, digits: float) -> Array:
    """Targets as typed with that many digits: angles in degrees, orientations as roll, pitch, yaw."""
    if task.orientation == "full":
        angles = round_numbers(np.degrees(rpy(target[:, :3, :3])), digits)
        typed_poses = np.zeros_like(target)
        typed_poses[:, 3, 3] = 1.0
        typed_poses[:, :3, 3] = round_numbers(target[:, :3, 3], digits)
        for k, (roll, pitch, yaw) in enumerate(angles):
            R = oracle.rotation("z", yaw) @ oracle.rotation("y", pitch) @ oracle.rotation("x", roll)
            typed_poses[k, :3, :3] = R[:3, :3]
        return typed_poses
    unit = np.ones(target.shape[1])
    last = task.position + len(task.sums)
    unit[task.position : last] = 180 / np.pi
    return round_numbers(target * unit, digits) / unit


def printed_matrices(target: Array, digits: float) -> Array:
    """Matrices (N, 4, 4) whose entries were printed with that many decimals, or went through float32 (7.5)."""
    return np.asarray(target, dtype=np.float32).astype(float) if digits == 7.5 else np.round(target, int(digits))


def goal_of(task: Any, target: Array) -> Goal:
    """Targets as the oracle's constraints."""
    T = np.tile(np.eye(4), (len(target), 1, 1))
    sums = np.zeros((len(target), len(task.sums)))
    if task.orientation == "full":
        U, _, Vt = np.linalg.svd(target[:, :3, :3])
        T = target.copy()
        T[:, :3, :3] = U @ Vt
    else:
        T[:, : task.position, 3] = target[:, : task.position]
        sums = target[:, task.position : task.position + len(task.sums)]
    if task.orientation == "axis":
        z = target[:, 3:] / np.linalg.norm(target[:, 3:], axis=1, keepdims=True)
        x = np.cross(z, np.eye(3)[np.abs(z).argmin(axis=1)])
        x /= np.linalg.norm(x, axis=1, keepdims=True)
        T[:, :3, :3] = np.stack([x, np.cross(z, x), z], axis=2)
    return Goal(task.position, task.sums, task.offsets, task.orientation, T, sums)


# ---- judgement ---------------------------------------------------------------------------------------------


@dataclass
class Verdict:
    """Rows of targets whose answers are wrong, by what is wrong with them."""

    count: int
    solutions: Any
    unreachable: list[int] = field(default_factory=list)  # called so though a posture solves it
    lost: list[int] = field(default_factory=list)  # the posture asked for is no branch and on no reported self-motion
    false: list[int] = field(default_factory=list)  # a branch that misses the target
    twice: list[int] = field(default_factory=list)  # two branches, and what lies between them solves the target
    moves: list[int] = field(default_factory=list)  # `near` solves the target, and the best branch is another one
    missed: list[tuple[int, Array]] = field(default_factory=list)  # the oracle's isolated branch, complete claimed

    def __bool__(self) -> bool:
        return not (self.unreachable or self.lost or self.false or self.twice or self.moves or self.missed)

    def __str__(self) -> str:
        kinds = ("unreachable", "lost", "false", "twice", "moves", "missed")
        parts = [f"{len(getattr(self, k))} {k} (first: {getattr(self, k)[0]})" for k in kinds if getattr(self, k)]
        s = self.solutions
        share = f"complete {s.complete.mean():.3f}, singular {(s.status == Status.SINGULAR).mean():.3f}"
        return f"{self.count} targets: {'; '.join(parts) or 'all true'}; {share}"


def miss_of(arm: Arm, screw: Screws, goals: Goal, q: Array) -> Array:
    """What joint values (M, n) miss, lengths in the arm's reach: (M,)."""
    mm, rad = oracle.pose_error(screw, goals, q)
    # of a whole orientation that is the norm of nine entries, the angle times the root of two
    return np.hypot(mm / arm.reach, rad / (np.sqrt(2) if goals.orientation == "full" else 1.0))


def judge(arm: Arm, screw: Screws, task: str | None, q: Array, target: Array, near: Array | None = None) -> Verdict:
    """Solve targets (N, ..) near the postures q (N, n) that they were made from, perhaps rounded."""
    definition, _ = solver(arm, task)
    s = armkin.ik(arm, target, task) if near is None else armkin.ik(arm, target, task, near=near)
    goals = goal_of(definition, target)
    # what the posture asked for becomes at the rounded target: itself if it solves it, else where Newton leads it
    reached, expected = miss_of(arm, screw, goals, q) < 0.5 * SOLVES, q.copy()
    led = np.flatnonzero(~reached)
    expected[led], left = oracle.newton(screw, goals.take(led), q[led], 60)
    reached[led] = left < 1e-12
    verdict = Verdict(len(q), s)
    none = ~s.valid.any(axis=1)
    verdict.unreachable = np.flatnonzero(reached & (none | (s.status == Status.UNREACHABLE))).tolist()
    rows, columns = np.nonzero(s.valid)
    miss = np.zeros(s.valid.shape)
    miss[rows, columns] = miss_of(arm, screw, goals.take(rows), s.q[rows, columns])
    # of a rounded pose `near` itself may miss by what is rounded: docs/solution.md, "Rounded targets"
    stands = np.zeros(s.valid.shape, bool)
    if near is not None and definition.orientation == "full":
        shown = np.maximum(4.0 * s.rounding, 12.0 * last_place(target[:, :3, :3]))
        R = target[:, :3, :3]
        right = (np.abs(R - np.rint(R)) <= 1e-14).all(axis=(1, 2))
        hidden = np.where(right, last_place_of_position(target[:, :3, 3]) / arm.reach, 0.0)
        allowed = SOLVES + np.maximum(shown, hidden)
        stands = (s.q == np.broadcast_to(near, q.shape)[:, None]).all(axis=2) & (miss <= allowed[:, None])
    verdict.false = np.flatnonzero((~stands & (miss > 1.1 * SOLVES)).any(axis=1)).tolist()
    unit = np.where(screw.prismatic, 1 / screw.size, 1.0)

    def apart(a: Array, b: Array) -> Array:
        d = a - b
        return np.abs(np.where(screw.prismatic, d, d - 2 * np.pi * np.rint(d / (2 * np.pi)))) * unit

    d = apart(s.q, expected[:, None])
    distance = np.nan_to_num(d.max(axis=2), nan=np.inf).min(axis=1, initial=np.inf)
    weak = oracle.weakness(screw, goals, expected)
    # as far as a posture is determined: its residual over the smallest singular value, or the root of it at a fold
    is_listed = distance < 1e-6 + np.minimum(1e-9 / np.maximum(weak, 1e-300), 1e-3)
    held = np.nan_to_num(np.where(s.free[:, None], 0.0, d).max(axis=2), nan=np.inf)
    on_curve = (s.status == Status.SINGULAR) & (np.where(s.valid, held, np.inf).min(axis=1, initial=np.inf) < 1e-4)
    k = np.flatnonzero(reached & ~none & ~is_listed & ~on_curve & ~stands.any(axis=1))
    if len(k):
        # one with a branch further away, if the postures between them solve the target, too
        b = np.nan_to_num(d[k].max(axis=2), nan=np.inf).argmin(axis=1)
        # a longer valley is a self-motion, which the answer has to report
        long = (d[k, b].max(axis=1) > CLOSE) & (s.status[k] != Status.SINGULAR)
        verdict.lost = k[long | ~_in_one_component(arm, screw, goals.take(k), expected[k], s.q[k, b])].tolist()
    pairs = [np.zeros((4, 0), int)]
    for i in range(s.q.shape[1]):
        for j in range(i):
            both_valid = s.valid[:, i] & s.valid[:, j]
            with np.errstate(invalid="ignore"):
                difference = apart(s.q[:, i], s.q[:, j])
                # on one self-motion, perhaps: what it holds is alike
                alike = (s.status == Status.SINGULAR) & (np.where(s.free, 0.0, difference).max(axis=1) < 1e-4)
                k = np.flatnonzero(both_valid & (alike | (difference.max(axis=1) < CLOSE)))
            pairs.append(np.stack([k, np.full_like(k, i), np.full_like(k, j), alike[k]]))
    k, i, j, alike = np.concatenate(pairs, axis=1)
    if len(k):
        a, b = s.q[k, i], s.q[k, j]
        close, straight = apart(a, b).max(axis=1) < CLOSE, alike > 0
        close[close] = _middle_solves(arm, screw, goals.take(k[close]), a[close], b[close])
        straight[straight] = _joined_straight(arm, screw, goals.take(k[straight]), a[straight], b[straight])
        # `near` that misses by what is rounded may be between two manifolds, and stands for one: it must add no row
        added = (stands & (miss > SOLVES))[k, i] | (stands & (miss > SOLVES))[k, j]
        for p in np.flatnonzero(added & (close | straight)):
            close[p] = straight[p] = armkin.ik(arm, target[k[p]], task).valid.sum() < s.valid[k[p]].sum()
        verdict.twice = np.unique(k[close | straight]).tolist()
    if near is not None:
        standing = np.broadcast_to(near, q.shape)
        solves = miss_of(arm, screw, goals, standing) < 0.5 * SOLVES
        legal = ((standing >= arm.lower - 1e-9) & (standing <= arm.upper + 1e-9)).all(axis=1)
        best = np.take_along_axis(s.q, np.maximum(s.best, 0)[:, None, None], axis=1)[:, 0]
        stays = (s.best >= 0) & (np.abs((best - standing) * unit).max(axis=1) < 1e-9)
        verdict.moves = np.flatnonzero(solves & legal & ~stays).tolist()
    return verdict


def judge_kinds(
    arm: Arm,
    screw: Screws,
    kinds: dict[str, Array],
    target: Array,
    near: Array | None = None,
    task: str | None = None,
) -> tuple[Verdict, str]:
    """Postures of several kinds and their targets, all judged in one call; and of which kind the wrong ones are."""
    q = np.concatenate(list(kinds.values()))
    verdict = judge(arm, screw, task, q, target, near)
    kind = np.repeat(list(kinds), [len(postures) for postures in kinds.values()])
    wrong = {*verdict.unreachable, *verdict.lost, *verdict.false, *verdict.twice, *verdict.moves}
    return verdict, f"{sorted({str(kind[k]) for k in wrong})}: {verdict}"


def _middle_solves(arm: Arm, screw: Screws, goals: Goal, a: Array, b: Array) -> Bool:
    """Whether the posture between two (M, n) solves the target: (M,)."""
    return np.asarray(miss_of(arm, screw, goals, a + 0.5 * _joint_difference(screw, a, b)) < 0.9 * SOLVES)


def _joint_difference(screw: Screws, a: Array, b: Array) -> Array:
    d = b - a
    return np.where(screw.prismatic, d, d - 2 * np.pi * np.rint(d / (2 * np.pi)))


def _joined_straight(arm: Arm, screw: Screws, goals: Goal, a: Array, b: Array) -> Bool:
    """Whether the joints move from one to the other (M, n) at constant paces and keep the target, either way round."""
    unit = np.where(screw.prismatic, screw.size, 1.0)
    d = _joint_difference(screw, a, b) / unit
    half = ~screw.prismatic & (np.pi - np.abs(d) < 1e-3)
    joined = np.zeros(len(a), bool)
    for flip in itertools.product((False, True), repeat=a.shape[1]):
        k = np.flatnonzero(~joined & ~(np.array(flip) & ~half).any(axis=1))
        for parts in (PARTS[44::45], PARTS):  # three part most of them
            if not len(k):
                break
            way = d[k] - 2 * np.pi * np.sign(d[k]) * np.array(flip)
            q = (a[k, None] + parts[:, None] * (way * unit)[:, None]).reshape(-1, a.shape[1])
            along = goals.take(np.repeat(k, len(parts)))
            solves = miss_of(arm, screw, along, q) < 0.01  # of more the next 1e-4 rad or sizes make no solution
            r = np.flatnonzero(solves)
            corrected = settle_across(screw, along.take(r), q[r])
            solves[r] = np.abs((corrected - q[r]) / unit).max(axis=1) <= 1e-4  # as far as roots of high order are off
            solves[r] &= miss_of(arm, screw, along.take(r), corrected) < 0.9 * SOLVES
            k = k[solves.reshape(len(k), len(parts)).all(axis=1)]
        joined[k] = True
    return joined


def _in_one_component(arm: Arm, screw: Screws, goals: Goal, a: Array, b: Array) -> Bool:
    """Whether three postures between two (M, n) solve the target: on the chord, or beside it if that is curved.

    Beside it means within a tenth of its length: that reaches neither of the two, so that what is found is a third
    solution. Isolated branches have none.
    """
    d, stays = _joint_difference(screw, a, b), np.ones(len(a), bool)
    for part in (0.25, 0.5, 0.75):
        q = a + part * d
        corrected = settle_across(screw, goals, q, weak=1e-4)  # of a component with two roots 1e-4 at most is lost
        beside = np.abs(corrected - q).max(axis=1) <= 0.1 * np.abs(d).max(axis=1)
        beside &= miss_of(arm, screw, goals, corrected) < 1.1 * SOLVES  # what is surely more parts them, and no less
        stays &= beside | (miss_of(arm, screw, goals, q) < 1.1 * SOLVES)
    return stays


def settle_across(screw: Screws, goals: Goal, q: Array, weak: float = 1e-6) -> Array:
    """Postures (M, n) after two Newton steps that go nowhere along a component's own direction.

    That is the last one, if its singular value is below `weak`; others are lost below 1e-6.
    """
    unit = np.where(screw.prismatic, screw.size, 1.0)
    for _ in range(2):
        r, J = oracle._residual(screw, goals, q)
        U, S, Vt = np.linalg.svd(J * unit, full_matrices=False)
        least = np.where(np.arange(S.shape[1]) < S.shape[1] - 1, 1e-6, weak)
        gain = np.where(least < S, 1 / np.maximum(S, least), 0.0)
        q = q + unit * np.einsum("mki,mk,mrk,mr->mi", Vt, gain, U, r, optimize=True)
    return q


def can_move(screw: Screws, goals: Goal, q: Array, joint: int, way: float = 0.1) -> Bool:
    """Whether postures (M, n) of the same targets exist with this joint moved by `way`, the others by up to a radian.

    The joint is held there, the others go by Newton steps of least norm: (M,).
    """
    unit = np.where(screw.prismatic, screw.size, 1.0)
    scale = unit * (np.arange(q.shape[1]) != joint)
    shifted = q + way * (unit - scale)
    for _ in range(60):
        r, J = oracle._residual(screw, goals, shifted)
        U, S, Vt = np.linalg.svd(J * scale, full_matrices=False)
        gain = np.where(S > 1e-5, 1 / np.maximum(S, 1e-5), 0.0)
        step = np.einsum("mki,mk,mrk,mr->mi", Vt, gain, U, r, optimize=True)
        step *= np.minimum(1.0, 0.3 / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]
        shifted = shifted + scale * step
    size = np.linalg.norm(oracle._residual(screw, goals, shifted)[0], axis=1)
    return np.asarray((size < 1e-10) & (np.abs((shifted - q) / unit).max(axis=1) < 1.0))


def idle_free_joints(screw: Screws, solutions: Any, target: Array) -> list[tuple[int, int]]:
    """Rows and joints that are called free, but of which no branch's self-motion moves the joint, either way."""
    goals, idle_joints = goal_of(solutions.task, target), []
    for row in np.flatnonzero(solutions.free.any(axis=1)):
        q = solutions.q[row][solutions.valid[row]]
        row_goals = goals.take(np.full(len(q), row))
        for joint in np.flatnonzero(solutions.free[row]).tolist():
            if not any(can_move(screw, row_goals, q, joint, way).any() for way in (0.1, -0.1, 0.02, -0.02)):
                idle_joints.append((int(row), int(joint)))
    return idle_joints


def ask_oracle(
    arm: Arm, screw: Screws, verdict: Verdict, target: Array, rows: NDArray[np.int64], starts: int, seed: int
) -> None:
    """Add to the verdict the isolated branches (sigma > 1e-6) that the oracle knows and a `complete` answer lacks."""
    s = verdict.solutions
    goals = goal_of(s.task, target).take(rows)
    for row, branches in zip(rows, oracle.branches(screw, goals, starts, seed), strict=True):
        if not len(branches) or not s.complete[row]:
            continue
        row_goals = goal_of(s.task, target[row : row + 1]).take(np.zeros(len(branches), int))
        strong = oracle.weakness(screw, row_goals, branches) > 1e-6
        d = oracle.distance(screw, branches[:, None], s.q[row][None])
        strong &= d.min(axis=1, initial=np.inf) > 1e-4
        if strong.any() and s.valid[row].any():  # the other root of a branch is that branch
            strong &= ~_in_one_component(arm, screw, row_goals, branches, s.q[row, d.argmin(axis=1)])
        verdict.missed += [(int(row), q) for q in branches[strong]]
