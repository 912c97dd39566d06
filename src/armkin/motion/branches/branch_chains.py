"""Chains of linked branches, how far each carries within the limits, and the fewest runs that carry a route.

A chain is one branch over a range of samples with continuous joint values. Whole turns of a joint make copies of it;
on a run every joint keeps the copy that stays within its limits. A run ends where a joint meets its limit or where the
branch itself ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.answers.solutions import Status
from armkin.model.limits import SLACK
from armkin.motion.branches.branch_columns import BranchColumns
from armkin.motion.branches.joint_steps import whole_turns
from armkin.motion.branches.linked_branches import END_ACCURACY
from armkin.motion.plan.trajectory_proof import hit_samples as motion_hits

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.branches.wrist_window import Window


@dataclass(frozen=True, eq=False)
class BranchChain:
    """One branch over samples first .. first + len(q) - 1, continuous in its joint values."""

    arm: Arm
    first: int
    q: Array  # (len, n)
    labels: Int  # (len,) number of the branch's name, -1: none
    windows: tuple[Window, ...] = ()  # stretches on which the wrist passes a singularity

    @property
    def last(self) -> int:
        """Index of the chain's last sample."""
        return self.first + len(self.q) - 1

    @cached_property
    def extent(self) -> tuple[Array, Array]:
        """Least and greatest value of every joint: (n,) each."""
        return self.q.min(axis=0), self.q.max(axis=0)

    @cached_property
    def _copies(self) -> list[tuple[Array, Int | None]]:
        """Offsets (k,) of every joint's copies, and the next illegal sample of each copy from each sample: (k, len).

        None in place of the second: all copies are legal everywhere.
        """
        copies: list[tuple[Array, Int | None]] = []
        lowest, highest = self.extent
        turns = whole_turns(self.arm)
        for joint in range(self.arm.n):
            lower, upper, value = self.arm.lower[joint] - SLACK, self.arm.upper[joint] + SLACK, self.q[:, joint]
            offsets, turn = np.zeros(1), turns[joint]
            if not self.arm.prismatic[joint] and np.isfinite(lower) and np.isfinite(upper):
                first = np.ceil((lower - highest[joint]) / turn)
                last = np.floor((upper - lowest[joint]) / turn)
                offsets = turn * np.arange(first, last + 1)
            elif not self.arm.prismatic[joint] and (np.isfinite(lower) or np.isfinite(upper)):
                middle = np.rint((self.arm.home[joint] - value[0]) / turn)
                offsets = turn * (middle + np.arange(-2, 3))
            is_legal = (lowest[joint] + offsets >= lower) & (highest[joint] + offsets <= upper)
            if len(offsets) and is_legal.all():
                copies.append((offsets, None))
                continue
            next_illegal = np.full((len(offsets), len(value)), len(value))
            shifted_values = value + offsets[~is_legal, None]
            illegal = (shifted_values < lower) | (shifted_values > upper)
            illegal_sample = np.where(illegal, np.arange(len(value)), len(value))
            next_illegal[~is_legal] = np.minimum.accumulate(illegal_sample[:, ::-1], axis=1)[:, ::-1]
            copies.append((offsets, next_illegal))
        return copies

    @cached_property
    def _joint_reach(self) -> Int:
        """The first sample, counted from `first`, that each joint cannot reach from every sample: (len, n)."""
        N = len(self.q)
        sample = np.arange(N)  # a joint without a legal copy ends at the sample itself
        ends = [
            np.full(N, N) if end is None else np.maximum(sample, end.max(axis=0, initial=0)) for _, end in self._copies
        ]
        return np.stack(ends, axis=1)

    @cached_property
    def reach(self) -> Int:
        """The last sample that a run from each sample carries to, absolute; one less than itself: illegal. (len,)."""
        if self.hit_from is None and all(end is None for _, end in self._copies):
            return np.full(len(self.q), self.last)
        reach = self._joint_reach.min(axis=1)
        return np.asarray((reach if self.hit_from is None else np.minimum(reach, self.hit_from)) - 1 + self.first)

    @cached_property
    def hit_from(self) -> Int | None:
        """The first sample, counted from `first`, with a hit at or behind each sample: (len,); None: no hits."""
        is_hit = motion_hits(self.arm, self.q)
        if is_hit is None or not is_hit.any():
            return None
        samples = np.where(is_hit, np.arange(len(is_hit)), len(is_hit))
        return np.asarray(np.minimum.accumulate(samples[::-1])[::-1])

    def ends_by_hit(self, i: int) -> bool:
        """Whether a run from sample i ends because the arm hits something."""
        return self.hit_from is not None and self.hit_from[i - self.first] < self._joint_reach[i - self.first].min()

    def carries_to(self, i: int) -> int:
        """The last sample of a run from sample i; i - 1 if no run starts there."""
        return int(self.reach[i - self.first]) if self.first <= i <= self.last else i - 1

    def limiting_joint(self, i: int) -> int | None:
        """The joint whose limit ends a run from sample i; None: the chain itself ends."""
        ends = self._joint_reach[i - self.first]
        return int(ends.argmin()) if ends.min() < len(self.q) else None

    def joints(self, i: int, last: int, near: Array, fixed: Array | None = None) -> Array:
        """Joint values (last - i + 1, n) from sample i to `last`, in the legal copy nearest to `near` at sample i."""
        offsets, turns = np.zeros(self.arm.n), whole_turns(self.arm)
        for joint, (choices, ends) in enumerate(self._copies):
            value = self.q[i - self.first, joint]
            if not self.arm.prismatic[joint] and not np.isfinite([self.arm.lower[joint], self.arm.upper[joint]]).any():
                offsets[joint] = turns[joint] * np.rint((near[joint] - value) / turns[joint])
                continue
            legal_offsets = choices if ends is None else choices[ends[:, i - self.first] > last - self.first]
            nearest = near[joint] if fixed is None else fixed[joint]
            offsets[joint] = legal_offsets[np.abs(value + legal_offsets - nearest).argmin()]
        return np.asarray(self.q[i - self.first : last - self.first + 1] + offsets)


