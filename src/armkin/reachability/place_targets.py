"""What an arm reaches from a place: which targets from each yaw at a position, by arcs of joint 1 where that does."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.inverse.answers.solutions import Solutions, Status
from armkin.inverse.solve import columns, ik, isolated_branches
from armkin.inverse.tasks.task import Task
from armkin.model.lock_joints import lock, unlock
from armkin.model.rotation import rotation_about
from armkin.model.units import TURN
from armkin.reachability import place_branches
from armkin.reachability.cell_answers import legal_arc, pack_bits, some_copy_legal
from armkin.reachability.place_arm import Obstacles, free_at_place
from armkin.reachability.place_upright import RADII, by_radius
from armkin.reachability.reach_cells import STRAIGHT

if TYPE_CHECKING:
    from armkin.model.arm import Arm


Solve = Callable[["Arm", Array, str], Solutions]  # `armkin.ik` of an arm, targets and a task

TURNING = ("xy_theta", "xyz_yaw")  # tasks of which an angle turns with the arm
BLOCK_TARGETS = 8_192  # targets asked together: what is known of them stays in the cache
BEYOND_REACH = 1e-6  # distance [reaches] beyond the reach from which on nothing solves a target


class HeldArm(NamedTuple):
    """An arm, and which of its joints are held at which values [rad]."""

    arm: Arm
    joints: dict[str, float]


class PlaceQuestion(NamedTuple):
    """Targets of one arm, in the targets' frame."""

    arm: Arm
    task: Task
    targets: Array
    yaws: int
    step: float  # [rad] of the yaw
    z: float
    obstacles: Obstacles = Obstacles()
    ways: tuple[int, ...] = ()  # targets of each way of a path that one branch is to carry
    spare: str = ""  # the redundant joint, which a path's plan holds,
    values: tuple[float, ...] = ()  # values [rad] where it may stand, the best first
    full_arm: HeldArm | None = None  # where one of the values is chosen
    solve: Solve = ik  # a function of a module, as it travels

    @property
    def by_arcs(self) -> bool:
        """Whether a yaw adds to joint 1 alone, and the yaws divide the circle."""
        on_axis = np.abs(self.arm.link[0][:2, 3]).max() <= STRAIGHT * self.arm.reach
        return self._stands_upright and bool(on_axis) and abs(self.yaws * self.step - TURN) < STRAIGHT

    @property
    def by_distance_alone(self) -> bool:
        """Whether what joints behind joint 1 are asked depends on the target's distance from that alone."""
        turning = self.task.orientation != "none" or self.task.name in TURNING
        return self._stands_upright and not turning and not self.by_arcs

    @property
    def _stands_upright(self) -> bool:
        """Whether joint 1 turns about a line upright, as it is commanded, and nothing is kept out."""
        arm = self.arm
        free = not arm.keep_out and not self.obstacles.keep_out
        plain = not arm.prismatic[0] and bool((arm.ratio == 1.0).all()) and arm.n == self.task.constraints
        return plain and free and bool(np.abs(arm.link[0][:2, 2]).max() <= STRAIGHT)

    @property
    def sense(self) -> int:
        """How joint 1 turns with the yaw, in the arm's own frame."""
        return -1 if self.arm.link[0][2, 2] > 0 else 1


def positions_of(task: Task, targets: Array) -> Array:
    """Positions (N, 2 or 3) of targets."""
    return targets[:, :3, 3] if task.orientation == "full" else targets[:, : task.position]


