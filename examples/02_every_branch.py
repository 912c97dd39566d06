"""Inverse kinematics: every way to reach a point, and the one to take."""

import numpy as np

import armkin

arm = armkin.load("three_dof")
solutions = armkin.ik(arm, [390, 80, 300])
# solutions.q has one row a branch [rad], nan where the branch is not real; solutions.branch numbers its name.
names = [solutions.names[number] for number in solutions.branch]
for row in solutions.order:  # the best first: within limits, then the least motion from home
    if solutions.valid[row]:
        degrees = np.rad2deg(solutions.q[row]).round(4)
        legal = "within limits" if solutions.within_limits[row] else "outside limits"
        print(f"{names[row]:18} {degrees}  {legal}")
print("complete:", bool(solutions.complete), " best:", names[solutions.best])  # complete: no branch is missing
