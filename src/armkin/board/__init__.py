"""Trajectory -> motors that turn.

opening.py    a port by its name
planner.py    plans one after another, rows as they come, where the arm stands
path_run.py   a planned path, part by part, the gripper between
resuming.py   a motion that was held, gone on with
stopping.py   signals while an arm moves
summaries.py  what a plan comes to and where the arm stands, as JSON has it
ports/        what every port can do; serial ports, and the lock that keeps two programs from one arm
backend/      what every kind of board can do
firmware/     our own firmware's protocol, sessions, configuration, motion
sim/          a board inside the process that speaks the same bytes, and stand-ins for the others
kinds/        boards with somebody else's firmware, one file a kind
grbl/, feetech/, klipper/  what these speak; a new kind: `../board_kinds.py` FOREIGN, a file in kinds/, a package here
"""
