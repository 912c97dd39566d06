"""Formulas written once: run on arrays, on plain numbers, or recorded as code.

arrays.py         entries: arrays over the batch, or numbers known to be constant
pose.py           transforms as twelve entries
array_shapes.py   names for the shapes of arrays
array_tuples.py   named tuples of arrays with a row a target: some rows, several parts one below the other
recording.py      a formula run once on symbols, its operations kept as a list
numpy_code.py     that list as numpy calls, for batches
python_code.py    as plain Python, for one pose
c_and_js_code.py  as C99 or JavaScript
trace.py          a formula with its numpy and its Python code
"""
