"""The boards that run armkin's own firmware (firmware/PROTOCOL.md).

wire/                 bytes, frames and the conversation with a board
segments/             a trajectory as moves in counts, and these as segments of constant acceleration
streaming.py          segments to the board while it moves; carry_out_plans.py: plans, also when its queue ran dry
configuration.py      a robot file as its board must know it
firmware_machine.py   the arm: configured, its position known or lost, moved by plans
resets_and_stops.py   why a motion ended early, and what the arm still knows
homing.py             homing by limit switches
jogging.py            one joint at a constant speed
gripping.py           the gripper, whose counts are in gripper_counts.py
resume_after_hold.py  a motion goes on after a feed hold
board_status.py       what `status` tells besides the position, and why a board refused, in words
"""
