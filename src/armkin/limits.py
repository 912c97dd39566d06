"""Joint limits: who is outside."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from armkin.arm import Arm

SLACK = 1e-9  # [rad | mm] a joint this far outside still counts as on its limit


def outside(arm: Arm, q: ArrayLike) -> NDArray[np.bool_]:
    """Which joints are outside their limits.

    q: (..., n) [rad | mm]. Returns (..., n); a joint without limits is never outside.

    >>> import armkin, numpy as np
    >>> outside(armkin.load("robots/three_dof.yaml"), np.deg2rad([0, 121, 0])).tolist()
    [False, True, False]
    """
    values = np.asarray(q, dtype=float)
    return (values < arm.lower - SLACK) | (values > arm.upper + SLACK)
