"""A redundant arm: hold one joint, solve for the others, put it back."""

import numpy as np

import armkin

arm = armkin.load("panda")
held = {"J3": np.deg2rad(20)}
six = armkin.lock(arm, held)  # an arm of the six other joints
solutions = armkin.ik(six, armkin.fk(six, six.home), near=six.home)  # a target that it reaches: its own home pose
q = armkin.unlock(arm, held, solutions.q)  # seven values a branch again
postures = q[solutions.valid]
print(f"{len(postures)} branches of {arm.n} joints; J3 is {np.rad2deg(postures[0, 2]):.0f} degrees in each")
