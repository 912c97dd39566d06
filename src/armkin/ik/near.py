"""Arms that miss a class by a little: rounded tables, calibrated axes, links that were meant to be zero.

The closed form of the class that such an arm almost belongs to gives seeds, which Newton's
method moves onto the true arm. Branches continue each other as long as no singularity lies
between the two arms, so this finds all of them away from singular postures. Where a seed
does not lead to a branch, two lead to the same, or a Jacobian is weak compared with how far
the arm is off, the pose goes to the method that needs no special class: the elimination for
six joints, the quartic for three. There is no proof that nothing is lost in between, hence
`complete` is False.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin import soa
from armkin.ik import elbow, general, numeric, planar, position, spherical, three_parallel
from armkin.ik.chain import Chain
from armkin.ik.geometry import NEAR, Geometry
from armkin.ik.position import Position
from armkin.ik.subproblems import Candidates, Pair
from armkin.ik.tasks import PARALLEL, Task, targets_of
from armkin.kinematics import fk
from armkin.soa import Array, Bool

if TYPE_CHECKING:
    from armkin.arm import Arm


CHUNK = 1024  # poses corrected at once
ACCEPTED = 1e-12  # residual of a branch, of the reach and in rad
HOPELESS = 0.3  # residual of a seed that is no branch of the similar arm either


class _Corrected(NamedTuple):
    """Seeds moved onto the arm: q (N, B, n), size (N, B) of the residual, doubt (N,)."""

    q: Array
    size: Array
    doubt: Bool


def recognise(arm: Arm, task: Task) -> Geometry | None:
    """Arms that a closed form would fit if their axes moved by up to `NEAR`; by `PARALLEL` where nothing else fits."""
    if task.orientation == "axis":
        return None  # see `armkin.ik.axis`
    classes = ((planar, PARALLEL), (elbow, PARALLEL), (position, NEAR), (spherical, NEAR), (three_parallel, NEAR))
    found = [alike for module, limit in classes if (alike := module.recognise(arm, task, limit)) is not None]
    if not found:
        return None
    off, alike = min(((_distance(arm, task, alike), alike) for alike in found), key=lambda pair: pair[0])
    other = _fallback(arm, task)

    def rows(target: Array) -> tuple[Array, Bool]:
        starts = range(0, max(len(target), 1), CHUNK)
        parts = [_solve(arm, task, alike, off, other, target[k : k + CHUNK]) for k in starts]
        width = max(q.shape[1] for q, _ in parts)
        q = np.full((len(target), width, arm.n), np.nan)
        for k, (part, _) in zip(starts, parts, strict=True):
            q[k : k + len(part), : part.shape[1]] = part
        return q, np.concatenate([doubt for _, doubt in parts])

    sizes = [2 if label else 1 for label in alike.labels]
    why = f"{alike.why}, but for {off:.0e} of the reach: closed-form seeds, corrected on the true arm"
    return Geometry(
        f"near {alike.name}",
        why,
        False,
        rows=rows,
        labels=alike.labels,
        ordered=alike.ordered,
        branches=int(np.prod(sizes)) if sizes else None,
    )


def _distance(arm: Arm, task: Task, alike: Geometry) -> float:
    """How far the arm is from its class: residual of the seeds for postures of its own, lengths in reaches."""
    q = np.random.default_rng(2).uniform(-2.5, 2.5, (64, arm.n)) * np.where(arm.prismatic, arm.reach / 5, 1.0)
    target = targets_of(task, fk(arm, q), q)
    seed, _ = _seeds(arm, task, alike, target)
    B = seed.shape[1]
    rough = numeric.missing(arm, task, seed.reshape(-1, arm.n), np.repeat(target, B, axis=0)).reshape(-1, B)
    return float(np.quantile(rough.min(axis=1), 0.8)) + 1e-14


def _seeds(arm: Arm, task: Task, alike: Geometry, target: Array, off: float = 0.0) -> tuple[Array, Bool]:
    """Candidates (N, B, n) of the similar arm, real or not, and its doubts (N,).

    A pair without a real root leaves the unit circle by as much as it misses one: where that is
    no more than the arm's distance `off` from its class explains, the arm itself may have a root.
    """
    assert alike.pairs is not None
    entries = soa.read(target) if task.orientation == "full" else list(np.ascontiguousarray(target.T))
    prefer = [Pair(0.0, None) if p else Pair(1.0, 0.0) for p in arm.prismatic]
    found = alike.pairs(entries, prefer)
    values, doubt = found.values(), found.doubt
    shape = np.broadcast_shapes((1, 1, 1, len(target)), *(np.shape(v) for v in values))
    q = np.stack([np.broadcast_to(v, shape).reshape(-1, len(target)).T for v in values], axis=2)
    if off:
        outside = [np.abs(pair.c * pair.c + pair.s * pair.s - 1.0) for pair in found.pairs if pair.s is not None]
        most = np.max(np.stack([np.broadcast_to(v, shape) for v in outside]), axis=0) if outside else np.zeros(shape)
        # what is not quite on the circle only because the arm is not quite of the class comes later
        doubt = doubt | ((most > 1e-12 + 10.0 * off) & (most < 100.0 * off))
    return q, np.asarray(np.broadcast_to(doubt, shape).reshape(-1, len(target)).any(axis=0))


def _fallback(arm: Arm, task: Task) -> Callable[[Array], Array] | None:
    """What solves doubtful poses without a special class: rows (N, B, n) of joint values, or None."""
    if task.name == "pose" and arm.n == 6:

        @cache
        def prepared() -> Geometry:
            geometry = general.recognise(arm, task)
            assert geometry is not None
            return geometry

        def elimination(target: Array) -> Array:
            rows = prepared().rows
            assert rows is not None
            return rows(target)[0]

        return elimination
    if task.name == "xyz":
        quartic = Position(Chain(arm.link, arm.prismatic), arm.link[3][:3, 3], 0.0)
        geometry = Geometry("", "", False, lambda goal, prefer: Candidates(*quartic.solve(goal, prefer)))
        return lambda target: _seeds(arm, task, geometry, target)[0]
    return None


def _solve(
    arm: Arm, task: Task, alike: Geometry, off: float, other: Callable[[Array], Array] | None, target: Array
) -> tuple[Array, Bool]:
    """Branches (N, B, n) and doubts (N,) of some targets; the similar arm's branches keep their places."""
    found = _correct(arm, task, alike, off, target)
    good = found.size <= ACCEPTED
    q = np.where(good[:, :, None], found.q, np.nan)
    few = np.flatnonzero(found.doubt)
    if not len(few):
        return q, found.doubt
    extra = _beside(arm, task, found.q[few], target[few]) if other is None else other(target[few])
    more = np.concatenate([found.q[few], extra], axis=1)
    B, flat = more.shape[1], more.reshape(-1, arm.n).copy()
    goals = np.repeat(target[few], B, axis=0)
    some = np.flatnonzero(numeric.missing(arm, task, flat, goals) < HOPELESS)
    size = np.full(len(flat), np.inf)
    flat[some], size[some] = numeric.correct(arm, task, flat[some], goals[some], steps=20)
    flat[size > 1e-6] = np.nan
    more = flat.reshape(-1, B, arm.n)
    own = found.q.shape[1]
    # what the other method has found again keeps the seed's place and name
    with np.errstate(invalid="ignore"):
        for i in range(own, B):
            again = numeric.wrapped_distance(arm, more[:, :i], more[:, i : i + 1]) < 1e-6
            more[again.any(axis=1), i] = np.nan
    new = ~np.isnan(more[:, own:, 0])
    order = own + np.argsort(~new, axis=1, kind="stable")[:, : int(new.sum(axis=1).max())]
    more = np.concatenate([more[:, :own], np.take_along_axis(more, order[:, :, None], axis=1)], axis=1)
    out = np.full((len(target), more.shape[1], arm.n), np.nan)
    out[:, :own] = q
    out[few] = more
    return out, found.doubt


