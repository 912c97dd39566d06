"""The shipped arms with their screws, and which of them are unlike one another."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from oracle import Screws, exponential, screws_of

import armkin
from armkin.model.arm import Arm

ROBOTS = Path(__file__).parents[2] / "robots"
TASKLESS = {"pan_tilt"}
NAMES = sorted(path.stem for path in ROBOTS.glob("*.yaml") if path.stem not in TASKLESS)
# arms that differ from another one in their lengths alone, or in nothing but their drives
ALIKE = {
    "ar4_pico6": "ar4",
    "kuka_kr6_r700": "irb2400",
    "parol6_pico6": "parol6",
    "ra02_screws": "ra02",
    "roarm_m2": "yaw_two_link",
    "thor_pico6": "thor",
    "ur10e": "ur5e",
    "ur3e": "ur5e",
}
UNLIKE = [name for name in NAMES if name not in ALIKE]


@cache
def shipped_arm(name: str) -> tuple[Arm, Screws]:
    """The same arm each time, as what is prepared of it is kept by arm."""
    arm = armkin.load(ROBOTS / f"{name}.yaml")
    screw = screws_of(arm.file)
    if arm.n == 7:  # one of the joints is held
        return armkin.lock(arm, {"J3": 0.35}), lock_screws(screw, 2, 0.35)
    return arm, screw


def lock_screws(screw: Screws, joint: int, value: float) -> Screws:
    """The screws of what is left when one joint is held."""
    E = exponential(screw, joint, np.array(value))
    w, p = screw.w.copy(), screw.p.copy()
    w[joint + 1 :] = w[joint + 1 :] @ E[:3, :3].T
    p[joint + 1 :] = p[joint + 1 :] @ E[:3, :3].T + E[:3, 3]
    free = [i for i in range(len(w)) if i != joint]
    return Screws(w[free], p[free], screw.prismatic[free], E @ screw.M)
