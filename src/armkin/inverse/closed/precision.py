"""How close to an edge a closed form is, by the numbers that it runs in.

An edge is what is one within the rounding of a pose: in float an arm's own pose with a straight wrist comes out of the
forward kinematics some units of the last place beside it. The code is recorded with the thresholds of its numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple

from armkin.inverse.numeric import tolerances as tol


class Precision(NamedTuple):
    """Thresholds of `tolerances`, relative to the equation's own size."""

    tangent: float
    sharp: float
    one_root: float
    free: float
    nearly_free: float
    nearby: float  # squared residual up to which a branch may be one


ULPS = 128 * 2.0**-23  # of a float: a pose of six joints is off by ten to a hundred
DOUBLE = Precision(tol.TANGENT, tol.SHARP, tol.ONE_ROOT, tol.FREE, tol.NEARLY_FREE, tol.NEARBY**2)
SINGLE = Precision(ULPS, ULPS**2, ULPS, ULPS**2, 4.0 * ULPS**2, ULPS**2)

_current = ContextVar("precision", default=DOUBLE)


def precision() -> Precision:
    """Of the numbers that formulas are evaluated, or recorded, for."""
    return _current.get()


@contextmanager
def recorded_for(numbers: Precision) -> Iterator[None]:
    """Formulas inside are recorded for other numbers."""
    token = _current.set(numbers)
    try:
        yield
    finally:
        _current.reset(token)
