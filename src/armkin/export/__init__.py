"""Exports an arm to other formats.

conventions.py       robot files in another convention: screws, DH standard or modified
urdf_writer.py       URDF, with limits, speeds and visuals
arm_json.py          plain numbers for JSON
arm_formulas.py      for C and JavaScript: recorded formulas of an arm's candidates and targets
class_forms.py       for both: which classes can be written, and why others cannot
elimination_data.py  for both: constants of the general elimination
keep_out_pairs.py    for both: segments, obstacles, and the pairs that must not touch
c/                   C99 that needs only libm
js/                  an ES module without imports
"""
