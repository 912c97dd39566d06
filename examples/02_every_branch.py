"""Inverse kinematics: every way to reach a point, and the one to take."""

import numpy as np

import armkin

arm = armkin.load("three_dof")
s = armkin.ik(arm, [390, 80, 300])  # s.q: one row a branch [rad], in the order of s.branch; nan where one is not real
for b in s.order:  # the best first: within limits, then the least motion from home
    if s.valid[b]:
        legal = "within limits" if s.within_limits[b] else "outside limits"
        print(f"{s.names[s.branch[b]]:18} {np.rad2deg(s.q[b]).round(4)}  {legal}")
print("complete:", bool(s.complete), " best:", s.names[s.branch[s.best]])  # complete: none is missing
