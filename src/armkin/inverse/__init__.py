"""Inverse kinematics: every real branch of any arm.

The way of a target:

tasks/              what a target prescribes, and which task fits an arm
recognise.py        which class an arm belongs to
solve.py            `ik`: candidates -> residuals -> whole turns and limits -> singularities
chunks.py           closed forms: chunks of a batch that stay in the cache; workers.py: threads that share it
singularities.py    boundaries and singular postures; clusters.py: roots of higher order
self_motions.py     whether joints can move while the target is kept, and what lies on one self-motion
solutions.py        the answer
closest.py          the nearest legal pose when there is no branch

The classes, in the order in which they are asked:

closed/             one geometry a file: planar, elbow, three_joints, spherical, three_parallel
nearly_special.py   all but one of these: its branches, corrected on the true arm
tool_axis.py        five joints, the tool's position and z axis: a class for poses and a virtual joint
general.py          every other arm of up to six joints
elimination/        the numeric method behind it

What serves them all:

numeric/            Newton's method for any arm and task, linear algebra of stacks
branches/           names, whole turns, numbers along a path
"""
