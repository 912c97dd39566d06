"""Names of branches: left or right, elbow up or down, wrist flipped or not.

A branch of a closed form is one choice of sign on each branch axis. Along a path of targets it keeps its signs, and so
its name, until it merges with its neighbour. Sample postures show once for each arm which sign has which name:

- left: the shoulder on whose side the arm's home posture lies (it reaches to the front),
  right: reaching over its back;
- elbow up: of two postures that reach out level, the one with the elbow higher above the
  base (for arms that bend in the base's plane: farther to the left of the way to the target);
- no flip: the wrist's middle joint on the positive side of straight.

The branches of general arms have no such words and are numbered.
"""

import itertools
from functools import lru_cache
from typing import cast

import numpy as np

from armkin.errors import UsageError
from armkin.formula import pose
from armkin.formula.arrays import Array, Bool
from armkin.forward import fk
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.closed.subproblems import Pair
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task, targets_of
from armkin.model.arm import Arm
from armkin.model.joint_chain import Chain, joint_axes
from armkin.model.rotation import joint_motion

WORDS = {"shoulder": ("left", "right"), "elbow": ("elbow up", "elbow down"), "wrist": ("no flip", "flip")}
# synonyms that `find_branches` accepts
_SYNONYMS = {
    "left angle": "left", "right angle": "right", "front": "left", "back": "right", "lefty": "left", "righty": "right",
    "upper elbow": "elbow up", "lower elbow": "elbow down", "elbow upper": "elbow up", "elbow lower": "elbow down",
    "noflip": "no flip", "unflipped": "no flip", "flipped": "flip",
}  # fmt: skip


@lru_cache(maxsize=256)
def branch_names(arm: Arm, task: Task, geometry: Geometry, count: int) -> tuple[str, ...]:
    """A name for each branch index; indices as flattened from the branch axes."""
    sizes = [2 if label else 1 for label in geometry.labels]
    named = int(np.prod(sizes)) if geometry.labels else 0
    if not named or named != (geometry.branches or count) or named > count:
        return tuple(f"branch {i + 1}" for i in range(count))
    swap = _swapped_names(arm, task, geometry, sizes)
    names = []
    for signs in itertools.product(*(range(s) for s in sizes)):
        words = (WORDS[k][i ^ int(swap[k][signs])] for k, i in zip(geometry.labels, signs, strict=True) if k)
        names.append(", ".join(words))
    return (*names, *(f"branch {i + 1}" for i in range(named, count)))


def _swapped_names(arm: Arm, task: Task, geometry: Geometry, sizes: list[int]) -> dict[str, Bool]:
    """For the label of each branch axis, which branches (b0, b1, b2) give its first sign the second of its words."""
    postures, q, valid = _sample_postures(arm, task, geometry)
    shape = (len(q), *sizes)
    distances = np.where(valid, newton.wrapped_distance(arm, q, postures[:, None, :]), np.inf)
    found_again = distances.min(axis=1) < tol.NAMED_DISTANCE  # some branch is the posture itself
    swap = {label: np.zeros(shape[1:], bool) for label in geometry.labels if label}
    signs = np.stack(np.unravel_index(distances.argmin(axis=1), shape[1:]), axis=1)  # (postures, 3) of that branch
    if "shoulder" in swap and found_again.any():
        # the first of these postures is the one most like home
        swap["shoulder"][...] = signs[np.argmax(found_again), 0] == 1
    if "wrist" in swap and found_again.any():
        positive = found_again & (_bent_wrist(arm, postures) > 0)
        if positive.any():
            swap["wrist"][...] = signs[np.argmax(positive), 2] == 1
    if "elbow" in swap:
        swap["elbow"][...] = _elbow_swapped(arm, q, valid, shape)
    return swap


def _elbow_swapped(arm: Arm, q: Array, valid: Bool, shape: tuple[int, ...]) -> Bool:
    """Whether the second of two elbows is the upper one, (b0, b1, b2); branches (M, B, n) on axes (M, b0, b1, b2)."""
    heights, level = _elbow_heights(arm, q)
    heights = np.where(valid, heights, np.nan).reshape(shape)
    level = np.where(valid, level, np.inf).reshape(shape)
    swapped = np.zeros(shape[1:], bool)
    for b0, b2 in itertools.product(range(shape[1]), range(shape[3])):
        first_height, second_height = heights[:, b0, 0, b2], heights[:, b0, 1, b2]
        tilt = level[:, b0, :, b2].max(axis=1) + np.where(np.isnan(first_height - second_height), np.inf, 0.0)
        swapped[b0, :, b2] = second_height[np.argmin(tilt)] > first_height[np.argmin(tilt)]
    return swapped


def find_branches(names: tuple[str, ...], phrase: str) -> list[int]:
    """Indices of the branches that a phrase names; it may have some of a name's words, in any order.

    Raises UsageError, which lists the names, if there are none.

    >>> find_branches(("left, elbow up", "left, elbow down", "right, elbow up"), "upper elbow, left angle")
    [0]
    """
    text = " ".join(phrase.lower().replace(",", " ").replace("/", " ").replace("-", " ").split())
    if text in (name.replace(",", "") for name in names):
        return [i for i, name in enumerate(names) if name.replace(",", "") == text]
    parts, unknown = _branch_words(text)
    hits = [i for i, name in enumerate(names) if parts and all(p in name.split(", ") for p in parts)]
    if unknown or not hits:
        raise UsageError(f"no branch is called '{phrase}'; this arm's are: {'; '.join(names)}")
    return hits


