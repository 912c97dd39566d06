"""Many small systems of equations, eliminated at once."""

import numpy as np

from armkin.formula.linear_systems import eliminate


def test_systems_are_solved_and_those_with_a_weak_pivot_are_named() -> None:
    """Of 1,000 random systems of seven equations, one of them singular, each has the solution of LAPACK."""
    rng = np.random.default_rng(3)
    A, b = rng.standard_normal((1000, 7, 7)), rng.standard_normal((1000, 7, 2))
    A[5, 6] = A[5, 0]
    columns = np.ascontiguousarray(np.concatenate([A, b], axis=2).transpose(1, 2, 0))
    with np.errstate(all="ignore"):
        weak = eliminate(columns, 1e-3)
    assert weak[5]
    assert weak.mean() < 0.05
    x = columns[:, 7:].transpose(2, 0, 1)
    sound = ~weak
    error = np.abs(x - np.linalg.solve(A + 1e-30, b))[sound]
    assert error.max() <= 1e-6
    assert np.median(error) <= 1e-14
