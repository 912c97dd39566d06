"""Inverse kinematics: every real branch of any arm.

The way of a target goes down this list, from what it prescribes to what a user gets:

tasks/            what a target prescribes, and which task fits an arm
numeric/          Newton's method for any arm and task, linear algebra of stacks, every tolerance
closed/           closed forms, one geometry a file: planar, elbow, three_joints, spherical, three_parallel, anywhere
elimination/      the numeric method for six joints anywhere
branches/         names, whole turns, numbers along a path
answers/          the answer as arrays, its rounding, the nearest legal pose where there is none
singular/         what a solution is: isolated, boundary or self-motion manifold
solvers/          which class an arm belongs to
run/              how targets go through: one alone, chunks of a batch, threads
redundant/        more joints than the target has numbers: families along one joint, the least rotation at a position
solve.py          `ik`
choose_branch.py  one branch a target, of an arm with joints held or swept, too; or why none is
"""
