"""Waypoints and paths to a trajectory: joint values over time.

A path goes down this list, from the curve of the tool to the answer:

timing/             the law of time: how fast along a way, within the limits of joints and motors
tool_path/          the tool's way: lines, arcs, splines, blends, dense points, one after another
plan/               the answer, how it is drawn, and the proof that it hits nothing
branches/           the joints' ways: every branch along the tool's way, and the one that is taken
path_planner/       `armkin.path`: through the moves of a path, one after another, to their plan
drawing_to_path.py  `armkin.drawing`: G-code and SVG as such a path

The way of waypoints:

joint_moves.py        straight moves of all joints
rounded_waypoints.py  waypoints without a stop
time_law.py           `armkin.time_law`: the fastest law of time of joint values given
remaining_stretch.py  what is left of a stretch that was held
"""
