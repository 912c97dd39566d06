"""A window: the stretch of a route on which the wrist passes a singularity without a swing of joint 4.

In one kind the wrist joints are cubics, the first three joints hold the tip on the path, and the tool turns a little.
In the other the tip makes a detour within the tolerance to where the wrist is straight, and the tool does not turn.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.forward import jacobian, position
from armkin.inverse.numeric.newton import nudged
from armkin.motion.branches.joint_steps import whole_turns

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.tool_path.route import Detour, Route

_NEWTON_STEPS = 12  # steps of Newton's method
_MAX_STEP = 0.1  # length [rad], at most, of a step of Newton's method


@dataclass(frozen=True)
class Window:
    """Joint values and slopes at both ends of a window, and how far the tool turns aside in it."""

    begin: float
    end: float
    q: Array  # (2, n) [rad]
    d: Array  # (2, n) [rad/mm]
    turned: float  # [rad] at most
    detour: Detour | None = None

    @property
    def tip_offset(self) -> float:
        """How far the tip goes aside [mm]."""
        return 0.0 if self.detour is None else float(np.linalg.norm(self.detour.displacement))

    def joints(self, arm: Arm, route: Route, s: Array, offset: Array | float = 0.0) -> Array:
        """Joint values at lengths s (N,) in the window: (N, n); offset: whole turns (n,) of a copy."""
        h = self.end - self.begin
        f = ((s - self.begin) / h)[:, None]
        d0, d1, chord = self.d[0] * h, self.d[1] * h, self.q[1] - self.q[0]
        q = self.q[0] + f * (d0 + f * (3 * chord - 2 * d0 - d1 + f * (d0 + d1 - 2 * chord)))
        goal = route.targets(s)[:, :3, 3]
        for _ in range(_NEWTON_STEPS):
            miss = goal - position(arm, q)
            # nudged, as the first three joints may be exactly singular
            step = nudged(np.linalg.solve, np.asarray(jacobian(arm, q))[:, :3, :3], miss[:, :, None])[..., 0]
            size = np.abs(step).max(axis=1, initial=1e-300, keepdims=True)
            q[:, :3] += np.minimum(_MAX_STEP / size, 1.0) * step
            if size.max(initial=0.0) < 1e-13:
                break
        return np.asarray(q + offset)

    def turns_to_copy(self, arm: Arm, q: Array) -> Array:
        """Whole turns (n,) from the window to a run's copy of it; q: (n,) joint values of the run in the window."""
        turns = whole_turns(arm)
        return np.asarray(turns * np.rint((q - self.q.mean(axis=0)) / turns))


def add_detours(route: Route, windows: tuple[Window, ...]) -> Route:
    """A route with the detours of its windows."""
    detours = tuple(window.detour for window in windows if window.detour is not None)
    return replace(route, detours=detours) if detours else route