def _beside(arm: Arm, task: Task, q: Array, target: Array) -> Array:
    """Seeds for the other of two branches that all but touch: q (N, B, n) moved both ways where it is weakest."""
    N, B, n = q.shape
    flat = np.nan_to_num(q.reshape(-1, n))
    _, V, _ = numeric.null_space(arm, task, flat, np.repeat(target, B, axis=0))
    push = V[:, -1] * np.where(arm.prismatic, arm.reach, 1.0)
    moved = [flat + size * push for size in (0.6, -0.6, 0.1, -0.1, 0.01, -0.01)]
    return np.stack(moved, axis=1).reshape(N, 6 * B, n)


def _correct(arm: Arm, task: Task, alike: Geometry, off: float, target: Array) -> _Corrected:
    """Move the seeds onto the arm, and find the poses for which that may not be all."""
    seed, doubt = _seeds(arm, task, alike, target, off)
    N, B, n = seed.shape
    goals = np.repeat(target, B, axis=0)
    flat = seed.reshape(-1, n)
    rough = numeric.missing(arm, task, flat, goals)
    some = np.flatnonzero(rough < HOPELESS)
    q, size, strength = flat.copy(), np.full(N * B, np.inf), np.ones(N * B)
    q[some], size[some], strength[some] = numeric.newton(arm, task, flat[some], goals[some], steps=6)
    good = size <= ACCEPTED
    with np.errstate(invalid="ignore"):
        moved = numeric.wrapped_distance(arm, q, flat) > np.sqrt(off)
    weak = min(0.05, 1.5 * np.sqrt(off)) + 1e-6
    unsure = np.where(good, moved | (strength < weak), rough < 1e-9 + 30.0 * off)
    doubt = doubt | unsure.reshape(N, B).any(axis=1)
    branch, good = q.reshape(N, B, n), good.reshape(N, B)
    for i in range(B):
        for j in range(i):
            with np.errstate(invalid="ignore"):
                same = numeric.wrapped_distance(arm, branch[:, i], branch[:, j]) < 1e-6
            doubt |= same & good[:, i] & good[:, j]
    return _Corrected(branch, size.reshape(N, B), doubt)
