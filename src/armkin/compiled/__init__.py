"""`armkin.compile`: the formulas of an arm as machine code, compiled on this computer.

compiled_arm.py      `compile`, and the compiled arm
compiled_task.py     the library of one arm and task, and its calls with arrays
joint_functions.py   poses, positions and clearances of joint values
one_target.py        one target at a time, in microseconds
followed_families.py  families of arms with a joint more than they need, as intervals of it
elimination_rows.py  branches of an elimination in C, for targets on an edge that Python examines
compiled_curves.py   families of seven joints that are traced
curves_source.py     the C file that traces them
batch_results.py     results of a batch in the layout of `Solutions`
table_lines.py       columns as lines of text
least_motion.py      the branches that move the joints least
c_source.py          the C file: the formulas of `armkin.export.c`, and the loop over a batch in parts/
families_source.py   the C text of families
boundaries_source.py  the C text of the places where families may change
toolchain.py         the system's compiler, and the cache of libraries
"""
