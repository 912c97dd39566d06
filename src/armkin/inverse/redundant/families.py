"""One joint more than the target asks for: curves of answers, as intervals of the redundant joint.

The redundant joint is the last or the first one, whichever leaves a closed form. Its motion only moves the target of
the other joints, T = Z(q) T' or T' Z(q), so one solver, prepared once, answers every value of it. A family is a piece
of a curve of answers along which the joint is monotone; a row is a legal interval of one. The curves are known by the
arm angle (`arm_angle`), or followed along the joint (`followed_branches`). Where the joint turns about the tool's z
axis, which alone is asked for, each branch of the others is one.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.formula import arrays
from armkin.formula.array_tuples import rows_of
from armkin.formula.arrays import Array, Bool, Int, numbers_within, wrap_angle
from armkin.inverse.answers import rounding as target_rounding
from armkin.inverse.answers.batch import Batch, Goals, as_solutions
from armkin.inverse.answers.solutions import Ik, Solutions, Status
from armkin.inverse.branches.whole_turns import nearest_row
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.arm_angle import Turning, arm_angle
from armkin.inverse.redundant.boundaries import boundaries
from armkin.inverse.redundant.curve_starts import PLANES
from armkin.inverse.redundant.followed_branches import SAMPLES, Followed
from armkin.inverse.redundant.interval_pieces import Known, Pieces, golden_section, motion, vertex
from armkin.inverse.redundant.other_joints import Follower
from armkin.inverse.redundant.traced_families import Traced, trace_families
from armkin.inverse.solvers.choose_redundant_joint import Redundancy, move_targets, nearly_closed
from armkin.inverse.tasks.task import Task, distance, flat_targets, read_near, read_targets
from armkin.keep_out.clearance import hits_nothing
from armkin.model import units
from armkin.model.arm import Arm, actual_arm
from armkin.model.limits import outside_limits

AT_ONCE = 96_000  # targets of the other joints solved together
CIRCLES = 256  # targets whose arm angles are worked on together
TRACED = 1000  # targets whose curves are traced together
SEARCH_STEPS = 300  # steps, at most, onto what a search is near: of 45 such postures 60 steps end one, 200 ten
FREE_STEP = np.deg2rad(0.1)  # step [rad] of the parameter between postures that are asked whether they are free

# The answers of some targets N, as curves with a parameter: all their `pieces`; whether no curve can be missing,
# `complete` (N,), and whether no joint moves by REACH along any, `short` (N,); `steps` of the golden section.
Curves = Turning | Followed | Traced | Known
CurvesOf = Callable[[Follower], Iterator[Curves]]  # the curves of all targets, some at a time


def families(
    ik: Ik,
    arm: Arm,
    redundant: Redundancy,
    targets: ArrayLike,
    near: ArrayLike | None,
    rounding: ArrayLike | None,
    curves_of: CurvesOf | None = None,
) -> Solutions:
    """Legal intervals of the redundant joint, and families without one: `armkin.ik` of such an arm.

    q: (..., B, n) of each the posture nearest to near; `Solutions.interval`: (..., B, 2) [rad]. curves_of: by
    default `curves_in_numpy`.
    """
    if redundant.about_tool_axis:
        return _with_tool_turn(ik, arm, redundant, targets, near, rounding)
    task = redundant.task
    values, single = arrays.real_array(targets, "targets"), arrays.is_single(targets)
    goal, batch_shape, defect = read_targets(task, values)
    reference = read_near(arm, near, batch_shape)
    nears = np.broadcast_to(reference.reshape(-1, arm.n), (len(goal), arm.n))
    numbers = (flat_targets(task, values)[0], defect)
    roundings, limit = target_rounding.of_targets(arm, task, goal, numbers, single, rounding, batch_shape)
    stands = (newton.misses(arm, task, nears, goal) <= limit) & ~outside_limits(arm, nears).any(axis=1)
    rows = _Rows(arm, redundant.joint, nears, stands)
    follower = Follower(ik, arm, redundant, goal, nears)
    for curves in (curves_of or curves_in_numpy)(follower):
        rows.add(curves)
    rows.add_points(task, goal, not redundant.by_formula)
    q, interval, legal, branch = rows.stack_parts()
    valid = branch >= 0
    status = np.where(valid.any(axis=1), np.where(rows.short, Status.BOUNDARY, Status.EXACT), Status.UNREACHABLE)
    names = _branch_names(follower, 1 + int(branch.max(initial=-1)))
    method, why, _ = method_of_families(arm, redundant)
    batch = Batch(q, valid, legal, branch, status.astype(np.int8), np.zeros(nears.shape, bool), rows.complete)
    s = as_solutions(Goals(arm, task, goal, nears), reference, batch_shape, batch, roundings, (names, method, why))
    return replace(s, interval=interval.reshape(*s.valid.shape, 2))


def curves_in_numpy(follower: Follower) -> Iterator[Curves]:
    """The curves of all targets, some at a time: by the arm angle, followed along the redundant joint, or traced."""
    srs = arm_angle(follower.arm) if follower.redundant.joint else None
    followed = AT_ONCE // SAMPLES if follower.redundant.by_formula else TRACED
    for rows in arrays.slices(len(follower.target), CIRCLES if srs else followed):
        part = follower.of(rows)
        if srs:
            yield Turning.along(srs, part.target, part.near)
        elif part.redundant.by_formula:
            yield Followed.along(part)
        else:
            yield from trace_families(part)


def _branch_names(follower: Follower, count: int) -> tuple[str, ...]:
    """Names of branches, as many as count: those of the other joints', then numbers."""
    ik, _, redundant, target, _ = follower
    goal = move_targets(follower.arm, redundant, target[:1], np.zeros(len(target[:1])))
    names = ik(redundant.rest, goal, redundant.task.name, examine=False).names if len(target) else ()
    return names + tuple(f"branch {i + 1}" for i in range(len(names), count))


