"""Components longer than one polynomial holds: chains of these, each begun where the one before leaves its span.

A component on which the residual grows has two ends, where that passes `SOLUTION`. What lies between is known to be on
it, and nothing else is.
"""

from __future__ import annotations

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular.local_structure import Structure, leave_spans, members, stretch
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm

FEW_LINKS = 4  # curves on each side of a posture whose component leaves a shortened span: others are decided elsewhere
LINKS = 16  # curves on each side of a posture, each as long as the last one lets expect


def follow(arm: Arm, task: Task, at: Structure, q: Array, peers: Array, target: Array) -> tuple[Bool, Bool, Bool, Bool]:
    """Which postures peers (M, K, n) lie on the components of q (M, n), and of which (M,) both ends are known.

    Those on which the residual grows, and those that leave a shortened span, are followed both ways until they end, or
    close, the latter at most as far as tells that they are manifolds: then `at` tells of them, too. Also on which of
    these (M,) no other curve crosses, and the joints (M, n) that move.
    """
    rows = np.arange(len(q))
    open_ = ~at.known & at.followed
    inside = members(at, rows, newton.difference(arm, peers, q[:, None]))
    ended = np.asarray(at.known & (np.maximum(-at.low, at.high) < at.span))
    residual = np.linalg.norm(np.abs(at.g).sum(axis=0), axis=1)
    open_ |= at.known & at.manifold & ~ended & (residual > tol.CLOSED)
    left = np.flatnonzero(open_ & (at.second > tol.HIGH))
    if not len(left):
        return inside, ended, ended & at.alone, at.joints
    joints, alone = at.joints.copy(), at.alone.copy()
    least, most = at.least.copy(), at.most.copy()
    curve, span = np.tile(left, 2), np.tile((at.longer * at.span)[left], 2)
    start, ahead = leave_spans(arm, at, curve, q[curve], np.concatenate([at.v[left], -at.v[left]]))
    finished = np.isnan(start[:, 0])
    going = np.flatnonzero(~finished)
    for count in range(1, LINKS + 1):
        if not len(going):
            break
        row, rows, last = curve[going], np.arange(len(going)), start[going]
        link = stretch(arm, task, last, target[row], span[going], ahead[going])
        good = link.followed & (link.second > tol.HIGH)
        span[going] *= link.longer
        onto, onwards = leave_spans(arm, link, rows, last, link.v)
        # a curve closes where its two sides meet: a step may pass where the other was, or now is
        other = (going + len(left)) % len(curve)
        before = start[other]
        start[going[good]], ahead[going[good]] = onto[good], onwards[good]
        others = np.concatenate([peers[row], before[:, None], start[other][:, None]], axis=1)
        passed = members(link, rows, newton.difference(arm, others, last[:, None])) & good[:, None]
        np.logical_or.at(inside, row, passed[:, :-2])
        shift = newton.difference(arm, last, q[row])
        np.minimum.at(least, row[good], (shift + link.least)[good])
        np.maximum.at(most, row[good], (shift + link.most)[good])
        np.logical_and.at(alone, row[good], link.alone[good])
        np.logical_or.at(at.boundary, row[good], link.boundary[good])
        finished[going] = good & np.isnan(onto[:, 0])
        met = passed[:, -2:].any(axis=1)
        finished[going[met]] = finished[other[met]] = True
        enough = ~at.known & ((count == FEW_LINKS) | ((most - least).max(axis=1) >= tol.REACH))
        going = going[~(finished[going] | enough[row]) & (link.second > tol.HIGH)]
    extent, ended[left] = (most - least)[left], finished.reshape(2, -1).all(axis=0)
    at.manifold[left] = extent.max(axis=1) >= tol.REACH
    at.known[left], at.boundary[left] = at.manifold[left] | ended[left], at.boundary[left] & ~at.manifold[left]
    joints[left] = at.manifold[left, None] & (extent > tol.MOVED * extent.max(axis=1)[:, None])
    return inside, ended, ended & alone, joints
