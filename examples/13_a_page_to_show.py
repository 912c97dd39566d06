"""A moving arm on a page of its own: orbit it, drag its tip, play the path. Its argument: the page, e.g. arm.html."""

import sys
from pathlib import Path

import armkin
from armkin.teach.one_file import html

arm = armkin.load("three_dof")
plan = armkin.path(arm, Path(__file__).with_name("pick_and_place.yaml"))
page = html(arm, plan=plan)  # one file, without a server and without internet
print(f"{len(page) / 1e6:.1f} MB: {arm.name}, {plan.duration:.2f} s of motion")
if sys.argv[1:]:
    Path(sys.argv[1]).write_text(page, encoding="utf-8")
