"""Arms whose axes are a little off where the table has them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from oracle import Screws, rotation, shift

from armkin.model.arm import Arm

OFF = (1e-15, 1e-13, 1e-11, 1e-9, 1e-7, 1e-5, 1e-4, 1e-3)


def move_axes(arm: Arm, size: float, seed: int) -> tuple[Arm, Screws]:
    """Every axis turned and shifted a little, by up to `size` [rad] and a third of `size` [of the reach]."""
    rng = np.random.default_rng(seed)
    link = arm.link.copy()
    for i in range(1, arm.n):
        x, y = np.degrees(size * rng.uniform(-1, 1, 2))
        link[i] = link[i] @ rotation("x", x) @ rotation("y", y) @ shift(*(size * arm.reach / 3 * rng.uniform(-1, 1, 3)))
    P, w, p = np.eye(4), [], []
    for i in range(arm.n):
        P = P @ link[i]
        w.append(P[:3, 2])
        p.append(P[:3, 3])
    return replace(arm, link=link), Screws(np.array(w), np.array(p), arm.prismatic, P @ link[-1])
