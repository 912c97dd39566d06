"""Targets that an arm reaches from a place: for each position and yaw, by arcs of joint 1 if its axis allows it."""

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
from armkin.reachability.cell_answers import legal_arc, pack_bits, some_copy_legal
from armkin.reachability.place import branches_from_place
from armkin.reachability.place.arm_among_obstacles import Obstacles, free_at_place
from armkin.reachability.place.upright_joint import RADII, by_radius
from armkin.reachability.reach_cells import STRAIGHT

if TYPE_CHECKING:
    from armkin.model.arm import Arm


Solve = Callable[["Arm", Array, str], Solutions]  # `armkin.ik` of an arm, targets and a task

TURNING = ("xy_theta", "xyz_yaw")  # tasks with an angle that depends on the yaw of the arm
BLOCK_TARGETS = 8_192  # targets solved together, so that their arrays fit the cache
BEYOND_REACH = 1e-6  # distance [reaches] beyond the reach from which on a target is not solved


class HeldArm(NamedTuple):
    """An arm, and the values [rad] of its held joints."""

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
    path_lengths: tuple[int, ...] = ()  # number of targets of each part of a path that one branch has to follow
    redundant_joint: str = ""  # name of the redundant joint that a plan holds
    values: tuple[float, ...] = ()  # its possible values [rad], the best first
    full_arm: HeldArm | None = None  # set after one of the values is chosen
    solve: Solve = ik  # a function of a module, as it is pickled

    @property
    def by_arcs(self) -> bool:
        """Whether a yaw changes joint 1 only, and the yaws divide the circle."""
        on_axis = np.abs(self.arm.link[0][:2, 3]).max() <= STRAIGHT * self.arm.reach
        return self._stands_upright and bool(on_axis) and abs(self.yaws * self.step - TURN) < STRAIGHT

    @property
    def by_distance_alone(self) -> bool:
        """Whether the other joints depend only on the distance of a target from joint 1."""
        needs_azimuth = self.task.orientation != "none" or self.task.name in TURNING
        return self._stands_upright and not needs_azimuth and not self.by_arcs

    @property
    def _stands_upright(self) -> bool:
        """Whether joint 1 is revolute with a vertical axis and independent of other joints, without keep-outs."""
        arm = self.arm
        no_keep_outs = not arm.keep_out and not self.obstacles.keep_out
        is_independent = not arm.prismatic[0] and bool((arm.ratio == 1.0).all()) and arm.n == self.task.constraints
        return is_independent and no_keep_outs and bool(np.abs(arm.link[0][:2, 2]).max() <= STRAIGHT)

    @property
    def sense(self) -> int:
        """The sign of the change of joint 1 with the yaw."""
        return -1 if self.arm.link[0][2, 2] > 0 else 1


def positions_of(task: Task, targets: Array) -> Array:
    """Positions (N, 2 or 3) of targets."""
    return targets[:, :3, 3] if task.orientation == "full" else targets[:, : task.position]


