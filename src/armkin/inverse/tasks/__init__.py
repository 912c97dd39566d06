"""Tasks: what a target prescribes.

task.py         a target's numbers and how they are read
residuals.py    what joint values miss of a target, and its Jacobian
choose_task.py  which task fits an arm
"""
