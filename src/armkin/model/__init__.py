"""The arm: a robot file as frozen arrays.

arm.py          `Arm`, one chain of constant links for all conventions
build_arm.py    `load_arm`, `arm_of_file`: DH tables and screws become that chain
joint_chain.py  chains reversed, flipped, shortened
rotation.py     matrices, roll pitch yaw, quaternions, rigid transforms
limits.py       joint limits
lock_joints.py  arms with joints held at fixed values
units.py        degrees and radians at the edge where people read and write them; target_numbers.py: a target's numbers
"""