def chains_of_columns(arm: Arm, columns: BranchColumns) -> list[BranchChain]:
    """All chains of linked columns."""
    N, B = columns.q.shape[:2]
    valid = columns.valid
    identity = np.where(valid[:-1], np.arange(B), -1) == columns.partner
    unchanged = identity.all(axis=1) & (valid[:-1] == valid[1:]).all(axis=1)
    events = np.append(np.flatnonzero(~unchanged), N - 1)
    open_chains: dict[int, list[tuple[int, int, int]]] = {
        int(column): [] for column in np.flatnonzero(valid[0])
    }  # column: blocks
    ended_chains: list[list[tuple[int, int, int]]] = []
    begin = 0
    for event in events.tolist():
        for column, blocks in open_chains.items():
            blocks.append((begin, event, column))
        if event == N - 1:
            break
        partner = columns.partner[event]
        continued_chains = {
            int(partner[column]): blocks for column, blocks in open_chains.items() if partner[column] >= 0
        }
        ended_chains += [blocks for column, blocks in open_chains.items() if partner[column] < 0]
        open_chains = {
            int(column): continued_chains.get(int(column), []) for column in np.flatnonzero(valid[event + 1])
        }
        begin = event + 1
    ended_chains += list(open_chains.values())
    return [_assemble_chain(arm, columns, blocks) for blocks in ended_chains]


def _assemble_chain(arm: Arm, columns: BranchColumns, blocks: list[tuple[int, int, int]]) -> BranchChain:
    size = blocks[-1][1] + 1 - blocks[0][0]
    # memory order joint by joint, since limits and copies are evaluated joint by joint
    parts = [columns.q[a : b + 1, column].T for a, b, column in blocks]
    q = np.concatenate(parts, axis=1, out=np.empty((arm.n, size))).T
    labels = np.concatenate([columns.name[a : b + 1, column] for a, b, column in blocks])
    chain = BranchChain(arm, blocks[0][0], q, labels.astype(np.intp))
    lowest, highest = chain.extent
    for joint in np.flatnonzero(~arm.prismatic & (highest - lowest > np.pi)):  # principal values may jump by a turn
        turn = whole_turns(arm)[joint]
        turns = np.rint(np.diff(q[:, joint]) / turn)
        if turns.any():
            q[1:, joint] -= turn * np.cumsum(turns)
            chain.__dict__.pop("extent", None)
    return chain


@dataclass(frozen=True)
class Run:
    """A stretch of the route on one chain within the limits."""

    chain: BranchChain
    first: int
    last: int


