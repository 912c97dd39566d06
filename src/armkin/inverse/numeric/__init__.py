"""What serves every solver.

tolerances.py  every tolerance
newton.py      corrections of joint values for any arm and task, and from many starts, where no method settled a target
"""
