"""A path file as a plan in time: on the right branch, within all limits, as fast as the joints allow."""

from pathlib import Path

import numpy as np

import armkin

arm = armkin.load("three_dof")
plan = armkin.path(arm, Path(__file__).parent / "pick_and_place.yaml")
t = np.linspace(0, plan.duration, 1000)
s, name = plan.runs[0].names[0]  # the branch that carries the path, from s = 0 mm on
print(f"{plan.length:.1f} mm in {plan.duration:.2f} s on '{name}'")
# 1 is the robot file's limit: an optimal plan touches one at every moment
print("greatest share of speed", np.round(np.abs(plan.qd(t) / arm.max_speed).max(axis=0), 2))
print("greatest share of acceleration", np.round(plan.limits["accel"], 2))
