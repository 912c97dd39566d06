"""Inverse kinematics: every real branch of any arm.

The way of a target:

tasks/              what a target prescribes, and which task fits an arm
recognise.py        which class an arm belongs to
solve.py            `ik`: candidates -> residuals -> whole turns and limits -> singularities
one_target.py       a single pose of a closed form in plain numbers, without numpy
batch.py            arrays of all targets, as the solvers fill them
chunks.py           closed forms: chunks of a batch that stay in the cache; workers.py: threads that share it
near_itself.py      `near` where it solves its target itself
target_rounding.py  how far a target's numbers may be off, which `near` may miss
singular/           what a solution is: the residual along the lost direction
singularities.py    boundaries and singular postures
doubtful.py         targets that may be singular: regular_targets.py decides most at once, singularities.py the rest
fold_singularities.py  postures at which two roots meet, told from self-motions
clusters.py         what rounding makes of one root of third or fourth order
valleys.py          whether two roots are points of one curved valley
self_motions.py     whether joints can move while the target is kept, and what lies on one self-motion
null_directions.py  the directions that a posture loses
corners.py          postures in which self-motions meet, replaced by one of each
circuits.py         the connected pieces of a self-motion of three joints or more
legal_postures.py   edges of which only other postures than those listed are within limits
free_postures.py    self-motions beside keep-outs: by their nearest free posture
solutions.py        the answer
choose.py           one branch a target, of an arm with joints held or swept, too; or why none is
closest.py          the nearest legal pose when there is no branch

The classes, in the order in which they are asked:

closed/             one geometry a file: planar, elbow, three_joints, spherical, three_parallel, anywhere
nearly_special.py   all but one of these: its branches, corrected on the true arm
tool_axis.py        five joints, the tool's position and z axis: a class for poses and a virtual joint
general.py          every other arm of up to six joints
elimination/        the numeric method behind it

What serves them all:

numeric/            Newton's method for any arm and task, linear algebra of stacks
branches/           names, whole turns, numbers along a path
"""
