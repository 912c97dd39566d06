"""The model of an arm: frozen arrays made from a robot file.

arm.py          `Arm`, one chain of constant links for all conventions
build_arm.py    `load_arm`, `arm_of_file`: convert DH tables and screws to that chain
joint_chain.py  chains of joints, and their reversal
rotation.py     matrices, roll pitch yaw, quaternions, rigid transforms
limits.py       joint limits
lock_joints.py  arms with joints held at fixed values
units.py        conversion from and to degrees, for input and output; target_numbers.py: the same for targets
"""
