"""An arm as C99 that needs nothing but libm.

c_program.py        the files: header, source, test program
arm_formulas.py     recorded formulas of an arm's candidates and targets
c_functions.py      recorded formulas as functions of C
c_elimination.py    the general elimination: constants as data
keep_out_tables.py  what the arm must not touch: tables, and whether a posture is free
golden_values.py    what the test program compares with
source_parts.py     parts/: what is the same for all arms, in C
"""
