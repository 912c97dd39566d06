"""A move on a simulated board, which speaks the firmware's bytes: what `armkin send --port sim` does."""

import numpy as np

import armkin
from armkin.board.kinds import board_of
from armkin.board.open_board import open_board

arm = armkin.load("three_dof")
board = board_of(arm)  # the kind of board that the robot file names
with open_board(board, "sim") as machine:  # a real one: its port, /dev/ttyUSB0 or COM3
    machine.prepare()  # tells the board the motors; the simulated one stands in the home pose
    poses = np.deg2rad([[-30, 5, -5], [30, 45, -45]])
    planned = board.plan(machine.counts(), poses, speed=0.5)  # half of every joint's max_speed
    machine.run([planned])  # returns when the arm stands
    pulses = machine.counts()
print(list(pulses), f"after {planned.duration:.3f} s, at {np.rad2deg(armkin.joints(arm, pulses)).round(2)} degrees")
