"""How targets go through a solver.

single.py   one pose of a closed form in plain numbers, without numpy
chunks.py   closed forms: chunks of a batch that stay in the cache
folds.py    targets that a closed form doubts whose branches stand alone or meet in pairs: from two Jacobians a pair
edges.py    all other targets that a solver doubts
workers.py  threads that share a batch
"""
