"""Directions that a singular posture loses: where it is pushed to see whether it lies on a self-motion."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.inverse.numeric.tolerances import NO_BLOCK, NO_JOINT

Int = NDArray[np.int64]


def null_directions(n: int, V: Array, nullity: Int) -> tuple[Int, Array]:
    """Which postures to push, of M that lose as many directions as nullity (M,) says, and where: (m,), (m, n).

    V: (M, n, n) right singular vectors. Each direction is there once, whichever sign it has.
    """
    pushes = list(_null_directions(n, V, nullity))
    who, push = np.concatenate([w for w, _ in pushes]), np.concatenate([p for _, p in pushes])
    first = (np.abs(push) > 0.1).argmax(axis=1)
    ahead = np.sign(np.take_along_axis(push, first[:, None], axis=1))
    _, once = np.unique(np.column_stack([who, np.rint(1e6 * push * ahead)]), axis=0, return_index=True)
    once.sort()
    return who[once], push[once]


def _null_directions(n: int, V: Array, nullity: Int) -> Iterator[tuple[Int, Array]]:
    """The same in parts, some of them several times.

    In a null space of several dimensions a self-motion may hide between the basis vectors: there every joint
    is pushed as far as the null space lets it, pairs of joints that do without the others are, and in a plane
    of them every joint is held.
    """
    for index in range(int(nullity.max())):
        who = np.flatnonzero(nullity > index)
        yield who, V[who, n - 1 - index]
    plane = np.flatnonzero(nullity == 2)
    for joint in range(n if len(plane) else 0):
        u, v = V[plane, n - 1], V[plane, n - 2]
        hold = v[:, joint, None] * u - u[:, joint, None] * v
        size = np.linalg.norm(hold, axis=1)
        some = size > 0.1
        if some.any():
            yield plane[some], hold[some] / size[some, None]
    many = np.flatnonzero(nullity > 1)
    in_null = np.arange(n) >= n - nullity[many][:, None]
    rest = np.eye(n) - np.einsum("mij,mi,mik->mjk", V[many], in_null, V[many])  # projection out of the null space
    for i, j in itertools.combinations(range(n) if len(many) else (), 2):
        # two joints alone, about one line: the eigenvector of the 2 x 2 block that the projection leaves nothing of
        a, b, c = rest[:, i, i], rest[:, j, j], rest[:, i, j]
        some = (a * b - c * c < NO_BLOCK) & (a + b > NO_JOINT) & (np.abs(c) > NO_JOINT)
        if some.any():
            push = np.zeros((int(some.sum()), n))
            push[:, i], push[:, j] = b[some], -c[some]
            yield many[some], push / np.linalg.norm(push, axis=1, keepdims=True)
    for joint in range(n if len(many) else 0):
        push = np.einsum("mi,mij->mj", np.where(in_null, V[many, :, joint], 0.0), V[many])
        size = np.linalg.norm(push, axis=1)
        some = size > 0.1
        if some.any():
            yield many[some], push[some] / size[some, None]
