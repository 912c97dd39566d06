"""Which joint is the variable of the elimination, and which pencils solve an arm's poses, one after the other.

A role says which joint is hidden, the variable, and in which order the others go; roles are rated on known poses.
Most poses of an arm are alike, and one list of pencils serves them. Where axes 6 and 1 stand parallel or meet, tool up
or down above all, the usual roles are all but singular; such poses have a list of wide roles, made when one comes.
"""

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.elimination import closed_loop, roots
from armkin.inverse.elimination.closed_loop import Loop, Role, roles
from armkin.inverse.elimination.passes import TILT, run_pass
from armkin.inverse.elimination.pencil import Pencil, build_pencil
from armkin.inverse.elimination.polish import jacobian, refine, tip
from armkin.inverse.numeric import tolerances as tol
from armkin.model.rotation import inverse

PSI = (0.7321, -1.1879)  # offsets [rad] of the hidden joint; arbitrary, but never where people put their arms
SAMPLES = 11  # random poses on which roles are compared
OPEN_PART = 0.3  # share of poses left open from which on other roles are tried
STEEP = 30.0  # norm of the inverse Jacobian above which a posture says little of a role
STARTS = 20  # random postures from which a pose of a kind is sought, for each that is wanted
# log10 of a role's raw error: nothing better needed, good enough, unfit
EXCELLENT, HEALTHY, USELESS = -9.5, -8.0, -5.0


class Kind(IntEnum):
    """What a pose makes of axes 6 and 1."""

    PLAIN = 0
    PARALLEL = 1
    MEETING = 2


@dataclass(frozen=True, eq=False)
class Elimination:
    """A 6-joint chain prepared for `solve`: read-only, so that threads may share it.

    loop: the scaled chain.  plans: the pencils of the main pass and of the passes for poses that it leaves
    open; none if three joints are prismatic.  score: log10 of the main pencil's raw error.
    """

    loop: Loop
    plans: tuple[Pencil, ...]
    score: float

    @property
    def complete(self) -> bool:
        """Whether the completeness argument of `method`'s text holds: a regular pencil was found."""
        return self.score < HEALTHY

    def pencils_of_kind(self, kind: Kind) -> tuple[Pencil, ...]:
        """The pencils of poses of a kind."""
        if kind not in self._known:
            self._known[kind] = _of_special_poses(self, kind)
        return self._known[kind]

    @cached_property
    def _known(self) -> dict[Kind, tuple[Pencil, ...]]:
        return {Kind.PLAIN: self.plans}


def pose_kinds(loop: Loop, goal: Array) -> Int:
    """The `Kind` of poses (N, 4, 4) of the loop's chain, (N,): all but parallel counts as parallel."""
    kind = np.zeros(len(goal), np.int64)
    if loop.prismatic[[0, 5]].any():
        return kind
    x, y = goal[:, 0, 2], goal[:, 1, 2]  # direction of axis 6; axis 1 is z
    sine = np.hypot(x, y)
    distance = np.abs(goal[:, 0, 3] * y - goal[:, 1, 3] * x) / np.maximum(sine, tol.TINY)
    kind[distance < tol.BESIDE_SPECIAL] = Kind.MEETING
    kind[sine < tol.BESIDE_SPECIAL] = Kind.PARALLEL
    return kind


def prepare(link: Array, prismatic: Bool) -> Elimination:
    """Choose how to walk a chain ``link[0] Z1(q1) link[1] ... Z6(q6) link[6]``.

    Args:
        link: (7, 4, 4) [mm].
        prismatic: (6,): Z is a shift along z instead of a turn about it.
    """
    loop = closed_loop.close_loop(link, prismatic)
    if np.sum(prismatic) >= 3:
        return Elimination(loop, (), -np.inf)
    rng = np.random.default_rng(5)
    q = rng.uniform(-np.pi, np.pi, (SAMPLES, 6))
    q[:, prismatic] = rng.uniform(-1, 1, (SAMPLES, int(np.sum(prismatic))))
    goal, size = sample_poses(loop, q)
    # Collinear axes, say: no solution is isolated and no role can do better.
    redundant = bool(np.all(size < tol.RANK_VALUE))
    rated: list[_Rating] = []
    # The first slots nearly always do; some arms with two prismatic joints need the others.
    for slot, hidden in _SEARCH:
        rated += [_rate(loop, role, q, goal) for role in roles(loop.prismatic, slot, hidden)]
        if _enough_roles(rated, redundant, len(hidden) > 1):
            break
    rated.sort(key=lambda rating: rating.cost)
    if not redundant and (rated[0].error >= HEALTHY or rated[0].left_open > OPEN_PART):  # beside a spherical wrist, say
        for slot, hidden in _WIDE_SEARCH:
            rated += [_rate(loop, role, q, goal) for role in roles(loop.prismatic, slot, hidden, wide=True)]
        rated.sort(key=lambda rating: rating.cost)
    return Elimination(loop, _pencil_sequence(loop, rated), rated[0].error)


def sample_poses(loop: Loop, q: Array) -> tuple[Array, Array]:
    """Poses (N, 4, 4) of the loop's chain at q (N, 6), and their Jacobians' smallest singular values (N,)."""
    frame, joints = tip(loop.chain, loop.prismatic, np.ascontiguousarray(q.T))
    goal = np.tile(np.eye(4), (len(q), 1, 1))
    goal[:, :3] = np.moveaxis(frame, -1, 0)
    size = np.linalg.svd(jacobian(frame, joints, loop.prismatic), compute_uv=False)
    return goal, np.asarray(size[:, -1], np.float64)


