"""What a user gets.

batch.py      arrays of all targets, as the solvers fill them
solutions.py  the answer
rounding.py   how far a target's numbers may be off
closest.py    the nearest legal pose when there is no branch
"""
