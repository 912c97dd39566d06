"""Inverse kinematics: every way to reach a point, and the one to take."""

import numpy as np

import armkin

arm = armkin.load("three_dof")
s = armkin.ik(arm, [390, 80, 300])
for b in s.order:
    if s.valid[b]:
        legal = "within limits" if s.within_limits[b] else "outside limits"
        print(f"{s.names[s.branch[b]]:18} {np.rad2deg(s.q[b]).round(4)}  {legal}")
print("complete:", bool(s.complete), " best:", s.names[s.branch[s.best]])
