"""Chains of joints for the solvers of `armkin.ik`, and their reversal."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.model.rotation import FLIP, inverse


class Chain(NamedTuple):
    """``link[0] Z1(q1) link[1] ... Zn(qn) link[n]`` with Z = Rz or Tz."""

    link: Array  # (n + 1, 4, 4)
    prismatic: NDArray[np.bool_]  # (n,)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.prismatic)


def reverse_chain(chain: Chain) -> Chain:
    """The chain from the tool to the base, with the inverse pose and the joints in reverse order."""
    links = FLIP @ inverse(chain.link[::-1]) @ FLIP
    links[0] = FLIP @ links[0]
    links[-1] = links[-1] @ FLIP
    return Chain(links, chain.prismatic[::-1])


def joint_axes(chain: Chain) -> tuple[Array, Array]:
    """Points (n, 3) and directions (n, 3) of the joint axes when all joints are zero."""
    P = np.eye(4)
    points, directions = [], []
    for i in range(chain.n):
        P = P @ chain.link[i]
        points.append(P[:3, 3])
        directions.append(P[:3, 2])
    return np.array(points), np.array(directions)


def is_parallel(link: Array, tolerance: float) -> bool:
    """Whether the joint axes on both sides of a link are parallel (or antiparallel)."""
    return bool(np.hypot(link[0, 2], link[1, 2]) <= tolerance)
