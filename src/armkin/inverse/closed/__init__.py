"""Closed forms: one geometry a file, each with ``recognise(arm, task) -> Geometry | None``.

geometry.py        what a class provides
subproblems.py     the equations of the closed forms, and how close to an edge they are by the numbers they run in
candidates.py      a class's candidates with their residuals, from recorded code
quadratics.py      quadratic expressions of a cosine and a sine
wrist.py           three axes that meet
crossings.py       where a self-motion of a class meets another one
four_bars.py       which circuit of a planar or spherical four-bar linkage a posture is on

planar.py          all joints in the base's x-y plane, and SCARAs
elbow.py           joints 2 and 3 (and 4) parallel: positions, with pitch, with pitch and roll
three_joints.py    any three joints that place a point: the quartic
spherical.py       three axes that meet in a point, at the wrist or at the shoulder
three_parallel.py  three parallel axes: the UR arms
newton_steps.py    arms that miss one of these a little: its roots as seeds
anywhere.py        three axes that are parallel or meet, anywhere in the arm
"""