def _with_tool_turn(
    ik: Ik, arm: Arm, redundant: Redundancy, targets: ArrayLike, near: ArrayLike | None, rounding: ArrayLike | None
) -> Solutions:
    """The branches of the others, which the redundant joint's motion leaves as they are: each is a family."""
    r = redundant.joint
    batch_shape = flat_targets(redundant.task, arrays.real_array(targets, "targets"))[1]
    reference = read_near(arm, near, batch_shape)
    s = ik(redundant.rest, targets, redundant.task.name, near=np.delete(reference, r, axis=-1), rounding=rounding)
    reference = np.broadcast_to(reference, (*batch_shape, arm.n)).copy()
    value = np.clip(reference[..., r], arm.lower[r], arm.upper[r])[..., None]
    turns = arm.upper[r] - arm.lower[r] >= 2 * np.pi
    interval = np.full((*s.valid.shape, 2), np.nan)
    interval[s.valid] = [-np.pi, np.pi] if turns else [arm.lower[r], arm.upper[r]]
    method, why, _ = method_of_families(arm, redundant)
    q, free = np.insert(s.q, r, np.where(s.valid, value, np.nan), axis=-1), np.insert(s.free, r, False, axis=-1)
    status = np.where(s.status == Status.BOUNDARY, np.int8(Status.EXACT), s.status)  # a family moves the joint
    return replace(
        s, arm=arm, task=redundant.task, near=reference, method=method, why=why,
        q=q, free=free, status=status, interval=interval,
    )  # fmt: skip


def method_of_families(arm: Arm, redundant: Redundancy) -> tuple[str, str, bool]:
    """The method of an arm with a redundant joint, why, and whether it guarantees all families."""
    joint, name = arm.joint_names[redundant.joint], redundant.geometry.name
    if redundant.about_tool_axis:
        why = f"{joint} turns about the tool's axis: ik lists the interval of its values; the others: "
        return f"families of {joint}", why + redundant.geometry.why, redundant.geometry.complete
    actual, complete = actual_arm(arm), False
    if redundant.joint and arm_angle(actual) is not None:
        manner, complete = "in closed form by the arm angle", True
    elif redundant.joint and redundant.by_formula and boundaries(actual) is not None:
        manner, complete = f"{name}, between all values of it where a limit or a merging may be", True
    elif redundant.by_formula:
        manner = f"{name}, at {SAMPLES} values of it"
    else:
        guide = nearly_closed(actual, redundant)
        name = name if guide is redundant else f"near {guide.geometry.name}"
        manner = f"{name}, at {PLANES} values of {arm.joint_names[guide.joint]}, and traced between them"
    why = f"{joint} is redundant: ik lists the intervals of its values; the others: {manner}"
    return f"families of {joint}", why, complete


