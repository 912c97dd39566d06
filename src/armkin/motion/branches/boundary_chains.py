"""Joins chains of branches that meet on a boundary of the workspace.

Two branches share one posture where a path begins, ends or turns exactly on a boundary, for example with the arm
stretched. Linking gives that posture to one of the two; the chain of the other ends a few micrometres before it. This
module extends the chains to the shared posture and lets each continue as the other.
"""

from __future__ import annotations

from itertools import islice, product
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.inverse.answers.solutions import Status
from armkin.motion.branches.branch_chains import BranchChain
from armkin.motion.branches.branch_columns import BranchColumns
from armkin.motion.branches.joint_steps import chord_bound, joint_change, levers, whole_turns
from armkin.motion.branches.linked_branches import END_ACCURACY

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_END_DISTANCE = 10 * END_ACCURACY  # greatest distance [mm] from a chain's end to the boundary
_SAME_END = 1e-3  # joint distance [rad | mm] below which two chain ends are joined
_SAME_POSTURE = 1e-4  # joint distance [rad | mm] below which two postures are the same
_MAX_BOUNDARIES = 8  # a path along a boundary has thousands of such samples, and its chains do not end there
_MAX_CHAINS = 64  # every boundary may multiply the chains; those through the most boundaries are dropped


def add_boundary_chains(
    arm: Arm, columns: BranchColumns, chains: list[BranchChain], fixed: Array | None, tolerance: float
) -> list[BranchChain]:
    """The chains and those joined from them at boundaries; fixed: (n,) the posture at the start, or None."""
    s, last = columns.s, len(columns.s) - 1
    result = chains = _bridge_pairs(s, chains, tolerance)
    if not last:
        return result
    postures = columns.q[0][columns.valid[0]] if fixed is None else fixed[None]
    result = _add_new_chains(
        result, [part for chain in chains for part in _chains_from(s, chain, 0, postures, tolerance)]
    )
    for boundary in _boundary_samples(columns, chains):
        postures = columns.q[boundary][columns.valid[boundary]]
        arriving_chains = [part for chain in result for part in _chains_to(s, chain, boundary, postures, tolerance)]
        # A chain joined at an earlier boundary continues as one of `chains`, so these are all that leave.
        leaving_chains = [part for chain in chains for part in _chains_from(s, chain, boundary, postures, tolerance)]
        new_chains = (_join_chains(a, b) for a, b in product(arriving_chains, leaving_chains) if _are_consecutive(a, b))
        result += islice(new_chains, max(_MAX_CHAINS - len(result), 0))
    postures = columns.q[last][columns.valid[last]]
    return _add_new_chains(
        result, [part for chain in result for part in _chains_to(s, chain, last, postures, tolerance)]
    )


def _boundary_samples(columns: BranchColumns, chains: list[BranchChain]) -> list[int]:
    """The inner samples on a boundary near which a chain ends; an empty list if there are too many."""
    ends = np.unique([sample for chain in chains for sample in (chain.first, chain.last)])
    boundary_rows = np.flatnonzero(columns.status[1:-1] == Status.BOUNDARY) + 1
    near_ends = [
        row
        for row in boundary_rows.tolist()
        if len(ends) and np.abs(columns.s[ends] - columns.s[row]).min() <= _END_DISTANCE
    ]
    return near_ends if len(near_ends) <= _MAX_BOUNDARIES else []


def _add_new_chains(chains: list[BranchChain], new_chains: list[BranchChain]) -> list[BranchChain]:
    """The chains, and those of `new_chains` that are not among them."""
    return chains + [chain for chain in new_chains if chain not in chains]


