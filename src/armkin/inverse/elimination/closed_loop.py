"""A 6-joint chain as a closed loop, scaled and with its frames moved to where its links are short; the ways to walk it.

With the pose X carried along as a sixth link, a chain's joints and links close:  Z1 W1 Z2 W2 ... Z6 X = I.
The loop may be cut before any joint and walked in either direction.  In the order of the walk the joints
are called a, b, m1, m2, m3, e and the links after them La .. Le:

    Ja La Jb Lb J1 L1 J2 L2 J3 L3 Je Le = I.

One of the middle joints m1, m2, m3 is hidden, the eigenvalue, one dialytic; a wide role is so in the third, too.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import tolerances as tol
from armkin.model.rotation import inverse, shrink_translations

UNIT_LENGTH = 300.0  # unit [mm] of a chain whose links have no length of their own
_X = 5  # index of the link of the loop that carries the pose


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
        return inverse(self.base) @ shrink_translations(T, self.length) @ inverse(self.tool)


def close_loop(link: Array, prismatic: Bool) -> Loop:
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
        rows, columns, next_columns = slice(3 * i, 3 * i + 3), slice(*start[i : i + 2]), slice(*start[i + 1 : i + 3])
        lengths[rows] = link[i + 1, :3, 3]
        moves[rows, columns] = -free[i]
        moves[rows, next_columns] = link[i + 1, :3, :3] @ free[i + 1]
    d = np.linalg.lstsq(moves, -lengths, rcond=tol.RANK_VALUE)[0]
    links = np.array(link, dtype=float)
    for i in range(6):
        move = free[i] @ d[start[i] : start[i + 1]]
        links[i, :3, 3] += links[i, :3, :3] @ move
        links[i + 1, :3, 3] -= move
    size = float(np.linalg.norm(links[1:6, :3, 3], axis=1).sum()) / 3
    length = size if size > tol.RANK_VALUE * (1 + float(np.abs(link[:, :3, 3]).max())) else UNIT_LENGTH
    links = shrink_translations(links, length)
    return Loop(np.array(prismatic, dtype=np.bool_), links[0], links[1:6], links[6], length)


@dataclass(frozen=True)
class Role:
    """One way to walk the loop.

    order: the joints (0..5) in the parts a, b, m1, m2, m3, e.
    backward: the loop is walked against its direction: links inverted, joint values negated.
    slot: which of the links La, Lb, L1, L2, L3, Le (0..5) carries the pose.
    hidden, dialytic: which of m1, m2, m3 (0..2) play these parts.
    wide: the third is dialytic, too.
    """

    order: tuple[int, ...]
    backward: bool
    slot: int
    hidden: int
    dialytic: int
    wide: bool = False

    @property
    def third(self) -> int:
        """Which of m1, m2, m3 plays the third part."""
        return 3 - self.hidden - self.dialytic

    @property
    def at_an_end(self) -> bool:
        """Whether La or Le carries the pose, so that only the side (3) of the equations depends on it."""
        return self.slot in (0, 5)


def roles(prismatic: Bool, slot: int, hidden: tuple[int, ...], wide: bool = False) -> list[Role]:
    """All roles with the pose in ``slot`` and one of ``hidden`` (0..2) hidden; e is revolute.

    Of wide ones one for each hidden joint: the two others play the same part.
    """
    walks = []
    for backward in (False, True):
        order = tuple((slot - i) % 6 if backward else (_X - slot + i) % 6 for i in range(6))
        if not prismatic[order[5]]:
            dialytic = {h: [j for j in range(3) if j != h][: 1 if wide else 2] for h in hidden}
            walks += [Role(order, backward, slot, h, j, wide) for h in hidden for j in dialytic[h]]
    return walks


def links_by_part(role: Role, links: Array) -> Array:
    """La .. Le as (6, 4, 4) from the arm's five links (5, 4, 4); where the pose goes stands the identity."""
    cycle = np.concatenate([links, np.eye(4)[None]])
    if not role.backward:
        return cycle[list(role.order)]
    return inverse(cycle[[(i - 1) % 6 for i in role.order]])