class _Rows:
    """Answers of N targets, chunk after chunk."""

    def __init__(self, arm: Arm, joint: int, near: Array, stands: Bool) -> None:
        """near: (N, n); stands: (N,) it is within limits and solves its target."""
        self.arm, self.joint = arm, joint
        self.near, self.stands = near, stands
        self.complete, self.short, self.has_near = (np.zeros(len(near), bool) for _ in range(3))
        none = np.zeros(0, np.intp)
        self.parts: list[tuple[Int, Array, Array, Bool, Int]] = [(none, near[:0], np.zeros((0, 2)), none > 0, none)]
        self.added = 0  # targets

    def add(self, curves: Curves) -> None:
        """Add the curves of the targets that follow."""
        pieces, begin = curves.pieces, self.added
        self.added += len(curves.complete)
        rows = slice(begin, self.added)
        self.complete[rows], self.short[rows] = curves.complete, curves.short
        near = self.near[begin + pieces.row]
        q = curves.nearest.copy() if isinstance(curves, Known) else _nearest_postures(self.arm, curves, near)
        if isinstance(curves, Traced):
            q = curves.without_residual(pieces, q)
        near_rows = np.flatnonzero(self.stands[begin + pieces.row])
        q[near_rows] = _with_near(self.arm, self.joint, rows_of(pieces, near_rows), q[near_rows], near[near_rows])
        self.has_near[begin + pieces.row[(q == near).all(axis=1)]] = True
        if self.arm.keep_out and not isinstance(curves, Known):
            q = _with_free_postures(self.arm, curves, q, near)
        full_turn = pieces.b - pieces.a > 2 * np.pi - tol.SAME_END
        ends = np.stack([pieces.a, pieces.b], axis=1)
        # the interval is shifted by whole turns to where the posture lies
        ends += (2 * np.pi) * np.round((q[:, self.joint] - ends.mean(axis=1)) / (2 * np.pi))[:, None]
        order = np.lexsort((~pieces.legal, pieces.row))
        interval = np.where(full_turn[:, None], [-np.pi, np.pi], ends)[order]
        self.parts.append((begin + pieces.row[order], q[order], interval, pieces.legal[order], pieces.branch[order]))

    def add_points(self, task: Task, target: Array, search: bool) -> None:
        """Add a posture that solves each target (N, ...) without a piece: near, or, to search, what many starts find.

        All postures of a stretched arm may lie within less than a sample, or be one. Near is added, too, where no legal
        piece holds it: its family may touch a limit there, and be within the limits nowhere else.
        """
        lone = np.flatnonzero(self.stands & ~self.has_near)
        q = self.near[lone]
        value = np.repeat(q[:, [self.joint]], 2, axis=1)
        self.parts.append((lone, q, value, np.ones(len(lone), bool), np.zeros(len(lone), np.intp)))
        empty = ~np.isin(np.arange(len(target)), np.concatenate([part[0] for part in self.parts]))
        sought = empty & search & (self.arm.prismatic.any() | (distance(self.arm, task, target) <= 1.0))
        for k in np.flatnonzero(sought).tolist():
            goal = target[[k]]
            q = newton.many_starts(self.arm, task, goal, np.ones(1, bool))[0]
            q = q[~np.isnan(q[:, 0])]
            q, miss = newton.correct(self.arm, task, q, np.repeat(goal, len(q), axis=0), SEARCH_STEPS)
            q = q[miss <= tol.SOLUTION]
            if len(q):
                q, legal = nearest_row(self.arm, q, np.broadcast_to(self.near[k], q.shape))
                nearest = int(np.lexsort((motion(self.arm, q, self.near[k]), ~legal))[0])
                value = np.full((1, 2), q[nearest, self.joint])
                self.parts.append((np.array([k]), q[[nearest]], value, legal[[nearest]], np.zeros(1, np.intp)))

    def stack_parts(self) -> tuple[Array, Array, Bool, NDArray[np.int8]]:
        """q (N, B, n), intervals (N, B, 2), whether legal and the branch (N, B), -1 where there is no row."""
        N, n = self.near.shape
        row, *columns = (np.concatenate(column) for column in zip(*self.parts, strict=True))
        order, count = np.argsort(row, kind="stable"), np.bincount(row, minlength=N)
        B = int(count.max(initial=0))
        cells = row[order], numbers_within(count)
        q, interval = np.full((N, B, n), np.nan), np.full((N, B, 2), np.nan)
        legal, branch = np.zeros((N, B), bool), np.full((N, B), -1, np.int8)
        for array, column in zip((q, interval, legal, branch), columns, strict=True):
            array[cells] = column[order]
        return q, interval, legal, branch