def reached_counts(question: PlaceQuestion, positions: Array) -> NDArray[np.int64]:
    """Number of targets reached from positions (P, 2) at each yaw: (P, K), with the best value of a held joint."""
    if question.values:
        return _greatest_counts(question, positions)
    block_size = len(positions) if question.by_distance_alone else max(BLOCK_TARGETS // len(question.targets), 1)
    blocks = [positions[start : start + block_size] for start in range(0, len(positions), block_size)]
    return np.concatenate([_count_targets(question, block, _legal_yaws(question, block)) for block in blocks])


def _greatest_counts(question: PlaceQuestion, positions: Array) -> NDArray[np.int64]:
    """Number of targets reached with a redundant joint held at its best value, from positions (P, 2): (P, K).

    Keep-outs only reduce the number. Positions are therefore first counted without keep-outs, and counted with them
    only if the result could exceed the best one so far.
    """
    counts = np.zeros((len(positions), question.yaws), np.int64)
    has_keep_outs = question.arm.keep_out or question.obstacles.keep_out
    unobstructed = question._replace(arm=_drop_keep_outs(question.arm), obstacles=Obstacles())
    open_positions = np.arange(len(positions))
    for value_question, free_question in zip(each_value(question), each_value(unobstructed), strict=True):
        to_ask, free_counts = open_positions, reached_counts(free_question, positions[open_positions])
        if has_keep_outs:
            to_ask = open_positions[(free_counts > counts[open_positions]).any(axis=1)]
        if len(to_ask):
            counts[to_ask] = np.maximum(
                counts[to_ask], reached_counts(value_question, positions[to_ask]) if has_keep_outs else free_counts
            )
        open_positions = open_positions[(counts[open_positions] < len(question.targets)).any(axis=1)]
        if not len(open_positions):
            break
    return counts


def each_value(question: PlaceQuestion) -> Iterator[PlaceQuestion]:
    """The question with the redundant joint held at each value; the question itself without such a joint."""
    if not question.values:
        yield question
    for value in question.values:
        full_arm = HeldArm(question.arm, {question.redundant_joint: value})
        free_arm = _hold_joint(
            question.arm, question.redundant_joint, value
        )  # many arms, each too short-lived for compiling
        yield question._replace(arm=free_arm, values=(), full_arm=full_arm, solve=ik)


def at_value(question: PlaceQuestion, position: Array, yaw: float) -> PlaceQuestion:
    """The question with the redundant joint held at the first value that reaches most targets from one place."""
    if not question.values:
        return question
    yaw_index, greatest, best_question = round(yaw / question.step), -1, question
    for candidate in each_value(question):
        if (count := int(reached_counts(candidate, position[None])[0, yaw_index])) > greatest:
            greatest, best_question = count, candidate
        if greatest == len(question.targets):
            break
    return best_question


@lru_cache(maxsize=4)
def _drop_keep_outs(arm: Arm) -> Arm:
    """The arm without its keep-outs."""
    return replace(arm, keep_out=()) if arm.keep_out else arm


@lru_cache(maxsize=256)
def _hold_joint(arm: Arm, joint: str, value: float) -> Arm:
    """The arm with a joint held; cached, so that its solver is prepared once."""
    return lock(arm, {joint: value})


def _count_targets(question: PlaceQuestion, positions: Array, is_legal: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Number of legal targets, (P, N, K) -> (P, K); parts of a path without a common branch count as incomplete."""
    if not question.path_lengths:
        return np.asarray(is_legal.sum(axis=1, dtype=np.int64))
    counts, begin = np.zeros((len(positions), question.yaws), np.int64), 0
    for length in question.path_lengths:
        part = slice(begin, begin + length)
        count = is_legal[:, part].sum(axis=1, dtype=np.int64)
        has_all = count == length
        for place in np.flatnonzero(has_all.any(axis=1)) if length > 1 else ():
            question_of_path = question._replace(targets=question.targets[part])
            has_all[place] = _on_one_branch(question_of_path, positions[place], has_all[place])
        counts += np.where(has_all, length, np.minimum(count, length - 1))
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
    is_legal = (_by_arcs if question.by_arcs else _yaw_by_yaw)(question, target, place)
    return is_legal.reshape(len(positions), N, K)


def _by_radius(question: PlaceQuestion, positions: Array) -> NDArray[np.bool_] | None:
    """Which targets are reached, (P, N, K), from solutions at sampled distances; None without a closed form."""
    shifted_goals = question.targets.copy()
    if question.task.position > 2:
        shifted_goals[:, 2] -= question.z
    turns: Array = np.asarray(np.arange(question.yaws) * question.step, float)
    if (answer := by_radius(question.arm, question.task.name, shifted_goals, positions, turns)) is None:
        return None
    is_legal, undecided = answer
    place_index, target_index, yaw_index = np.nonzero(undecided)
    for start in range(0, len(place_index), BLOCK_TARGETS):
        block = slice(start, start + BLOCK_TARGETS)
        shifted_targets = _shift_targets(
            question._replace(targets=question.targets[target_index[block]]), positions[place_index[block]]
        )
        yaw = turns[yaw_index[block]]
        goals = _turn_targets(question.task, shifted_targets, yaw, np.cos(yaw), np.sin(yaw))
        is_legal[place_index[block], target_index[block], yaw_index[block]] = _any_legal(question, goals)
    return is_legal


def _by_arcs(question: PlaceQuestion, target: NDArray[np.intp], place: Array) -> NDArray[np.bool_]:
    """At which yaws targets (M,) are reached from places (M, 2), with one solve for each: (M, K)."""
    is_legal = np.zeros((len(target), question.yaws), bool)
    in_reach = np.flatnonzero(_within_reach(question, target, place, np.zeros(1))[:, 0])
    goals = _shift_targets(question._replace(targets=question.targets[target[in_reach]]), place[in_reach])
    rest_rows = np.arange(len(in_reach))
    if (blocks := columns(question.arm, goals, question.task.name)) is not None:
        edges = [rest_rows[:0]]
        for block in blocks:
            is_legal[in_reach[block.rows]] = _legal_turns(question, block.values, block.valid)
            edges.append(block.rows.start + block.left)
        rest_rows = np.concatenate(edges)
    if len(rest_rows):
        solutions, rows = question.solve(question.arm, goals[rest_rows], question.task.name), in_reach[rest_rows]
        is_legal[rows] = _legal_turns(question, list(solutions.q.transpose(2, 1, 0)), solutions.valid.T)
        edge = rows[(solutions.status == Status.BOUNDARY) | (solutions.status == Status.SINGULAR)]
        is_legal[edge] = _yaw_by_yaw(question, target[edge], place[edge])
    return is_legal


def _legal_turns(question: PlaceQuestion, values: list[Array], valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """At which yaws some branch is within limits: n joints' values at yaw 0 (B, M), valid (B, M) -> (M, K)."""
    arm, K = question.arm, question.yaws
    is_legal = valid
    for j in range(1, arm.n):
        is_legal = is_legal & some_copy_legal(arm, values[j], j)
    first, length = legal_arc(arm, values[0], 0, K, question.sense)
    return _covered_arcs(first, np.where(is_legal, length, 0), K)


def _yaw_by_yaw(question: PlaceQuestion, target: NDArray[np.intp], place: Array) -> NDArray[np.bool_]:
    """At which yaws targets (M,) are reached from places (M, 2), with a solve for each yaw: (M, K)."""
    K, is_legal = question.yaws, np.zeros((len(target), question.yaws), bool)
    turns: Array = np.asarray(np.arange(K) * question.step, float)
    cosine, sine = np.cos(turns), np.sin(turns)
    block_size = max(BLOCK_TARGETS // K, 1)
    for start in range(0, len(target), block_size):
        block = slice(start, start + block_size)
        pair, yaw_index = np.nonzero(_within_reach(question, target[block], place[block], turns))
        shifted_targets = _shift_targets(question._replace(targets=question.targets[target[block]]), place[block])
        goals = _turn_targets(
            question.task, shifted_targets[pair], turns[yaw_index], cosine[yaw_index], sine[yaw_index]
        )
        is_legal[start + pair, yaw_index] = _any_legal(question, goals)
    return is_legal


def _any_legal(question: PlaceQuestion, goals: Array) -> NDArray[np.bool_]:
    """Which targets, in the arm's frame, are reached by a branch within limits: (N,)."""
    arm, has_legal, rest_rows = question.arm, np.zeros(len(goals), bool), np.arange(len(goals))
    isolated_answers = arm.n == question.task.constraints
    if isolated_answers and (blocks := columns(arm, goals, question.task.name)) is not None:
        edges = [rest_rows[:0]]
        for block in blocks:
            is_legal = block.valid
            for j in range(arm.n):
                is_legal = is_legal & some_copy_legal(arm, block.values[j], j)
            has_legal[block.rows] = is_legal.any(axis=0)
            edges.append(block.rows.start + block.left)
        rest_rows = np.concatenate(edges)
    if len(rest_rows):
        has_legal[rest_rows] = question.solve(arm, goals[rest_rows], question.task.name).within_limits.any(axis=1)
    return has_legal


def _within_reach(question: PlaceQuestion, target: NDArray[np.intp], place: Array, turns: Array) -> NDArray[np.bool_]:
    """Which targets (M,) are within the reach from joint 1 of an arm at places (M, 2) and yaws (K,): (M, K).

    Other targets need no solve, as no point of an arm is farther from joint 1 than its reach.
    """
    arm = question.arm
    origin = arm.link[0][:3, 3] @ np.swapaxes(rotation_about(2, turns), 1, 2) + [0.0, 0.0, question.z]
    points = positions_of(question.task, question.targets)[target]
    squared_distance = np.zeros((len(points), len(turns)))
    for i in range(points.shape[1]):
        squared_distance += ((points[:, i] - (place[:, i] if i < 2 else 0.0))[:, None] - origin[:, i]) ** 2
    return np.asarray(squared_distance <= (arm.reach * (1.0 + BEYOND_REACH)) ** 2)


def _covered_arcs(first: NDArray[np.intp], length: NDArray[np.intp], count: int) -> NDArray[np.bool_]:
    """Which of `count` places of M circles lie on at least one of B arcs: (B, M), (B, M) -> (M, count)."""
    prefix = _prefix_bits(count)
    words = np.zeros((first.shape[1], prefix.shape[1]), np.uint64)
    for begin, end in zip(first, first + length, strict=True):
        words |= prefix.take(begin, axis=0) ^ prefix.take(end, axis=0)
    bits = np.unpackbits(words.astype("<u8").view(np.uint8), axis=1, count=count, bitorder="little")
    return bits.view(bool)


@lru_cache(maxsize=4)
def _prefix_bits(count: int) -> NDArray[np.uint64]:
    """Bits of the places passed on the way from 0 to each place, twice around the circle: (2 count + 1, words).

    A place passed twice has bit 0 again, so that an arc is the exclusive or of the prefixes of its two ends.
    """
    prefixes = pack_bits(np.arange(count) < np.arange(count + 1)[:, None])
    return np.concatenate([prefixes, prefixes[-1] ^ prefixes[1:]])


def _on_one_branch(question: PlaceQuestion, position: Array, yaws: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """At which of some yaws (K,) one branch follows all targets."""
    arm, K = question.arm, question.yaws
    if question.by_arcs:
        solutions = isolated_branches(arm, targets_from(question, position, 0.0), question.task.name)
        is_complete, low, high = branches_from_place.branch_ranges(solutions, solutions.valid)
        is_legal = is_complete & branches_from_place.some_copy_legal(arm, low, high, range(1, arm.n))
        first, length = branches_from_place.branch_arc(arm, low[:, 0], high[:, 0], K, question.sense)
        is_on_arc = (np.arange(K) - first[:, None]) % K < np.where(is_legal, length, 0)[:, None]
        return np.asarray(yaws & is_on_arc.any(axis=0))
    is_followed = np.zeros(K, bool)
    for k in np.flatnonzero(yaws).tolist():
        solutions, is_free = free_from(question, position, k * question.step, legal_only=False)
        is_complete, low, high = branches_from_place.branch_ranges(solutions, is_free)
        is_followed[k] = (is_complete & branches_from_place.some_copy_legal(arm, low, high, range(arm.n))).any()
    return is_followed


def legal_from(question: PlaceQuestion, position: Array, turn: float) -> NDArray[np.bool_]:
    """Which targets are reached from one place: (N,)."""
    return np.asarray(free_from(question, position, turn)[1].any(axis=1))


def free_from(
    question: PlaceQuestion, position: Array, turn: float, legal_only: bool = True
) -> tuple[Solutions, NDArray[np.bool_]]:
    """The branches of all targets from one place, and which hit nothing (N, B), with legal_only also within limits."""
    # following a path needs isolated branches, while any posture of a family reaches a target
    solve = question.solve if legal_only else isolated_branches
    solutions = solve(question.arm, targets_from(question, position, turn), question.task.name)
    is_legal = solutions.within_limits if legal_only else solutions.valid
    if question.arm.keep_out:
        is_legal = is_legal & solutions.clear
    if question.obstacles.keep_out and is_legal.any():
        place = float(position[0]), float(position[1]), question.z
        q = np.where(is_legal[:, :, None], solutions.q, np.nan)
        arm, joints = question.full_arm or HeldArm(question.arm, {})
        is_legal = is_legal & free_at_place(arm, question.obstacles, place, turn, unlock(arm, joints, q))
    return solutions, np.asarray(is_legal)


def targets_from(question: PlaceQuestion, position: Array, turn: float) -> Array:
    """The targets in the frame of an arm at one place (2,) or at a place for each target (N, 2), and a yaw."""
    return _turn_targets(question.task, _shift_targets(question, position), np.array(turn), np.cos(turn), np.sin(turn))


def _shift_targets(question: PlaceQuestion, position: Array) -> Array:
    """The targets in the frame of an arm at one position, or one for each target (N, 2), with yaw 0."""
    targets = question.targets.copy()
    shift = np.concatenate([position, np.full((*position.shape[:-1], 1), question.z)], axis=-1)
    target_positions = positions_of(question.task, targets)
    target_positions -= shift[..., : target_positions.shape[1]]
    return targets


def _turn_targets(task: Task, targets: Array, turn: Array, cosine: Array, sine: Array) -> Array:
    """Transform targets in place to a frame turned about z; turn, its cosine and sine: () or (N,)."""
    if task.orientation == "full":
        _turn_back(targets[:, 0], targets[:, 1], cosine[..., None], sine[..., None])
        return targets
    for first in (0, 3) if task.orientation == "axis" else (0,):
        _turn_back(targets[:, first], targets[:, first + 1], cosine, sine)
    if task.name in TURNING:
        targets[:, task.position] -= turn
    return targets


def _turn_back(x: Array, y: Array, cosine: Array, sine: Array) -> None:
    """Transform coordinates x and y in place to a frame turned about z; cosine, sine: of the angle."""
    x[...], y[...] = cosine * x + sine * y, cosine * y - sine * x
