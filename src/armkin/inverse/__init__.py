"""Inverse kinematics: every real branch of any arm.

The way of a target goes down this list, from what it prescribes to what a user gets:

tasks/        what a target prescribes, and which task fits an arm
numeric/      Newton's method for any arm and task, linear algebra of stacks, every tolerance
closed/       closed forms, one geometry a file: planar, elbow, three_joints, spherical, three_parallel, anywhere
elimination/  the numeric method for six joints anywhere
branches/     names, whole turns, numbers along a path
answers/      the answer as arrays, its rounding, the nearest legal pose where there is none
singular/     what a solution is: isolated, boundary or self-motion manifold
solvers/      which class an arm belongs to
run/          how targets go through: one alone, chunks of a batch, threads
held.py        joints that are held: the arm of the others, and its targets
follower.py    answers of the other joints at any value of the redundant one
followed.py    its branches, followed along it
ends.py        where these end
arm_angle.py   those curves in closed form, of a shoulder, an elbow and a wrist
arcs.py        the same traced through all joints, of other joints without a closed form
traced.py      and their families
pieces.py      pieces of such curves: intervals of the redundant joint
families.py    one joint more than the target asks for: intervals of the redundant joint
position_first.py  four or five joints asked for a pose: the position exact, the rotation as near as it goes
minima.py     the descent to those postures
solve.py      `ik`
choose.py     one branch a target, of an arm with joints held or swept, too; or why none is
"""
