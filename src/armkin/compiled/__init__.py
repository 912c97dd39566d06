"""An arm's formulas as machine code, built on this computer: `armkin.compile`.

compiled_arm.py      `compile`, and what it returns
joint_functions.py   poses, positions and clearances of joint values
one_target.py        one target at a time, in microseconds
elimination_rows.py  an elimination's branches for targets on an edge, which Python examines
batch_results.py     results of a batch, as `Solutions` has them
table_lines.py       columns as lines of text
least_motion.py      of many branches those that move the joints least
c_source.py          the C file: the formulas of `armkin.export.c`, and the loop over a batch in parts/
toolchain.py         the system's compiler, and the folder of what it has built
"""
