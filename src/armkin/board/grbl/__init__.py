"""GRBL 1.1, grblHAL, FluidNC: up to six stepper axes, degrees as millimetres.

motor_axes.py           an arm's motors as GRBL's axes
trajectory_to_gcode.py  a trajectory as lines of G-code
replies.py              what GRBL says; grbl_session.py: lines and their answers
settings.py             its $ settings against the robot file
position_watch.py       whether it is where the plan is, while it moves
spindle_gripper.py      the M3 output as a gripper
believed_position.py    where the arm stands, and whether that is known
grbl_machine.py         an arm on it
"""
