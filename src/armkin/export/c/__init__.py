"""Exports an arm as C99 that needs only libm.

c_program.py        the files: header, source, test program
c_functions.py      recorded formulas as functions of C
c_elimination.py    the general elimination, with the constants of an arm as data
keep_out_tables.py  keep-outs as tables of C, and the test whether a posture is free
golden_values.py    reference values of the test program
source_parts.py     the C files in parts/, which are the same for all arms
"""