def _nearest_postures(arm: Arm, curves: Turning | Followed | Traced, near: Array) -> Array:
    """The postures (P, n) of pieces that move the joints least from near (P, n): golden section around the best sample,
    then where a joint stands as near has it.

    Of families without a legal posture they are that sample.
    """
    best = curves.pieces.start.copy()
    least = motion(arm, best, near)

    def costs(rows: Int, t: Array) -> Array:
        """Motion (R,) from near to the legal postures at t, inf where none is legal; better ones are kept."""
        q, legal = curves.at(rows_of(curves.pieces, rows), t)
        cost = np.where(legal, motion(arm, q, near[rows]), np.inf)
        is_better = cost < least[rows]
        best[rows[is_better]], least[rows[is_better]] = q[is_better], cost[is_better]
        return np.asarray(cost)

    rows = np.flatnonzero(curves.pieces.legal)
    if not len(rows):
        return best
    if isinstance(curves, Followed):  # other curves have samples here
        for t in curves.values_to_try(rows_of(curves.pieces, rows), near[rows]):
            costs(rows, t)
    # a sample beside which the motion grows both ways is at a kink or limit, and the nearest posture itself
    p = rows_of(curves.pieces, rows)
    side_costs = [costs(rows, p.at + tol.PROBE_SHARE * (end - p.at)) for end in (p.low, p.high)]
    rows = rows[np.minimum(*side_costs) < motion(arm, p.start, near[rows])]
    p = rows_of(curves.pieces, rows)
    low, high, middle, value = golden_section(lambda t: costs(rows, t), p.low, p.high, curves.steps)
    if len(rows):  # in what is left: by a secant where a joint passes its near, a kink of the motion; by a parabola
        q = [curves.at(p, t)[0] for t in (low, high)]
        ends = [end - near[rows] for end in q]
        passes = np.where(ends[0] * ends[1] < 0, np.abs(ends[1] - ends[0]), 0.0)
        index = np.arange(len(rows)), passes.argmax(axis=1)
        a, b = (end[index] for end in ends)
        costs(rows, np.where(a * b < 0, low + (high - low) * a / np.where(a == b, 1.0, a - b), low))
        at_low, at_high = (motion(arm, end, near[rows]) for end in q)
        costs(rows, vertex(low, middle, high, at_low, value, at_high))
    return best


def _with_near(arm: Arm, joint: int, pieces: Pieces, q: Array, near: Array) -> Array:
    """Postures (P, n) of pieces; near (P, n) that solves its target in place of the one nearest to it.

    It may be a posture with a joint that is free, or one that its target's rounding moves far.
    """
    middle, half_width = 0.5 * (pieces.a + pieces.b), 0.5 * (pieces.b - pieces.a)
    in_interval = np.abs(wrap_angle(near[:, joint] - middle)) <= half_width + tol.ROUNDING_DISTANCE
    cost = np.where(pieces.legal & in_interval, motion(arm, q, near), np.inf)
    postures = q.copy()
    for row in np.unique(pieces.row).tolist():
        members = np.flatnonzero(pieces.row == row)
        nearest = members[cost[members].argmin()]
        if np.isfinite(cost[nearest]):
            postures[nearest] = near[nearest]
    return postures


def _with_free_postures(arm: Arm, curves: Turning | Followed | Traced, q: Array, near: Array) -> Array:
    """The nearest postures (P, n) of legal pieces that hit nothing, to `FREE_STEP`; where there is none, q as it is."""
    freed, pieces = q.copy(), curves.pieces
    for p in np.flatnonzero(pieces.legal & ~hits_nothing(arm, q)):
        a, b = pieces.first[p], pieces.last[p]
        t = np.linspace(a, b, max(int((b - a) / FREE_STEP) + 2, 2))[1:-1]
        postures, legal = curves.at(rows_of(pieces, np.full(len(t), p)), t)
        is_free = legal & hits_nothing(arm, np.nan_to_num(postures))
        if is_free.any():
            freed[p] = postures[np.where(is_free, motion(arm, postures, near[p]), np.inf).argmin()]
    return freed


def intervals_out(s: Solutions) -> list[list[list[float]]] | None:
    """Intervals (N, B, 2) of the redundant joint [deg]; None where no joint is."""
    if s.interval is None:
        return None
    degrees: list[list[list[float]]] = units.angles_out(s.interval).tolist()
    return degrees
