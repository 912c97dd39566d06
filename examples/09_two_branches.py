"""The homework's tilted circle: both elbows and mirrored bases carry it. Which is fastest? Its argument: a picture."""

import sys
from dataclasses import replace

import numpy as np

import armkin
from armkin.plot.path_picture import plot_path

arm = armkin.load("yaw_two_link")
# The homework gives no speeds: these are ours.
arm = replace(arm, max_speed=np.deg2rad([60.0, 60.0, 60.0]), max_accel=np.deg2rad([120.0, 120.0, 120.0]))
s = np.sqrt(0.5)
circle = {"circle": {"centre": [0, 0, 660], "normal": [-s, 0, s]}}
begin = {"point": [400 * s, 0, 660 + 400 * s]}
best = armkin.path(arm, {"moves": [begin, circle]})
for branch in best.branches:
    plan = armkin.path(arm, {"moves": [begin, circle]}, branch=branch.name)
    chosen = "  <- chosen" if branch.name == best.runs[0].names[0][1] else ""
    first = np.round(np.rad2deg(plan.runs[0].start_joints), 2) + 0.0
    print(f"{branch.name:28} {plan.motion.stretches[-1].duration:.3f} s from {first}{chosen}")
if sys.argv[1:]:
    plot_path(best, sys.argv[1])
