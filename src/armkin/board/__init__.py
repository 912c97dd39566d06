"""Trajectory -> motors that turn.

opening.py  a port by its name
ports/      what every port can do; serial ports, and the lock that keeps two programs from one arm
firmware/   our own firmware's protocol, sessions, configuration, motion
sim/        a board inside the process that speaks the same bytes
grbl/, feetech/  boards that others made; a new kind: `../hardware.py` FOREIGN, a package beside these, `foreign.py`
"""
