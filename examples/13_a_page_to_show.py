"""A UR5e goes round a circle on a page of its own: orbit it, drag its tip, play the path. Its argument: the page.

`python 13_a_page_to_show.py arm.html`, and open arm.html in any browser.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import armkin
from armkin.teach.one_file import arm_html

arm = armkin.load("ur5e")
arm = replace(arm, max_accel=np.full(6, np.deg2rad(120.0)))  # its maker states none: this one is ours
start = {"point": [400, 0, 300, 180, 0, 0]}  # x, y, z [mm], roll, pitch, yaw [deg]: the tool straight down
plan = armkin.path(arm, {"moves": [start, {"circle": {"centre": [500, 0, 300], "normal": [0, 0, 1]}}]}, tool_speed=200)
page = arm_html(arm, plan=plan)  # one file, without a server and without internet
print(f"{len(page) / 1e6:.1f} MB: {arm.name} goes {plan.length:.1f} mm in {plan.duration:.2f} s")
if sys.argv[1:]:
    Path(sys.argv[1]).write_text(page, encoding="utf-8")
