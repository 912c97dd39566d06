"""What serves every solver.

tolerances.py  every tolerance
newton.py      corrections of joint values for any arm and task
root_pairs.py  the same for two roots at once, which may meet
many_starts.py a search, for targets that no method settled
"""
