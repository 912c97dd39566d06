"""`armkin.compile`: the formulas of an arm as machine code, compiled on this computer.

compiled_arm.py      `compile`, and the compiled arm
compiled_task.py     the library of one arm and task, and its calls with arrays
joint_functions.py   poses, positions and clearances of joint values
one_target.py        one target at a time, in microseconds
elimination_rows.py  branches of an elimination in C, for targets on an edge that Python examines
followed_families.py  families of arms with a joint more than they need, as intervals of it
compiled_curves.py   families of seven joints that are traced
known_curves.py      families from C, and numpy's of the targets that it leaves
batch_results.py     results of a batch in the layout of `Solutions`
table_lines.py       columns as lines of text
least_motion.py      the branches that move the joints least
c_source.py          the C file: the formulas of `armkin.export.c`, and the loop over a batch in parts/
families_source.py   the C text of families that are followed
curves_source.py     the C file of those that are traced
boundaries_source.py  the C text of the places where families may change
own_parts.py         the parts of C text
toolchain.py         the system's compiler, and the cache of libraries
"""
