"""Waypoints and paths to a trajectory: joint values over time.

The way of a path (`path.py`, `armkin.path`, which asks `path_planner.py`, of arms with a redundant joint
`redundant.py`; `walk.py` goes through its moves, `moves.py` says what each kind does):

path_numbers.py     the moves of a path file, in degrees, as joint values and targets
placing.py          where a drawing stands, and how the tool is held on it
geometry.py         lines, arcs, helices, splines and blends of the tool, each at unit speed
dense.py            targets on lines, gathered; fitting.py: one smooth curve of them; chords.py: what lies between them
least_knots.py      splines of few knots; b_spline.py: their least squares
route.py            one after another, with rests at corners; outline.py: those of a path, before anything is planned
branch_columns.py   every branch at samples of the route
joint_steps.py      steps from joint values to others, and how far the tip leaves its chord on them
linked_branches.py  every branch along the route, linked from sample to sample by a certificate
branch_chains.py    how far each carries, and the fewest runs that carry all
boundary.py         what branches that meet on a boundary make of it
wrist_turn.py       past a wrist singularity with the tool turned a little; windows.py: where it is
branch_path.py      the branch that is taken: joint values along the route
grid.py             exact at grid points, fine enough in between; on_route.py: Newton's method there, and slopes
time_optimal.py     its fastest law of time; time_law.py: the same for joint values given (`armkin.time_law`)
speed_bounds.py     what bounds it; cubics.py: on a way of cubics; scan.py: passes along it
hold_cap.py         how fast it may be for a hold on it
path_plan.py        the answer; branch_report.py: what is said of its branches; held.py: joints held
playback.py         a plan as it is drawn
jog_line.py         the line of one axis that a held button moves the tip along

The way of waypoints:

joint_moves.py      straight moves of all joints; profile.py: their law, speed up, cruise, slow down
corners.py          waypoints without a stop

What both make, and boards take:

trajectory.py       stretches from rest to rest; curve.py: a curved one; remainder.py: the rest of one that was held
proved_free.py      proofs that one hits nothing
"""
