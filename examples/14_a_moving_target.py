"""A UR5e follows a moving target: one solve a step, near the last one, as a controller asks."""

import time

import numpy as np

import armkin

arm = armkin.load("ur5e")
q = first = np.deg2rad([0, -90, 90, -90, -90, 0])
target = armkin.fk(arm, q)  # 4 x 4, millimetres
begin = target[:3, 3].copy()
widest, off, began = 0.0, 0.0, time.perf_counter()
for angle in np.linspace(0, 2 * np.pi, 1000):  # two seconds of a controller at 500 Hz
    target[:3, 3] = begin + 100 * np.array([np.cos(angle) - 1, np.sin(angle), 0])
    s = armkin.ik(arm, target, near=q)
    if s.best < 0:
        raise SystemExit(f"no branch within the limits at {np.rad2deg(angle):.0f} degrees")
    widest, q = max(widest, np.abs(s.q[s.best] - q).max()), s.q[s.best]
    off = max(off, np.abs(armkin.fk(arm, q) - target)[:3, 3].max())
print(f"1000 steps, no joint turned more than {np.rad2deg(widest):.2f} degrees in one, the tip off by {off:.0e} mm")
print(
    f"back where it began: {np.allclose(q, first)}; {time.perf_counter() - began:.2f} s of computing for 2 s of motion"
)
