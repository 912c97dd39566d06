"""Runs solvers on targets.

single.py   one target of a closed form in plain numbers, without numpy
chunks.py   closed forms: chunks of a batch that fit the cache
folds.py    doubted targets whose branches stand alone or meet in pairs, decided by two Jacobians for each pair
edges.py    all other targets that a solver doubts
"""
