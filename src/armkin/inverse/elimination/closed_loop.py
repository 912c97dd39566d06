"""A 6-joint chain as a closed loop, scaled and with its frames moved to where its links are short."""

from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import tolerances as tol
from armkin.model.rotation import inverse, shrunk

NO_LENGTH = 300.0  # unit [mm] of a chain whose links have no length of their own


class Loop(NamedTuple):
    """``T(q) = base Z1(q1) links[0] Z2(q2) ... links[4] Z6(q6) tool``, lengths in the loop's own unit.

    prismatic: (6,).  base, tool: (4, 4).  links: (5, 4, 4).  length: the unit [mm].
    """

    prismatic: Bool
    base: Array
    links: Array
    tool: Array
    length: float

    @property
    def chain(self) -> Array:
        """The links (7, 4, 4) of the chain from the first joint's frame to the last one's."""
        return np.concatenate([np.eye(4)[None], self.links, np.eye(4)[None]])

    def goal(self, T: Array) -> Array:
        """Targets (N, 4, 4) [mm] as poses of `chain`."""
        return inverse(self.base) @ shrunk(T, self.length) @ inverse(self.tool)


def close(link: Array, prismatic: Bool) -> Loop:
    """The loop of a chain ``link[0] Z1(q1) link[1] ... Z6(q6) link[6]``, (7, 4, 4) [mm].

    A joint's frame may be moved along its axis (anywhere, if the joint is prismatic) without a change
    of its joint value: Z commutes with the move.  The moves that make the links' translations smallest,
    in the sense of least squares, are taken: near-parallel axes put DH frames kilometres away
    (d = -38 km in a table fitted to a desktop arm), and the elimination squares its lengths.
    """
    free = [np.eye(3) if slides else np.eye(3)[:, 2:] for slides in prismatic]
    start = np.cumsum([0, *(f.shape[1] for f in free)])
    moves, lengths = np.zeros((15, start[-1])), np.zeros(15)
    for i in range(5):  # link[i + 1] becomes  t - d_i + R d_{i+1}
        rows, here, there = slice(3 * i, 3 * i + 3), slice(*start[i : i + 2]), slice(*start[i + 1 : i + 3])
        lengths[rows] = link[i + 1, :3, 3]
        moves[rows, here] = -free[i]
        moves[rows, there] = link[i + 1, :3, :3] @ free[i + 1]
    d = np.linalg.lstsq(moves, -lengths, rcond=tol.RANK)[0]
    moved = np.array(link, dtype=float)
    for i in range(6):
        move = free[i] @ d[start[i] : start[i + 1]]
        moved[i, :3, 3] += moved[i, :3, :3] @ move
        moved[i + 1, :3, 3] -= move
    size = float(np.linalg.norm(moved[1:6, :3, 3], axis=1).sum()) / 3
    length = size if size > tol.RANK * (1 + float(np.abs(link[:, :3, 3]).max())) else NO_LENGTH
    moved = shrunk(moved, length)
    return Loop(np.array(prismatic, dtype=np.bool_), moved[0], moved[1:6], moved[6], length)
