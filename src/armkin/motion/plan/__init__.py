"""A plan of a path.

path_plan.py         the answer: trajectory, deviation, lengths and what else is told
playback_times.py    a plan as it is drawn
trajectory_proof.py  the proof that a trajectory hits nothing
"""
