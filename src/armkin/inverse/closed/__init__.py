"""Closed forms: one file for each geometry, with ``recognise(arm, task) -> Geometry | None``.

geometry.py        the interface of a class of arms
subproblems.py     the equations of the closed forms, with thresholds for double and single precision
candidates.py      candidates of a class with their residuals, from recorded code
quadratics.py      quadratic expressions of a cosine and a sine
wrist.py           three axes that meet
crossings.py       places where two self-motions meet
four_bars.py       circuits of planar and spherical four-bar linkages

planar.py          all joints in the base's x-y plane, and SCARAs
elbow.py           joints 2 and 3 (and 4) parallel: positions, with pitch, with pitch and roll
three_joints.py    any three joints that place a point: the quartic
spherical.py       three axes that meet in a point, at the wrist or at the shoulder
three_parallel.py  three parallel axes: the UR arms
newton_steps.py    arms close to one of these classes, whose roots are seeds of Newton's method
anywhere.py        three axes that are parallel or meet, anywhere in the arm
"""
