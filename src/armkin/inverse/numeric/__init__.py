"""What serves every solver.

tolerances.py  every tolerance
newton.py      corrections of joint values for any arm and task
many_starts.py a search, for targets that no method settled
"""