def _pencil_sequence(loop: Loop, rated: "list[_Rating]") -> tuple[Pencil, ...]:
    """The pencils of all passes, from ratings in their order."""
    first = rated[0].pencil
    alternatives = [rating.pencil for rating in rated[1:] if rating.error < USELESS]
    # Equal roots of one joint are rarely equal in another: hide another joint early.
    alternatives.sort(key=lambda pencil: pencil.hidden_joint == first.hidden_joint)
    other_offset = build_pencil(first.role, loop.links, loop.prismatic, PSI[1])
    plans = [first, *alternatives[:1], other_offset, *alternatives[1:]]
    while len(plans) < len(tol.SHAKES):
        plans.append(plans[-2])
    return tuple(plans[: len(tol.SHAKES)])


def _of_special_poses(elimination: Elimination, kind: Kind) -> tuple[Pencil, ...]:
    """Pencils for poses of a kind: those of all others if they do, else the best of these and of wide ones."""
    loop = elimination.loop
    q = _special_postures(loop, kind)
    if len(q) < SAMPLES:  # the arm cannot stand there
        return elimination.plans
    goal = sample_poses(loop, q)[0]
    plain_pencils = list({id(pencil): pencil for pencil in elimination.plans}.values())
    rated = [_rate(loop, pencil.role, q, goal) for pencil in plain_pencils if pencil.psi == PSI[0]]
    if rated[0].error < HEALTHY:
        return elimination.plans
    for slot, hidden in _WIDE_SEARCH:
        rated += [_rate(loop, role, q, goal) for role in roles(loop.prismatic, slot, hidden, wide=True)]
        if len([rating for rating in rated if rating.error < EXCELLENT]) >= 3:
            break
    rated.sort(key=lambda rating: rating.cost)
    return _pencil_sequence(loop, rated)


def _special_postures(loop: Loop, kind: Kind) -> Array:
    """Regular postures (N, 6) at random poses of a kind, at most `SAMPLES`."""
    rng = np.random.default_rng(7)
    count = SAMPLES * STARTS
    q = rng.uniform(-np.pi, np.pi, (2, count, 6))
    q[:, :, loop.prismatic] /= np.pi
    goal = sample_poses(loop, q[0])[0]
    if kind is Kind.PARALLEL:
        c, s = np.cos(q[0, :, 0]), np.sin(q[0, :, 0])
        axis_sign = np.where(rng.random(count) < 0.5, 1.0, -1.0)
        goal[:, :3, :3] = 0.0
        goal[:, 0, 0], goal[:, 1, 0], goal[:, 2, 2] = c, s, axis_sign
        goal[:, 0, 1], goal[:, 1, 1] = -s * axis_sign, c * axis_sign
    else:
        radial = goal[:, :2, 2] / np.linalg.norm(goal[:, :2, 2], axis=1, keepdims=True)
        goal[:, :2, 3] = radial * np.linalg.norm(goal[:, :2, 3], axis=1, keepdims=True)
    polished = refine(loop.chain, loop.prismatic, q[1], goal, 20, damped=True)
    is_regular = (polished.residual < tol.ELIMINATED) & (polished.weakness < STEEP)
    return polished.q[is_regular][:SAMPLES]


class _Rating(NamedTuple):
    """How well a role does on an arm: the raw error is the 90th percentile of log10 over random poses."""

    cost: float
    error: float
    left_open: float  # share of these poses
    pencil: Pencil


# Where the pose is carried (slot of `Role`) and which of m1, m2, m3 is hidden, in the order of trial.
_SEARCH: list[tuple[int, tuple[int, ...]]] = [
    *((slot, (0,)) for slot in (1, 0, 5)),
    *((slot, (1, 2)) for slot in (1, 0, 5)),
    *((slot, (0, 1, 2)) for slot in (2, 3, 4)),
]
_WIDE_SEARCH = _SEARCH[:6]


def _enough_roles(rated: list[_Rating], redundant: bool, last: bool) -> bool:
    """Whether to try no more roles: three quick, exact ones of two joints, or, the quick ones known, any good."""
    sound = [r for r in rated if r.error < EXCELLENT and r.left_open < OPEN_PART and r.pencil.size <= 16]
    if len(sound) >= 3 and len({rating.pencil.hidden_joint for rating in sound}) >= 2:
        return True
    tried_all = last or any(rating.pencil.role.slot == 5 for rating in rated)
    return tried_all and (redundant or any(rating.error < HEALTHY for rating in rated))


def _rate(loop: Loop, role: Role, q: Array, goal: Array) -> _Rating:
    """Try a role on poses (N, 4, 4) of known joints (N, 6)."""
    pencil = build_pencil(role, loop.links, loop.prismatic, PSI[0])
    seeds = roots.root_seeds(pencil, inverse(goal), TILT[0], part=pencil.role.wide)
    change = np.abs(seeds.q - q[seeds.pose])
    turn = np.abs(np.mod(change + np.pi, 2 * np.pi) - np.pi)
    distance = np.where(loop.prismatic, change, turn).max(axis=1, initial=0.0)
    nearest = np.ones(q.shape[0])
    np.minimum.at(nearest, seeds.pose, distance)
    if np.median(nearest[:3]) > 1e-2:  # a role that the arm makes singular loses every pose
        return _Rating(20.0 + pencil.size, 0.0, 1.0, pencil)
    error = float(np.quantile(np.log10(nearest + tol.ERROR_FLOOR), 0.9))
    left_open = float(np.mean(run_pass(loop, pencil, goal, 0)[1])) if error < HEALTHY else 1.0
    # Below 1e-11 accuracy buys nothing; size and open poses cost time; a constant N (slot Lb) saves some.
    cost = max(error, -11.0) + 0.15 * pencil.size + 4 * left_open - 0.5 * (role.slot == 1)
    return _Rating(cost, error, left_open, pencil)
