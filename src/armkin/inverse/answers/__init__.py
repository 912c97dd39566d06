"""The answers of inverse kinematics.

batch.py      arrays for all targets, which the solvers fill
solutions.py  the answer of `armkin.ik`
rounding.py   the rounding error of a target's numbers
closest.py    the nearest legal pose of a target without a branch
"""