def _bridge_pairs(s: Array, chains: list[BranchChain], tolerance: float) -> list[BranchChain]:
    """The chains and, for each pair that a straight wrist has cut in two, their union.

    Joints 4 and 6 are undetermined exactly where the wrist is straight: the first chain ends a few micrometres before
    that sample and the second begins behind it, at nearly the same joint values.
    """
    result = list(chains)
    for a in chains:
        successors = [
            b for b in result if a.last < b.first and s[b.first] - s[a.last] <= _END_DISTANCE and len(b.q) > 1
        ]
        for b in successors[:_MAX_BOUNDARIES] if len(a.q) > 1 else []:
            step = joint_change(a.arm, a.q[-1], b.q[0])
            if np.abs(step).max() > _SAME_END or float(chord_bound(levers(a.arm), step)) > tolerance:
                continue
            share = (s[a.last + 1 : b.first + 1] - s[a.last]) / (s[b.first] - s[a.last])
            q_between = a.q[-1] + share[:, None] * step
            labels = np.concatenate([a.labels, np.repeat(b.labels[:1], len(share))])
            result.append(_join_chains(BranchChain(a.arm, a.first, np.concatenate([a.q, q_between]), labels), b))
    return result


def _chains_to(s: Array, chain: BranchChain, end: int, postures: Array, tolerance: float) -> list[BranchChain]:
    """A chain up to sample `end`: its part up to there, or its extensions to each of the postures there."""
    if chain.first < end <= chain.last:
        size = end + 1 - chain.first
        return (
            [chain] if chain.last == end else [BranchChain(chain.arm, chain.first, chain.q[:size], chain.labels[:size])]
        )
    gap = s[end] - s[chain.last]
    if chain.last > end or gap > _END_DISTANCE:
        return []
    # near a boundary joint values change as a square root of the distance
    share = 1 - ((s[end] - s[chain.last + 1 : end + 1]) / gap) ** 0.5
    extended = []
    for step in _certified_steps(chain, chain.q[-1], postures, tolerance):
        labels = np.concatenate([chain.labels, np.repeat(chain.labels[-1:], end - chain.last)])
        q = np.concatenate([chain.q, chain.q[-1] + share[:, None] * step])
        extended.append(BranchChain(chain.arm, chain.first, q, labels))
    return extended


def _chains_from(s: Array, chain: BranchChain, start: int, postures: Array, tolerance: float) -> list[BranchChain]:
    """A chain from sample `start` on, found as the end of the reversed chain."""
    if chain.first == start < chain.last:
        return [chain]
    N = len(s)
    extended = _chains_to(-s[::-1], _reverse_chain(chain, N), N - 1 - start, postures, tolerance)
    return [_reverse_chain(reverse, N) for reverse in extended]


def _reverse_chain(chain: BranchChain, N: int) -> BranchChain:
    """The chain in the opposite direction of travel; N: the number of samples of the route."""
    return BranchChain(chain.arm, N - 1 - chain.last, chain.q[::-1], chain.labels[::-1])


def _certified_steps(chain: BranchChain, q: Array, postures: Array, tolerance: float) -> list[Array]:
    """Joint steps (n,) from q to those postures that are certified to be on the same branch."""
    lever = levers(chain.arm)
    steps = [joint_change(chain.arm, q, posture) for posture in postures]
    return [step for step in steps if float(chord_bound(lever, step)) <= tolerance]


def _are_consecutive(a: BranchChain, b: BranchChain) -> bool:
    """Whether a chain begins where another ends, and is not its own continuation."""
    step = joint_change(a.arm, a.q[-1], b.q[0])
    same_chain = np.shares_memory(a.q, b.q)  # views of the same array
    return not same_chain and float(np.abs(step).max()) < _SAME_POSTURE


def _join_chains(a: BranchChain, b: BranchChain) -> BranchChain:
    """Chain a followed by chain b, which begins at the last sample of a."""
    turns = np.where(a.arm.prismatic, 0.0, whole_turns(a.arm))
    offset = turns * np.rint((a.q[-1] - b.q[0]) / whole_turns(a.arm))
    return BranchChain(
        a.arm, a.first, np.concatenate([a.q, b.q[1:] + offset]), np.concatenate([a.labels, b.labels[1:]])
    )