def reached_counts(question: PlaceQuestion, positions: Array) -> NDArray[np.int64]:
    """How many targets are reached from positions (P, 2) at each yaw: (P, K); of values to hold, at the best one."""
    if question.values:
        return _greatest_counts(question, positions)
    at_once = len(positions) if question.by_distance_alone else max(BLOCK_TARGETS // len(question.targets), 1)
    blocks = [positions[start : start + at_once] for start in range(0, len(positions), at_once)]
    return np.concatenate([_count_targets(question, block, _legal_yaws(question, block)) for block in blocks])


def _greatest_counts(question: PlaceQuestion, positions: Array) -> NDArray[np.int64]:
    """How many targets are reached with a redundant joint held at its best value, from positions (P, 2): (P, K).

    Keep-outs only take away: a place is asked among them where more is reached without them than is known.
    """
    counts = np.zeros((len(positions), question.yaws), np.int64)
    blocked = question.arm.keep_out or question.obstacles.keep_out
    bare = question._replace(arm=_drop_keep_outs(question.arm), obstacles=Obstacles())
    left = np.arange(len(positions))
    for held, without in zip(each_value(question), each_value(bare), strict=True):
        to_ask, counted = left, reached_counts(without, positions[left])
        if blocked:
            to_ask = left[(counted > counts[left]).any(axis=1)]
        if len(to_ask):
            counts[to_ask] = np.maximum(counts[to_ask], reached_counts(held, positions[to_ask]) if blocked else counted)
        left = left[(counts[left] < len(question.targets)).any(axis=1)]
        if not len(left):
            break
    return counts


def each_value(question: PlaceQuestion) -> Iterator[PlaceQuestion]:
    """The question with the redundant joint held at each value; itself where there is none to hold."""
    if not question.values:
        yield question
    for value in question.values:
        full_arm = HeldArm(question.arm, {question.spare: value})
        free_arm = _hold_joint(question.arm, question.spare, value)  # one of many arms: not worth being compiled
        yield question._replace(arm=free_arm, values=(), full_arm=full_arm, solve=ik)


def at_value(question: PlaceQuestion, position: Array, turn: float) -> PlaceQuestion:
    """The question with the redundant joint held at the first value at which most is reached from one place."""
    if not question.values:
        return question
    k, most, best = round(turn / question.step), -1, question
    for held in each_value(question):
        if (count := int(reached_counts(held, position[None])[0, k])) > most:
            most, best = count, held
        if most == len(question.targets):
            break
    return best


@lru_cache(maxsize=4)
def _drop_keep_outs(arm: Arm) -> Arm:
    """The arm without its keep-outs."""
    return replace(arm, keep_out=()) if arm.keep_out else arm


@lru_cache(maxsize=256)
def _hold_joint(arm: Arm, joint: str, value: float) -> Arm:
    """The arm with a joint held: one and the same for each value, so that its solver is prepared once."""
    return lock(arm, {joint: value})


def _count_targets(question: PlaceQuestion, positions: Array, legal: NDArray[np.bool_]) -> NDArray[np.int64]:
    """How many targets are legal, (P, N, K) -> (P, K); of ways that one branch does not carry, less than all."""
    if not question.ways:
        return np.asarray(legal.sum(axis=1, dtype=np.int64))
    counts, begin = np.zeros((len(positions), question.yaws), np.int64), 0
    for length in question.ways:
        way = slice(begin, begin + length)
        count = legal[:, way].sum(axis=1, dtype=np.int64)
        carried = count == length
        for p in np.flatnonzero(carried.any(axis=1)) if length > 1 else ():
            carried[p] = _on_one_branch(question._replace(targets=question.targets[way]), positions[p], carried[p])
        counts += np.where(carried, length, np.minimum(count, length - 1))
        begin += length
    return counts


def _legal_yaws(question: PlaceQuestion, positions: Array) -> NDArray[np.bool_]:
    """Which targets are reached from positions (P, 2) at each yaw: (P, N, K)."""
    N, K = len(question.targets), question.yaws
    if question.arm.keep_out or question.obstacles.keep_out:
        turns = (np.arange(K) * question.step).tolist()
        return np.stack(
            [np.stack([legal_from(question, position, turn) for turn in turns], axis=1) for position in positions]
        )
    target, place = np.tile(np.arange(N), len(positions)), np.repeat(positions, N, axis=0)
    if (
        question.by_distance_alone
        and len(positions) * K > 4 * RADII
        and (read := _by_radius(question, positions)) is not None
    ):
        return read
    legal = (_by_arcs if question.by_arcs else _yaw_by_yaw)(question, target, place)
    return legal.reshape(len(positions), N, K)


def _by_radius(question: PlaceQuestion, positions: Array) -> NDArray[np.bool_] | None:
    """Which targets are reached, (P, N, K), by what the joints behind joint 1 do at their distance; None: no form."""
    high = question.targets.copy()
    if question.task.position > 2:
        high[:, 2] -= question.z
    turns: Array = np.asarray(np.arange(question.yaws) * question.step, float)
    if (answer := by_radius(question.arm, question.task.name, high, positions, turns)) is None:
        return None
    legal, open_ = answer
    p, i, k = np.nonzero(open_)
    for start in range(0, len(p), BLOCK_TARGETS):
        block = slice(start, start + BLOCK_TARGETS)
        beside = _shift_targets(question._replace(targets=question.targets[i[block]]), positions[p[block]])
        turn = turns[k[block]]
        goals = _turn_targets(question.task, beside, turn, np.cos(turn), np.sin(turn))
        legal[p[block], i[block], k[block]] = _any_legal(question, goals)
    return legal


def _by_arcs(question: PlaceQuestion, target: NDArray[np.intp], place: Array) -> NDArray[np.bool_]:
    """At which yaws targets (M,) are reached from places (M, 2), by one solve each: (M, K)."""
    legal = np.zeros((len(target), question.yaws), bool)
    near = np.flatnonzero(_within_reach(question, target, place, np.zeros(1))[:, 0])
    goals = _shift_targets(question._replace(targets=question.targets[target[near]]), place[near])
    left = np.arange(len(near))
    if (parts := columns(question.arm, goals, question.task.name)) is not None:
        edges = [left[:0]]
        for part in parts:
            legal[near[part.rows]] = _legal_turns(question, part.values, part.valid)
            edges.append(part.rows.start + part.left)
        left = np.concatenate(edges)
    if len(left):
        s, rows = question.solve(question.arm, goals[left], question.task.name), near[left]
        legal[rows] = _legal_turns(question, list(s.q.transpose(2, 1, 0)), s.valid.T)
        edge = rows[(s.status == Status.BOUNDARY) | (s.status == Status.SINGULAR)]
        legal[edge] = _yaw_by_yaw(question, target[edge], place[edge])
    return legal


def _legal_turns(question: PlaceQuestion, values: list[Array], valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """At which yaws some branch is within limits: n joints' values at yaw 0 (B, M), valid (B, M) -> (M, K)."""
    arm, K = question.arm, question.yaws
    allowed = valid
    for j in range(1, arm.n):
        allowed = allowed & some_copy_legal(arm, values[j], j)
    first, length = legal_arc(arm, values[0], 0, K, question.sense)
    return _covered_arcs(first, np.where(allowed, length, 0), K)


def _yaw_by_yaw(question: PlaceQuestion, target: NDArray[np.intp], place: Array) -> NDArray[np.bool_]:
    """At which yaws targets (M,) are reached from places (M, 2), by a solve for each yaw, many together: (M, K)."""
    K, legal = question.yaws, np.zeros((len(target), question.yaws), bool)
    turns: Array = np.asarray(np.arange(K) * question.step, float)
    cosine, sine = np.cos(turns), np.sin(turns)
    at_once = max(BLOCK_TARGETS // K, 1)
    for start in range(0, len(target), at_once):
        block = slice(start, start + at_once)
        m, k = np.nonzero(_within_reach(question, target[block], place[block], turns))
        beside = _shift_targets(question._replace(targets=question.targets[target[block]]), place[block])
        goals = _turn_targets(question.task, beside[m], turns[k], cosine[k], sine[k])
        legal[start + m, k] = _any_legal(question, goals)
    return legal


def _any_legal(question: PlaceQuestion, goals: Array) -> NDArray[np.bool_]:
    """Which targets, in the arm's frame, some branch within limits reaches: (N,)."""
    arm, legal, left = question.arm, np.zeros(len(goals), bool), np.arange(len(goals))
    isolated_answers = arm.n == question.task.constraints
    if isolated_answers and (parts := columns(arm, goals, question.task.name)) is not None:
        edges = [left[:0]]
        for part in parts:
            allowed = part.valid
            for j in range(arm.n):
                allowed = allowed & some_copy_legal(arm, part.values[j], j)
            legal[part.rows] = allowed.any(axis=0)
            edges.append(part.rows.start + part.left)
        left = np.concatenate(edges)
    if len(left):
        legal[left] = question.solve(arm, goals[left], question.task.name).within_limits.any(axis=1)
    return legal


def _within_reach(question: PlaceQuestion, target: NDArray[np.intp], place: Array, turns: Array) -> NDArray[np.bool_]:
    """Which targets (M,) are near enough to joint 1, of an arm at places (M, 2) and yaws (K,), to be reached: (M, K).

    Others are not asked: no point of an arm is farther from its joint 1 than its reach.
    """
    arm = question.arm
    foot = arm.link[0][:3, 3] @ np.swapaxes(rotation_about(2, turns), 1, 2) + [0.0, 0.0, question.z]
    p = positions_of(question.task, question.targets)[target]
    away = np.zeros((len(p), len(turns)))
    for i in range(p.shape[1]):
        away += ((p[:, i] - (place[:, i] if i < 2 else 0.0))[:, None] - foot[:, i]) ** 2
    return np.asarray(away <= (arm.reach * (1.0 + BEYOND_REACH)) ** 2)


def _covered_arcs(first: NDArray[np.intp], length: NDArray[np.intp], count: int) -> NDArray[np.bool_]:
    """Which places of circles of `count` lie on one of their arcs at least: (B, M), (B, M) -> (M, count)."""
    until = _prefix_bits(count)
    words = np.zeros((first.shape[1], until.shape[1]), np.uint64)
    for begin, end in zip(first, first + length, strict=True):
        words |= until.take(begin, axis=0) ^ until.take(end, axis=0)
    bits = np.unpackbits(words.astype("<u8").view(np.uint8), axis=1, count=count, bitorder="little")
    return bits.view(bool)


@lru_cache(maxsize=4)
def _prefix_bits(count: int) -> NDArray[np.uint64]:
    """A bit for each place on the way from 0 to a place, of a circle gone round twice: (2 count + 1, words).

    Places passed twice are 0 again, so that an arc is what its end has and its beginning has not, or the other way.
    """
    once = pack_bits(np.arange(count) < np.arange(count + 1)[:, None])
    return np.concatenate([once, once[-1] ^ once[1:]])


def _on_one_branch(question: PlaceQuestion, position: Array, yaws: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """At which of some yaws (K,) one branch carries all targets."""
    arm, K = question.arm, question.yaws
    if question.by_arcs:
        s = isolated_branches(arm, targets_from(question, position, 0.0), question.task.name)
        carries, low, high = place_branches.branch_ranges(s, s.valid)
        allowed = carries & place_branches.some_copy_legal(arm, low, high, range(1, arm.n))
        first, length = place_branches.branch_arc(arm, low[:, 0], high[:, 0], K, question.sense)
        places = (np.arange(K) - first[:, None]) % K < np.where(allowed, length, 0)[:, None]
        return np.asarray(yaws & places.any(axis=0))
    carried = np.zeros(K, bool)
    for k in np.flatnonzero(yaws).tolist():
        s, free = free_from(question, position, k * question.step, legal_only=False)
        carries, low, high = place_branches.branch_ranges(s, free)
        carried[k] = (carries & place_branches.some_copy_legal(arm, low, high, range(arm.n))).any()
    return carried


def legal_from(question: PlaceQuestion, position: Array, turn: float) -> NDArray[np.bool_]:
    """Which targets are reached from one place: (N,)."""
    return np.asarray(free_from(question, position, turn)[1].any(axis=1))


def free_from(
    question: PlaceQuestion, position: Array, turn: float, legal_only: bool = True
) -> tuple[Solutions, NDArray[np.bool_]]:
    """The branches of all targets from one place, and which are free (N, B); legal_only: and within limits."""
    # every posture of a family is an answer, but what one branch carries is another
    find = question.solve if legal_only else isolated_branches
    s = find(question.arm, targets_from(question, position, turn), question.task.name)
    legal = s.within_limits if legal_only else s.valid
    if question.arm.keep_out:
        legal = legal & s.clear
    if question.obstacles.keep_out and legal.any():
        place, q = (float(position[0]), float(position[1]), question.z), np.where(legal[:, :, None], s.q, np.nan)
        arm, joints = question.full_arm or HeldArm(question.arm, {})
        legal = legal & free_at_place(arm, question.obstacles, place, turn, unlock(arm, joints, q))
    return s, np.asarray(legal)


def targets_from(question: PlaceQuestion, position: Array, turn: float) -> Array:
    """The targets in the frame of an arm at a place (2,), or each from a place (N, 2) of its own, and a yaw."""
    return _turn_targets(question.task, _shift_targets(question, position), np.array(turn), np.cos(turn), np.sin(turn))


def _shift_targets(question: PlaceQuestion, position: Array) -> Array:
    """The targets in the frame of an arm at a position, or each from a position (N, 2), that is not turned."""
    targets = question.targets.copy()
    shift = np.concatenate([position, np.full((*position.shape[:-1], 1), question.z)], axis=-1)
    target_positions = positions_of(question.task, targets)
    target_positions -= shift[..., : target_positions.shape[1]]
    return targets


def _turn_targets(task: Task, targets: Array, turn: Array, c: Array, s: Array) -> Array:
    """Targets, in place, in a frame turned about z; turn, its cosine and sine: () or (N,)."""
    if task.orientation == "full":
        _turn_back(targets[:, 0], targets[:, 1], c[..., None], s[..., None])
        return targets
    for first in (0, 3) if task.orientation == "axis" else (0,):
        _turn_back(targets[:, first], targets[:, first + 1], c, s)
    if task.name in TURNING:
        targets[:, task.position] -= turn
    return targets


def _turn_back(x: Array, y: Array, c: Array, s: Array) -> None:
    """Coordinates x and y, in place, in a frame turned about z by the angle of that cosine and sine."""
    x[...], y[...] = c * x + s * y, c * y - s * x
