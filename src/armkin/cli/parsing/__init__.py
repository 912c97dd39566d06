"""From words and rows to values.

options.py           options that several commands share; completion.py: completion by Tab
arguments.py         the arm, a pose, a target
lock_and_sweep.py    joints held or swept
negative_numbers.py  keeps negative numbers from being taken for options
number_parsing.py    numbers as users write them
unit_notes.py        notes on numbers that look like metres or radians
row_chunks.py        rows of numbers in chunks
csv_to_numbers.py    rows from CSV
piped_answers.py     answers of another command on standard input
path_options.py      options of `path`, its moves and numbers
drawing_path.py      drawings as paths: G-code and SVG
lerobot_zero.py      the calibration file of `zero --from`
"""
