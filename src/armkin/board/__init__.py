"""Trajectory -> motors that turn.

commissioning.py   directions, zeros, limits and the first move of an arm on its board
open_board.py      a board of any kind by its port's name
planner.py         plans one after another, rows as they come, where the arm stands
path_run.py        a planned path, part by part, the gripper between
stop_signals.py    signals while an arm moves
json_summaries.py  what a plan comes to and where the arm stands, as JSON has it
conformance.py     the suite that every kind passes, for those of other packages, too
ports/             what every port can do; serial ports, and the lock that keeps two programs from one arm
backend/           what every kind of board can do: Board is the one class that a kind is
firmware/          our own firmware's protocol, sessions, configuration, motion; resuming of a motion that was held
sim/               a board inside the process that speaks the same bytes, and stand-ins for the others
kinds/             the kinds, one file each, our own firmware's among them: a new kind is a new file here
grbl/, feetech/, klipper/  what these speak
"""