def _branch_words(text: str) -> tuple[list[str], list[str]]:
    """The words of branch names, or of their synonyms, in a text, and its other words."""
    for synonym, meant in _SYNONYMS.items():
        text = f" {text} ".replace(f" {synonym} ", f" {meant} ").strip()
    parts = []
    for word in ("no flip", "flip", "elbow up", "elbow down", "left", "right"):
        if f" {word} " in f" {text} ":
            parts.append(word)
            text = f" {text} ".replace(f" {word} ", " ").strip()
    heights = [w for w in text.split() if w in ("up", "down")]
    return parts + [f"elbow {w}" for w in heights], [w for w in text.split() if w not in heights]


def _sample_postures(arm: Arm, task: Task, geometry: Geometry) -> tuple[Array, Array, Bool]:
    """Sample postures (M, n), home and its neighbours first, and all branches at each: (M, B, n), valid (M, B)."""
    rng = np.random.default_rng(3)
    near_home = arm.home + rng.uniform(-0.35, 0.35, (24, arm.n)) * np.where(arm.prismatic, arm.reach / 20, 1.0)
    random_postures = rng.uniform(-np.pi, np.pi, (200, arm.n)) * np.where(arm.prismatic, arm.reach / 10, 1.0)
    postures = np.concatenate([arm.home[None], near_home, random_postures])
    goal = targets_of(task, fk(arm, postures), postures)
    if geometry.rows is not None:
        branches = geometry.rows(goal)
        q = branches.q[:, : geometry.branches]
        return postures, q, ~np.isnan(q).any(axis=2) & ~branches.doubt[:, None]
    assert geometry.pairs is not None
    entries = pose.read_pose(goal) if task.orientation == "full" else list(np.ascontiguousarray(goal.T))
    prefer = [Pair(0.0, None) if p else Pair(1.0, 0.0) for p in arm.prismatic]
    candidates = geometry.pairs(entries, prefer)
    values = np.broadcast_arrays(*cast("list[Array]", candidates.values()))
    q = np.stack([v.reshape(-1, len(postures)).T for v in values], axis=2)
    # branch by branch, since formulas for a large batch would have to be recorded first
    misses = np.stack([newton.misses(arm, task, branch, goal) for branch in q.swapaxes(0, 1)], axis=1)
    edge = np.broadcast_to(candidates.doubt.edge, values[0].shape).reshape(q.shape[1], -1).T
    return postures, q, (misses < tol.SOLUTION) & ~edge


def _bent_wrist(arm: Arm, postures: Array) -> Array:
    """Sine of the wrist's middle joint from straight: how joint 6 leans to joint 4's side, about joint 5's axis."""
    c, s = np.cos(postures[:, 4]), np.sin(postures[:, 4])
    A, b = arm.link[4][:3, :3], arm.link[5][:3, 2]
    z4 = A.T @ [0.0, 0.0, 1.0]
    turned = np.stack([c * b[0] - s * b[1], s * b[0] + c * b[1], np.full_like(c, b[2])], axis=1)
    return np.asarray(np.cross(np.broadcast_to(z4, turned.shape), turned)[:, 2])


def _elbow_heights(arm: Arm, q: Array) -> tuple[Array, Array]:
    """Height of the elbow in every branch, and a measure, low where the arm reaches far out and level: (M, B)."""
    shape = q.shape[:2]
    points = _joint_origins(arm, np.nan_to_num(q.reshape(-1, arm.n)))
    _, directions = joint_axes(Chain(arm.link, arm.prismatic))
    if abs(directions[min(arm.n, 3) - 1, 2]) >= 0.9:  # the elbow's axis is along the base's z
        # in the base's plane: to the left of the line from the first joint to the tool
        reach_vector = points[:, -1] - points[:, 0]
        elbow = points[:, 1] - points[:, 0]
        lateral = reach_vector[:, 0] * elbow[:, 1] - reach_vector[:, 1] * elbow[:, 0]
        return lateral.reshape(shape), np.zeros(shape)
    shoulder, elbow, wrist = points[:, 1], points[:, 2], points[:, 3]
    reach_vector = wrist - shoulder
    length = np.linalg.norm(reach_vector, axis=1)
    tilt = np.abs(reach_vector[:, 2]) / np.maximum(length, tol.NO_LENGTH)
    # far from the axis an offset of the shoulder hardly changes the direction
    return elbow[:, 2].reshape(shape), (tilt - length / max(float(length.max()), tol.NO_LENGTH)).reshape(shape)


def _joint_origins(arm: Arm, q: Array) -> Array:
    """Origins of joints 1 to 3 and of the frame behind joint 3: (M, up to 4, 3)."""
    P = np.broadcast_to(arm.link[0], (len(q), 4, 4))
    points = [P[:, :3, 3]]
    for i in range(min(arm.n, 3)):
        P = P @ joint_motion(bool(arm.prismatic[i]), q[:, i]) @ arm.link[i + 1]
        points.append(P[:, :3, 3])
    return np.stack(points, axis=1)
