"""Boards inside the process, in simulated time.

sim_board.py            our own firmware's side of the protocol; sim_port.py: a port to it, also in the clock's time
frames.py               what it reads
motion_frame_checks.py  what it checks of a motion and of limits; velocity.py, coupled_limits.py: two of these checks
commands.py             what it does with a frame; host_settings.py: its configuration
sim_motors.py           what moves its motors: queue.py, homing.py, jogging.py; cruise.py is for the last two
axis_counts.py          its counts; digital_inputs.py: its switches

clock.py                the time of the others
grbl.py                 GRBL; grbl_modes.py: what its lines mean
klipper.py              Klipper
servo_bus.py            bus servos
"""
