"""A redundant arm: hold one joint, solve for the others, put it back."""

import numpy as np

import armkin

arm = armkin.load("panda")
held = {"J3": np.deg2rad(20)}
six = armkin.lock(arm, held)  # an arm of the six other joints
s = armkin.ik(six, armkin.fk(six, six.home), near=six.home)  # a target that it reaches: its own home pose
q = armkin.unlock(arm, held, s.q)  # seven values a branch again
print(f"{s.valid.sum()} branches of {arm.n} joints; J3 is {np.rad2deg(q[s.valid][0, 2]):.0f} degrees in each")
