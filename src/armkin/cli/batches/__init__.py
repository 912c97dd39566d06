"""Many rows, in parallel.

batch_pieces.py   pieces of a batch for parallel work
batch_answers.py  their answers, and the exit code of all
compiled_ik.py    ik and fk by machine code, as functions that other processes find by name
"""
