"""The law of time: how fast along a way, within the limits of joints and motors.

profile.py           of a straight move: speed up, cruise, slow down, with or without jerk
time_optimal.py      of a curved one, the fastest; speed_bounds.py: what bounds it; cubic_knots.py: on a way of cubics
speed_scan.py        passes along it, forwards and backwards
hold_speed_limit.py  how fast it may be so that it can be held on its way
trajectory.py        what boards take: stretches from rest to rest; curved_stretch.py: a curved one
limit_jerk.py        a curved one made smooth
"""
