"""Trajectory -> motors that turn.

opening.py  a port by its name
planner.py  plans one after another, rows as they come, where the arm stands
path_run.py a planned path, part by part, the gripper between
ports/      what every port can do; serial ports, and the lock that keeps two programs from one arm
backend/    what every kind of board can do
firmware/   our own firmware's protocol, sessions, configuration, motion
sim/        a board inside the process that speaks the same bytes
grbl/, feetech/, klipper/  of others; a new kind: `../board_kinds.py` FOREIGN, a package here, `foreign.py`
"""
