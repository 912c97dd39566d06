"""How far a path can be carried, by brute force: every branch, every whole-turn copy, every edge between samples.

Nothing of `armkin.motion` is used here. An edge is accepted where the tip, on twenty points of the straight joint
step, stays within the tolerance of the straight line between its ends, and the joints move little.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import armkin
from armkin.model.arm import Arm

TURN = 2 * np.pi
FAR = 0.3  # [rad] or a tenth of the reach: no honest step between close samples is larger


@dataclass
class Nodes:
    """Legal joint values at every sample."""

    q: list[np.ndarray]  # of (k, n)


def legal_copies(arm: Arm, q: np.ndarray) -> list[np.ndarray]:
    """All copies of joint values within the limits, unlimited joints as they are."""
    choices = []
    for j, value in enumerate(q):
        low, high = arm.lower[j] - 1e-9, arm.upper[j] + 1e-9
        if arm.prismatic[j] or not (np.isfinite(low) and np.isfinite(high)):
            choices.append([value] if low <= value <= high else [])
        else:
            first, last = int(np.ceil((low - value) / TURN)), int(np.floor((high - value) / TURN))
            choices.append([value + TURN * k for k in range(first, last + 1)])
    return [np.array(row) for row in itertools.product(*choices)]


def legal_nodes(arm: Arm, targets: np.ndarray) -> Nodes:
    """All legal joint values at all targets."""
    solutions = armkin.ik(arm, targets)
    columns = []
    for row, valid in zip(solutions.q, solutions.valid, strict=True):
        rows = [copy for q in row[valid] for copy in legal_copies(arm, q)]
        columns.append(np.array(rows).reshape(-1, arm.n))
    return Nodes(columns)


def accepted_edges(arm: Arm, a: np.ndarray, b: np.ndarray, tolerance: float) -> np.ndarray:
    """Which nodes (k, n) go on to which (m, n): (k, m) bool."""
    D = b[None] - a[:, None]
    free = ~arm.prismatic & ~np.isfinite(arm.lower) & ~np.isfinite(arm.upper)
    D = np.where(free, D - TURN * np.rint(D / TURN), D)
    near = (
        (np.abs(D) / np.where(arm.prismatic, arm.reach / 10, FAR)).max(axis=2) < 1
        if D.size
        else np.zeros(D.shape[:2], bool)
    )
    for i, k in np.argwhere(near):
        f = np.linspace(0, 1, 22)[:, None]
        T = armkin.fk(arm, a[i] + f * D[i, k])
        p = T[:, :3, 3]
        chord = p[:1] + f * (p[-1:] - p[:1])
        near[i, k] = np.linalg.norm(p - chord, axis=1).max() <= tolerance
    return near


def carried_nodes(arm: Arm, targets: np.ndarray, tolerance: float, start: np.ndarray | None = None) -> list[np.ndarray]:
    """Joint values (k, n) that some run from the first sample arrives at, at every sample up to the last it reaches.

    start: (k, n) those at the first sample that count; by default all.
    """
    n = legal_nodes(arm, targets)
    first = n.q[0]
    if start is not None and len(first):
        away = np.abs(first[:, None] - start[None])
        turning = ~arm.prismatic
        away[..., turning] = np.abs((away[..., turning] + np.pi) % TURN - np.pi)
        first = first[away.max(axis=2).min(axis=1, initial=np.inf) < 1e-6]
    columns = [first]
    for i in range(len(targets) - 1):
        if not len(columns[-1]) or not len(n.q[i + 1]):
            break
        columns.append(n.q[i + 1][accepted_edges(arm, columns[-1], n.q[i + 1], tolerance).any(axis=0)])
    return columns if len(columns[-1]) else columns[:-1]


def fewest_runs(arm: Arm, targets: np.ndarray, tolerance: float) -> list[tuple[int, int]]:
    """The fewest runs that carry all that can be carried, as first and last samples: each goes as far as any can."""
    n = legal_nodes(arm, targets)
    goes = [accepted_edges(arm, n.q[i], n.q[i + 1], tolerance) for i in range(len(targets) - 1)]
    spans = []
    i = 0
    while i < len(goes):
        alive: np.ndarray = np.ones(len(n.q[i]), bool)
        begin = i
        while i < len(goes) and goes[i][alive].any():
            alive, i = goes[i][alive].any(axis=0), i + 1
        if i > begin:
            spans.append((begin, i))
        else:
            i += 1
    return spans


def reach_length(arm: Arm, targets: Callable[[np.ndarray], np.ndarray], s: np.ndarray, tolerance: float) -> float:
    """The length that some run from the first sample arrives at, to a two-hundredth of a millimetre; -1: no start."""
    start, end = None, s[-1]
    while True:
        alive = carried_nodes(arm, targets(s), tolerance, start=start)
        if not alive or s[len(alive) - 1] == end or (len(alive) < len(s) and s[1] - s[0] < 0.005):
            return float(s[len(alive) - 1]) if alive else -1.0
        k = max(len(alive) - 3, 0)
        # Where all is carried the next samples are asked: coarser ones have taken too long a step for a jump.
        far = s[k] + 40 * (s[1] - s[0]) if len(alive) == len(s) else s[min(len(alive) + 1, len(s) - 1)]
        start, s = alive[k], np.linspace(s[k], min(far, end), 41)


def last_sample(arm: Arm, targets: np.ndarray, tolerance: float) -> int:
    """The last sample that any run from the first sample arrives at; -1: no legal start."""
    return len(carried_nodes(arm, targets, tolerance)) - 1
