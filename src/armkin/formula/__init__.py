"""Formulas written once: run on arrays, on plain numbers, or recorded as code.

arrays.py  entries: arrays over the batch, or numbers known to be constant
pose.py    transforms as twelve entries
trace.py   a formula run once on symbols, its operations recorded and written as straight-line code
"""
