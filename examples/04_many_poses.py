"""Batches: leading axes are batch axes everywhere."""

import numpy as np

import armkin

arm = armkin.load("puma560")
q = np.random.default_rng(0).uniform(arm.lower, arm.upper, (100, 200, arm.n))
T = armkin.fk(arm, q)  # (100, 200, 4, 4)
s = armkin.ik(arm, T)  # s.q is (100, 200, branches, 6), nan past the last branch
found = np.abs(armkin.fk(arm, s.q[s.valid]) - T[np.nonzero(s.valid)[:2]]).max()
print(T.shape, s.q.shape, f"{s.valid.sum():,} branches, all within {found:.0e} of their targets")
