"""The ways to walk a closed chain of six joints: which joint plays which part in the elimination.

With the pose X carried along as a sixth link, a chain's joints and links close:  Z1 W1 Z2 W2 ... Z6 X = I.
The loop may be cut before any joint and walked in either direction.  In the order of the walk the joints
are called a, b, m1, m2, m3, e and the links after them La .. Le:

    Ja La Jb Lb J1 L1 J2 L2 J3 L3 Je Le = I.

One of the middle joints m1, m2, m3 is hidden (it becomes the eigenvalue), one dialytic, one the third; a wide role
is dialytic in the third, too.
"""

from dataclasses import dataclass

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.model.rotation import inverse

_X = 5  # index of the link of the loop that carries the pose


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
    found = []
    for backward in (False, True):
        order = tuple((slot - i) % 6 if backward else (_X - slot + i) % 6 for i in range(6))
        if not prismatic[order[5]]:
            dialytic = {h: [j for j in range(3) if j != h][: 1 if wide else 2] for h in hidden}
            found += [Role(order, backward, slot, h, j, wide) for h in hidden for j in dialytic[h]]
    return found


def links_by_part(role: Role, links: Array) -> Array:
    """La .. Le as (6, 4, 4) from the arm's five links (5, 4, 4); where the pose goes stands the identity."""
    around = np.concatenate([links, np.eye(4)[None]])
    if not role.backward:
        return around[list(role.order)]
    return inverse(around[[(i - 1) % 6 for i in role.order]])
