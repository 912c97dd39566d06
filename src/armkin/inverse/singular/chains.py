"""Components longer than one polynomial holds: chains of these, each begun where the one before leaves its span.

A component on which the residual grows has two ends, where that passes `SOLUTION`. What lies between is known to be on
it, and nothing else is.
"""

from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular.local_structure import Structure, leave_spans, members, structure_ahead
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm

FEW_LINKS = 4  # curves on each side of a posture whose component leaves a shortened span: others are decided elsewhere
LINKS = 16  # curves on each side of a posture, each as long as the last one lets expect


class Followed(NamedTuple):
    """What is known of the components of M postures after following them; of shape (M,) where no other is given."""

    members: Bool  # (M, K) which peers lie on the component
    known: Bool  # whether it was followed far enough to tell what it is
    manifold: Bool  # whether it is a self-motion manifold
    boundary: Bool  # whether it is a boundary; where it is neither, it is an isolated root
    joints: Bool  # (M, n) joints that move along a manifold
    ended: Bool  # whether both of its ends are known
    uncrossed: Bool  # whether both are, and no other curve crosses in between


def follow(arm: Arm, task: Task, at: Structure, q: Array, peers: Array, target: Array) -> Followed:
    """The components of postures q (M, n), whose structures are `at`, and which of their peers (M, K, n) lie on them.

    Components on which the residual grows, and those that leave a shortened span, are followed both ways until they
    end or close; the latter at most as far as tells that they are manifolds.
    """
    in_chains = members(at, np.arange(len(q)), newton.difference(arm, peers, q[:, None]))
    ended = np.asarray(at.known & (np.maximum(-at.low, at.high) < at.span))
    known, manifold, boundary = at.known.copy(), at.manifold.copy(), at.boundary.copy()
    joints, uncrossed = at.joints.copy(), at.uncrossed.copy()
    residual = np.linalg.norm(np.abs(at.g).sum(axis=0), axis=1)
    goes_on = np.where(at.known, at.manifold & ~ended & (residual > tol.ROUNDING_RESIDUAL), at.followed)
    begun = np.flatnonzero(goes_on & (at.second > tol.HIGH_ORDER))
    if not len(begun):
        return Followed(in_chains, known, manifold, boundary, joints, ended, ended & uncrossed)
    least_way, most_way = at.least_way.copy(), at.most_way.copy()
    # two chains each: the first half of these arrays begins along v, the second against it
    posture, span = np.tile(begun, 2), np.tile((at.span_ratio * at.span)[begun], 2)
    end, heading = leave_spans(arm, at, posture, q[posture], np.concatenate([at.v[begun], -at.v[begun]]))
    finished = np.isnan(end[:, 0])
    chains = np.flatnonzero(~finished)
    for count in range(1, LINKS + 1):
        if not len(chains):
            break
        row, start, every = posture[chains], end[chains], np.arange(len(chains))
        link = structure_ahead(arm, task, start, target[row], span[chains], heading[chains])
        holds = link.followed & (link.second > tol.HIGH_ORDER)
        span[chains] *= link.span_ratio
        link_end, link_heading = leave_spans(arm, link, every, start, link.v)
        # a curve closes where its two sides meet: a step may pass where the other was, or now is
        opposite = (chains + len(begun)) % len(posture)
        opposite_start = end[opposite]
        end[chains[holds]], heading[chains[holds]] = link_end[holds], link_heading[holds]
        tested = np.concatenate([peers[row], opposite_start[:, None], end[opposite][:, None]], axis=1)
        passed = members(link, every, newton.difference(arm, tested, start[:, None])) & holds[:, None]
        np.logical_or.at(in_chains, row, passed[:, :-2])
        shift = newton.difference(arm, start, q[row])
        np.minimum.at(least_way, row[holds], (shift + link.least_way)[holds])
        np.maximum.at(most_way, row[holds], (shift + link.most_way)[holds])
        np.logical_and.at(uncrossed, row[holds], link.uncrossed[holds])
        np.logical_or.at(boundary, row[holds], link.boundary[holds])
        finished[chains] = holds & np.isnan(link_end[:, 0])
        closes = passed[:, -2:].any(axis=1)
        finished[chains[closes]] = finished[opposite[closes]] = True
        enough = ~at.known & ((count == FEW_LINKS) | ((most_way - least_way).max(axis=1) >= tol.REACH))
        chains = chains[~(finished[chains] | enough[row]) & (link.second > tol.HIGH_ORDER)]
    extent, ended[begun] = (most_way - least_way)[begun], finished.reshape(2, -1).all(axis=0)
    manifold[begun] = extent.max(axis=1) >= tol.REACH
    known[begun], boundary[begun] = manifold[begun] | ended[begun], boundary[begun] & ~manifold[begun]
    joints[begun] = manifold[begun, None] & (extent > tol.MOVED * extent.max(axis=1)[:, None])
    return Followed(in_chains, known, manifold, boundary, joints, ended, ended & uncrossed)
