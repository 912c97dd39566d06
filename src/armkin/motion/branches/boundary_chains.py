"""Chains of branches that meet on a boundary: both go on to the posture there, and from it.

Where a path begins, ends or turns exactly on a boundary, an arm stretched for example, two branches have one posture
there, which is linked to one of them. The other one's chain ends a few micrometres before.
"""

from __future__ import annotations

from itertools import islice, product
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.inverse.answers.solutions import Status
from armkin.motion.branches.branch_chains import Chain
from armkin.motion.branches.branch_columns import Columns
from armkin.motion.branches.joint_steps import chord_bound, joint_change, levers, whole_turns
from armkin.motion.branches.linked_branches import END_ACCURACY

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_END_DISTANCE = 10 * END_ACCURACY  # distance [mm] of a chain's end before the boundary
_SAME_END = 1e-3  # distance [rad | mm] between the ends of two chains that are one
_SAME_POSTURE = 1e-4  # distance [rad | mm] between two postures that are one
_MAX_BOUNDARIES = 8  # boundaries on the way, at most: a path along one has thousands, and its chains go on anyway
_MAX_CHAINS = 64  # chains, at most, as every boundary may multiply them: what goes through one more boundary comes last


def add_boundary_chains(
    arm: Arm, columns: Columns, chains: list[Chain], fixed: Array | None, tolerance: float
) -> list[Chain]:
    """Chains, and those that more of them make where they meet; fixed: (n,) the posture at the start, or None."""
    s, end = columns.s, len(columns.s) - 1
    joined = chains = _bridge_pairs(s, chains, tolerance)
    if not end:
        return joined
    postures = columns.q[0][columns.valid[0]] if fixed is None else fixed[None]
    joined = _add_new_chains(joined, [part for c in chains for part in _chains_from(s, c, 0, postures, tolerance)])
    for j in _boundary_samples(columns, chains):
        postures = columns.q[j][columns.valid[j]]
        arriving = [part for c in joined for part in _chains_to(s, c, j, postures, tolerance)]
        # Beyond it, what was joined at a boundary before it is what its last part was: `chains` has that.
        leaving = [part for c in chains for part in _chains_from(s, c, j, postures, tolerance)]
        ways = (_join_chains(a, b) for a, b in product(arriving, leaving) if _are_consecutive(a, b))
        joined += islice(ways, max(_MAX_CHAINS - len(joined), 0))
    postures = columns.q[end][columns.valid[end]]
    return _add_new_chains(joined, [part for c in joined for part in _chains_to(s, c, end, postures, tolerance)])


def _boundary_samples(columns: Columns, chains: list[Chain]) -> list[int]:
    """Samples between start and end on a boundary beside which a chain ends; none where they are many."""
    ends = np.unique([sample for c in chains for sample in (c.first, c.last)])
    inner = np.flatnonzero(columns.status[1:-1] == Status.BOUNDARY) + 1
    rows = [j for j in inner.tolist() if len(ends) and np.abs(columns.s[ends] - columns.s[j]).min() <= _END_DISTANCE]
    return rows if len(rows) <= _MAX_BOUNDARIES else []


def _add_new_chains(chains: list[Chain], new_chains: list[Chain]) -> list[Chain]:
    """Chains, and more that are not among them."""
    return chains + [c for c in new_chains if c not in chains]


def _bridge_pairs(s: Array, chains: list[Chain], tolerance: float) -> list[Chain]:
    """Chains, one of each two that are one way: where a wrist is straight exactly, its posture there is any.

    The first ends a few micrometres before it, the other one begins behind it, at nearly the same joint values.
    """
    bridged = list(chains)
    for a in chains:
        behind = [b for b in bridged if a.last < b.first and s[b.first] - s[a.last] <= _END_DISTANCE and len(b.q) > 1]
        for b in behind[:_MAX_BOUNDARIES] if len(a.q) > 1 else []:
            step = joint_change(a.arm, a.q[-1], b.q[0])
            if np.abs(step).max() > _SAME_END or float(chord_bound(levers(a.arm), step)) > tolerance:
                continue
            share = (s[a.last + 1 : b.first + 1] - s[a.last]) / (s[b.first] - s[a.last])
            between = a.q[-1] + share[:, None] * step
            labels = np.concatenate([a.labels, np.repeat(b.labels[:1], len(share))])
            bridged.append(_join_chains(Chain(a.arm, a.first, np.concatenate([a.q, between]), labels), b))
    return bridged


def _chains_to(s: Array, c: Chain, j: int, postures: Array, tolerance: float) -> list[Chain]:
    """A chain as far as sample j: the part that leads there, or it and what is between it and a posture there."""
    if c.first < j <= c.last:
        return [c] if c.last == j else [Chain(c.arm, c.first, c.q[: j + 1 - c.first], c.labels[: j + 1 - c.first])]
    gap = s[j] - s[c.last]
    if c.last > j or gap > _END_DISTANCE:
        return []
    share = 1 - ((s[j] - s[c.last + 1 : j + 1]) / gap) ** 0.5  # joints leave a boundary as roots do
    made = []
    for step in _certified_steps(c, c.q[-1], postures, tolerance):
        labels = np.concatenate([c.labels, np.repeat(c.labels[-1:], j - c.last)])
        made.append(Chain(c.arm, c.first, np.concatenate([c.q, c.q[-1] + share[:, None] * step]), labels))
    return made


def _chains_from(s: Array, c: Chain, j: int, postures: Array, tolerance: float) -> list[Chain]:
    """A chain from sample j on: that of the way back arrives there."""
    if c.first == j < c.last:
        return [c]
    N = len(s)
    back = _chains_to(-s[::-1], _reverse_chain(c, N), N - 1 - j, postures, tolerance)
    return [_reverse_chain(part, N) for part in back]


def _reverse_chain(c: Chain, N: int) -> Chain:
    """A chain as the way back has it, of N samples."""
    return Chain(c.arm, N - 1 - c.last, c.q[::-1], c.labels[::-1])


def _certified_steps(c: Chain, q: Array, postures: Array, tolerance: float) -> list[Array]:
    """From a chain's end to the postures that are certified to be on the same way: (n,) each."""
    lever = levers(c.arm)
    steps = [joint_change(c.arm, q, posture) for posture in postures]
    return [step for step in steps if float(chord_bound(lever, step)) <= tolerance]


def _are_consecutive(a: Chain, b: Chain) -> bool:
    """Whether a chain begins where another ends, and is not its own continuation."""
    step = joint_change(a.arm, a.q[-1], b.q[0])
    same = np.shares_memory(a.q, b.q)  # parts of one chain
    return not same and float(np.abs(step).max()) < _SAME_POSTURE


def _join_chains(a: Chain, b: Chain) -> Chain:
    """One chain and then another that begins at its last sample."""
    turns = np.where(a.arm.prismatic, 0.0, whole_turns(a.arm))
    offset = turns * np.rint((a.q[-1] - b.q[0]) / whole_turns(a.arm))
    return Chain(a.arm, a.first, np.concatenate([a.q, b.q[1:] + offset]), np.concatenate([a.labels, b.labels[1:]]))
