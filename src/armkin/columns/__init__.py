"""Many answers as columns: arrays, and the files that hold them.

table.py               a table: name -> array
csv_and_json_lines.py  CSV and JSON Lines; csv_cells.py: single lines
npz.py                 numpy's archive of arrays
parquet.py             Parquet (pyarrow)
formats.py             which of them a file's ending means
input_columns.py       columns of numbers from .npz, .parquet and .jsonl, chunk by chunk
finished_chunks.py     finished chunks beside a file that is not whole yet, and how a later run goes on with them
fk_columns.py          joint values to the columns of fk and pulses
ik_columns.py          targets to the columns of ik
joint_columns.py       the columns of joints beside others of the same name
"""
