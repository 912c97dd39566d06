"""Boards inside the process, in simulated time.

board.py      our own firmware's side of the protocol; port.py: a port to it, also in the clock's time
frames.py     what it reads; motion_frame.py, velocity.py, coupled_limits.py: what it checks of a motion and of limits
commands.py   what it does with a frame; setup.py: its configuration
motors.py     what moves its motors: queue.py, homing.py, jogging.py; cruise.py is for the last two
axes.py       its counts; inputs.py: its switches

clock.py      the time of the others
grbl.py       GRBL; grbl_modes.py: what its lines mean
klipper.py    Klipper
servo_bus.py  bus servos
"""
