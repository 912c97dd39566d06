"""A move on a simulated board, which speaks the firmware's bytes: what `armkin send --port sim` does."""

import numpy as np

import armkin
from armkin.board.firmware.configuration import configure
from armkin.board.moving import Planner, where
from armkin.board.opening import open_machine

arm = armkin.load("three_dof")
configuration = configure(arm)
with open_machine(arm, configuration, "sim") as machine:
    machine.prepare()
    planner = Planner(arm, configuration, speed=0.5)  # half of every joint's max_speed
    plan = planner.plan(machine.counts(), np.deg2rad([[-30, 5, -5], [30, 45, -45]]))
    machine.run([plan])
    there = where(machine)
print(there["pulses"], f"after {plan.duration:.3f} s")
