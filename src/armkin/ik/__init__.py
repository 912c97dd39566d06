"""Inverse kinematics: every real branch.

tasks.py        what a target prescribes
geometry.py     which class an arm belongs to; one file a class:
                planar, elbow, position, spherical, three_parallel, axis, general
subproblems.py  the equations that the closed forms are made of
solve.py        `ik`: candidates -> residuals -> limits -> edges
edges.py        boundaries, singular postures, self-motions
closest.py      the nearest legal pose when there is no branch
"""
