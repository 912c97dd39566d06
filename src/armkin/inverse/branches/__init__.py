"""Names of branches, their whole-turn copies, and branches along a path.

names.py        "left elbow up"
whole_turns.py  the nearest legal copy of a joint value; `turns`
tracking.py     a branch's number along a path
"""
