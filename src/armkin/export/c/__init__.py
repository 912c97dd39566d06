"""An arm as C99 that needs nothing but libm.

c_program.py     the files: header, source, test program
formulas.py      recorded formulas of an arm's candidates and targets
kernel.py        recorded formulas as functions of C
elimination.py   the general elimination: constants as data
keep_outs.py     what the arm must not touch: tables, and whether a posture is free
golden.py        what the test program compares with
source_parts.py  parts/: what is the same for all arms, in C
"""
