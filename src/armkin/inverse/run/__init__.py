"""How targets go through a solver.

single.py   one pose of a closed form in plain numbers, without numpy
chunks.py   closed forms: chunks of a batch that stay in the cache
edges.py    targets that a solver doubts: regular ones at once, the others posture by posture
workers.py  threads that share a batch
"""
