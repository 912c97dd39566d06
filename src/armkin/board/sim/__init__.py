"""Boards inside the process, in simulated time.

sim_board.py            our own firmware's side of the protocol; sim_port.py: a port to it, also in the clock's time
frame_fields.py         what it reads
motion_frame_checks.py  what it checks of a motion and of limits; rate_checks.py, coupled_limits.py: two of these checks
command_frames.py       what it does with a frame; host_settings.py: its configuration
sim_motors.py           moves its motors: segment_queue.py, sim_homing.py, sim_jogging.py; cruise.py: for the last two
axis_counts.py          its counts; digital_inputs.py: its switches

clock.py          the time of the others
sim_grbl.py       GRBL; grbl_modes.py: what its lines mean; grbl_blocks.py: how they are carried out
sim_klipper.py    Klipper
sim_servo_bus.py  bus servos
"""
