"""A move on a simulated board, which speaks the firmware's bytes: what `armkin send --port sim` does."""

import numpy as np

import armkin
from armkin.board.kinds import board_of
from armkin.board.opening import open_board
from armkin.board.planner import where

arm = armkin.load("three_dof")
board = board_of(arm)
with open_board(board, "sim") as machine:
    machine.prepare()
    poses = np.deg2rad([[-30, 5, -5], [30, 45, -45]])
    planned = board.plan(machine.counts(), poses, speed=0.5)  # half of every joint's max_speed
    machine.run([planned])
    there = where(machine)
print(there["pulses"], f"after {planned.duration:.3f} s")
