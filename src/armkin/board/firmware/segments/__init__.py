"""A trajectory as moves in counts, and these as segments of constant acceleration.

trajectory_to_counts.py  a trajectory as moves in counts, refused where it is too fast
counts_to_segments.py    pieces of constant acceleration as exact segments
straight_lines.py        which pieces a straight line has; curve_segments.py: any other stretch
remaining_plan.py        what is left of a plan that was held
"""