def fewest_runs(chains: list[BranchChain], N: int, allowed: list[BranchChain] | None = None) -> list[Run]:
    """The fewest runs in order, each as long as any chain allows; no run covers samples that no chain carries.

    allowed: the chains on which the first run may begin. Among equally long runs the one with the least motion is
    taken, which is the sum over the samples of the greatest |dq| / max_speed.
    """
    runs: list[Run] = []
    i, alive = 0, _possible_starts(chains, N)
    while i < N:
        choices = allowed if allowed is not None and not runs and i == 0 else chains
        last = max((chain.carries_to(i) for chain in choices), default=i - 1)
        if last < i or (last == i and i < N - 1 and runs and runs[-1].last == i):
            i += 1 + int(alive[i + 1 :].argmax())
            continue
        runs.append(_least_motion_run(choices, i, last))
        if last >= N - 1:
            break
        i = last if any(chain.carries_to(last) > last for chain in chains) else last + 1
    return runs


def _possible_starts(chains: list[BranchChain], N: int) -> Bool:
    """Whether a run may begin at each sample: (N + 1,), true for the end behind the last one."""
    alive = np.zeros(N + 1, bool)
    alive[N] = True
    for chain in chains:
        i0, i1 = min(chain.first, N), min(chain.last + 1, N)
        alive[i0:i1] |= chain.reach[: i1 - i0] >= np.arange(i0, i1)
    return alive


def _least_motion_run(choices: list[BranchChain], i: int, last_sample: int) -> Run:
    """The run of the chain with the least motion, of those that carry from sample i to `last_sample`."""
    chain = min((c for c in choices if c.carries_to(i) == last_sample), key=lambda c: least_time(c, i, last_sample))
    return Run(chain, i, last_sample)


def least_time(chain: BranchChain, i: int, last: int) -> float:
    """A lower bound [s] of the time from sample i to `last`, from the joints' max_speed."""
    q = chain.q[i - chain.first : last - chain.first + 1]
    speed = np.where(np.isnan(chain.arm.max_speed), 1.0, chain.arm.max_speed)
    seconds = np.zeros(max(len(q) - 1, 0))
    for j in range(chain.arm.n):  # joint by joint, since numpy's maximum over a short last axis is slow
        np.maximum(seconds, np.abs(np.diff(q[:, j])) / speed[j], out=seconds)
    return float(seconds.sum())


class EndReason(NamedTuple):
    """Why a run of a branch ends."""

    why: str
    status: str  # of the next sample
    joint: int | None = None  # the joint at its limit
    limit: float | None = None  # [rad | mm]


def end_reason(columns: BranchColumns, chain: BranchChain, i: int) -> EndReason:
    """Why a run from sample i ends: a hit, a limit, the path's end, the reach, a boundary or a singularity."""
    last = chain.carries_to(i)
    next_sample = min(max(last + 1, 0), len(columns.s) - 1)
    status = Status(int(columns.status[next_sample])).name.lower()
    if chain.ends_by_hit(i):
        return EndReason("hit", status)
    joint = chain.limiting_joint(i)
    arm = chain.arm
    if joint is not None:
        index = min(max(last + 1, chain.first), chain.last) - chain.first
        # extrapolate the copy that carried farthest to see which limit the joint passes
        q = chain.joints(i, last, arm.home)[-1] if last >= i else chain.q[max(i - chain.first, 0)]
        value_beyond = q[joint] + chain.q[index, joint] - chain.q[max(index - 1, 0), joint]
        upper = abs(value_beyond - arm.upper[joint]) < abs(value_beyond - arm.lower[joint])
        limit = float(arm.upper[joint] if upper else arm.lower[joint])
        return EndReason("limit", status, joint, limit)
    if next_sample == last:
        return EndReason("end", status)
    count = columns.valid.sum(axis=1)
    # Two branches that meet at the edge of the reach end one or two samples before it.
    next_samples = (columns.s > columns.s[last]) & (columns.s < columns.s[last] + 10 * END_ACCURACY)
    if (columns.status[next_samples] == Status.UNREACHABLE).any():
        return EndReason("reach", Status.UNREACHABLE.name.lower())
    return EndReason("boundary" if count[next_sample] < count[last] else "singularity", status)
