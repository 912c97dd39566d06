"""A move on a simulated board, which speaks the firmware's bytes: what `armkin send --port sim` does."""

import numpy as np

import armkin
from armkin.board.firmware.configuration import configure
from armkin.board.firmware.trajectory_to_counts import plan
from armkin.board.opening import open_machine
from armkin.board.planner import where

arm = armkin.load("three_dof")
with open_machine(arm, configure(arm), "sim") as machine:
    machine.prepare()
    poses = np.deg2rad([[-30, 5, -5], [30, 45, -45]])
    planned = plan(arm, machine.counts(), poses, speed=0.5)  # half of every joint's max_speed
    machine.run([planned])
    there = where(machine)
print(there["pulses"], f"after {planned.duration:.3f} s")
