"""Formulas that run on arrays or numbers, and are recorded as code.

arrays.py         entries of formulas: arrays over the batch, or constant numbers
pose.py           transforms as twelve entries
array_shapes.py   names for the shapes of arrays
array_tuples.py   named tuples of arrays with a row for each target: selecting and stacking rows
linear_systems.py solves many small systems of equations at once
recording.py      runs a formula once on symbols and records its operations
numpy_code.py     writes a recording as numpy calls, for batches
python_code.py    writes it as plain Python, for one posture
c_and_js_code.py  writes it as C99 or JavaScript
trace.py          runs a formula as numpy or Python code
"""
