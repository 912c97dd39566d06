"""Batches: leading axes are batch axes everywhere."""

import numpy as np

import armkin

arm = armkin.load("puma560")
q = np.random.default_rng(0).uniform(arm.lower, arm.upper, (100, 200, arm.n))
T = armkin.fk(arm, q)  # (100, 200, 4, 4)
solutions = armkin.ik(arm, T)  # solutions.q is (100, 200, branches, 6), nan past the last branch
rows, columns, _ = np.nonzero(solutions.valid)  # the target of every branch
error = np.abs(armkin.fk(arm, solutions.q[solutions.valid]) - T[rows, columns]).max()
print(T.shape, solutions.q.shape, f"{len(rows):,} branches, all within {error:.0e} of their targets")
