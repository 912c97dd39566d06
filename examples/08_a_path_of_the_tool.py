"""A path: the tool on straight lines, as fast as the joints allow, on the branch that carries all of it."""

import numpy as np

import armkin

arm = armkin.load("three_dof")
plan = armkin.path(arm, [[390, 80, 300], [390, 160, 300], [330, 160, 250]], blend=5)
t = np.linspace(0, plan.duration, 6)
for time, tip in zip(t, armkin.fk(arm, plan.q(t))[:, :3, 3], strict=True):
    print(f"{time:6.3f} s  {tip.round(2)}")
print(f"branch: {', '.join(name for run in plan.runs for _, name in run.names)}")
