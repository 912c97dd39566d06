"""Inverse kinematics: every real branch.

The way of a target:

tasks.py        what a target prescribes, and which task fits an arm
geometry.py     which class an arm belongs to, and what a class provides
solve.py        `ik`: candidates -> residuals -> whole turns and limits -> edges
limits.py       whole turns: which copy of a joint value is legal and nearest; `turns`
edges.py        boundaries, singular postures, self-motions
solutions.py    the answer; names.py: what its branches are called; tracking.py: their numbers along a path
closest.py      the nearest legal pose when there is no branch

The classes, one file each, in the order in which they are asked:

planar.py          all joints in the base's x-y plane, and SCARAs
elbow.py           joints 2 and 3 (and 4) parallel: positions, with pitch, with pitch and roll
position.py        any three joints that place a point: the quartic
spherical.py       three axes that meet in a point, at the wrist or at the shoulder
three_parallel.py  three parallel axes: the UR arms
near.py            all but one of these: its branches, corrected on the true arm
axis.py            five joints, the tool's position and z axis: a class for poses and a virtual joint
general.py         every other arm of up to six joints: the elimination

What they are made of:

subproblems.py  the equations of the closed forms
chain.py        chains flipped, reversed, inverted
numeric.py      Newton corrections for any arm and task

The elimination, from the chain to the branches:

elimination.py    the method, why it is complete, `prepare` and `solve`
loop.py           the chain closed and scaled
roles.py          which joint plays which part
line_features.py  the numbers of a line on which rigid motions are matrices
ends.py           removes the two end joints, and gives them back
pencil.py         the eigenvalue problem of the middle joints
roots.py          its roots as joint values
polish.py         Newton and Levenberg-Marquardt on the chain
merge.py          equal answers made one, rows packed by pose
slides.py         three prismatic joints: a closed form instead
nudge.py          batched linear algebra that outlives one singular member
"""
