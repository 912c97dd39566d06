"""The boards that run armkin's own firmware (firmware/PROTOCOL.md).

The bytes:

framing.py                payloads to bytes on the line and back
protocol.py               payloads
segment_format.py         one segment and its bytes; motion_frame.py: those of the payload that carries several
configuration_image.py    the configuration image
reply_checks.py           what a board may say

The conversation:

find_boards.py            which plugged-in boards answer
session.py                opened, spoken in, held
go_back_n.py              frames in sequence, sent again until they are acknowledged; serial_line.py: noise on the line

The way of a motion:

trajectory_to_counts.py   a trajectory as moves in counts, refused where it is too fast
counts_to_segments.py     pieces of constant acceleration as exact segments
straight_lines.py         which pieces a straight line has; curves.py: any other stretch
streaming.py              segments to the board while it moves

An arm on a board:

configuration.py          a robot file as its board must know it
machine.py                the arm: configured, its position known or lost, moved by plans
homing.py                 homing by limit switches
jogging.py, gripping.py   one joint at a constant speed; the gripper, whose counts are in gripper_counts.py
resuming.py               resuming a motion after a feed hold; onwards.py: what is left of a plan
board_status.py           what `status` tells besides the position, and why a board refused, in words
"""
