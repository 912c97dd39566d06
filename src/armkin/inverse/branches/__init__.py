"""What branches are called, which whole turn of theirs is wanted, and which continues which.

names.py        "left elbow up"
whole_turns.py  which copy of a joint value is legal and nearest; `turns`
tracking.py     a branch's number along a path
"""
