"""Klipper: an arm's steppers as `manual_stepper` sections, moved together through the API server's socket.

api.py                     requests and answers on the socket
extra_axes.py              an arm's motors as extra axes, and their sections of printer.cfg
trajectory_to_g1_lines.py  a trajectory as G1 lines
klipper_machine.py         an arm on it
"""
