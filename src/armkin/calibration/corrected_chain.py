"""An arm with small corrections: five for each link, a ratio for each joint, six for base and tool each.

The link between the axes of joints i and i + 1 is A_i B_i. The x axis of A_i is along the common normal of the axes (or
towards the next joint, if the axes are parallel within a few degrees), and its origin is on the next axis. A corrected
arm is

    Base(6) link[0] Z1(r1 c1 + z1) A_1 Tz(d) Tx(a) Rx(alpha) Ry(beta) B_1 Z2(r2 c2 + z2) ... link[n] Tool(6)

with commanded joint values c. Without Hayati's beta, a parallel axis could not tilt about the direction of the normal
(Hayati and Mirmirani, Improving the absolute positioning accuracy of robot manipulators, 1985). The set of corrections
is complete but not minimal; the prior of `fit_corrections` decides between corrections with the same effect.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.model.rotation import inverse

if TYPE_CHECKING:
    from armkin.model.arm import Arm

KINDS = ("base", "tool", "zeros", "ratios", "lengths", "twists")
NEARLY_PARALLEL = 0.05  # angle [rad] below which the common normal may be too far away for corrections

# prior: standard deviations between a built arm and its table; those of base and measuring tip are large, because
# users place and mount them by hand
LENGTH_PRIOR, SLIDE_PRIOR, RATIO_PRIOR = 0.5, 0.5, 0.003  # [mm, mm, 1]
TWIST_PRIOR, ZERO_PRIOR = math.radians(0.3), math.radians(1.0)
BASE_PRIOR, TOOL_PRIOR = 200.0, 20.0  # [mm]
BASE_TURN_PRIOR, TOOL_TURN_PRIOR = math.radians(30.0), math.radians(10.0)


class Parameter(NamedTuple):
    """One correction: its kind, its name in texts, its unit, and the standard deviation of its prior."""

    kind: str
    name: str
    unit: str  # mm, rad or 1
    prior: float


class _Step(NamedTuple):
    """A factor of the chain: a constant, or a motion along or about the x, y or z axis."""

    constant: Array | None
    axis: int = 2
    turns: bool = True
    joint: int = -1  # number of the joint whose own motion it is
    parameter: int = -1


@dataclass(frozen=True, eq=False)
class CorrectedChain:
    """The corrected chain of one arm."""

    arm: Arm
    parameters: tuple[Parameter, ...]
    steps: tuple[_Step, ...]

    @cached_property
    def prior(self) -> Array:
        """Standard deviations (P,) of the prior."""
        return np.array([parameter.prior for parameter in self.parameters])

    def indices(self, kind: str) -> NDArray[np.intp]:
        """Indices of the parameters of a kind."""
        return np.flatnonzero([parameter.kind == kind for parameter in self.parameters])

    def poses(self, corrections: Array, commanded: Array) -> tuple[Array, Array]:
        """Poses of commanded values (M, n) with corrections (P,), and their derivatives.

        Returns (M, 4, 4) and (M, 6, P): the translation [mm] (first rows) and rotation [rad] of the tip in the
        measuring frame for a unit of each correction.
        """
        M, n = commanded.shape
        T = np.zeros((M, 4, 4)) + np.eye(4)
        axes = np.zeros((len(self.parameters), M, 3))
        points = np.zeros((len(self.parameters), M, 3))
        rotates = np.zeros(len(self.parameters), bool)
        zeros, ratios = self.indices("zeros"), self.indices("ratios")
        for step in self.steps:
            if step.constant is not None:
                T = T @ step.constant
                continue
            j = step.joint
            k = zeros[j] if j >= 0 else step.parameter
            axes[k], points[k], rotates[k] = T[:, :3, step.axis], T[:, :3, 3], step.turns
            value: Array | float = corrections[k]
            if j >= 0:
                value = corrections[k] + (self.arm.ratio[j] + corrections[ratios[j]]) * commanded[:, j]
            T = _move_columns(T, step, value)
        tip = T[:, :3, 3]
        is_rotation = rotates[:, None, None]
        translations = np.where(is_rotation, np.cross(axes, tip - points), axes)
        J = np.concatenate([translations, axes * is_rotation], axis=2).transpose(1, 2, 0)
        for j in range(n):
            J[:, :, ratios[j]] = J[:, :, zeros[j]] * commanded[:, j, None]
        return T, J

    def corrected_arm(self, corrections: Array) -> tuple[Arm, Array]:
        """The arm with corrections (P,), and its tool (4, 4)."""
        arm, ratios = self.arm, self.indices("ratios")
        links: list[Array] = []
        T = np.eye(4)
        for step in self.steps:
            if step.constant is not None:
                T = T @ step.constant
            elif step.joint < 0:
                T = T @ _axis_motion(step, corrections[step.parameter])
            else:
                links.append(T @ _axis_motion(step, corrections[self.indices("zeros")[step.joint]]))
                T = np.eye(4)
        links.append(T)
        base = self._product("base", corrections) @ arm.base
        sign = np.where(arm.dh_sign < 0, -1.0, 1.0)
        zeros = corrections[self.indices("zeros")]
        corrected_arm = replace(
            arm,
            link=_freeze(np.array(links)),
            base=_freeze(base),
            ratio=_freeze(arm.ratio + corrections[ratios]),
            dh_theta=_freeze(arm.dh_theta + np.where(arm.prismatic, 0.0, sign * zeros)),
        )
        return corrected_arm, self._product("tool", corrections)

    def _product(self, kind: str, corrections: Array) -> Array:
        """The product of the motions of one kind."""
        T = np.eye(4)
        for step in self.steps:
            if step.parameter >= 0 and self.parameters[step.parameter].kind == kind:
                T = T @ _axis_motion(step, corrections[step.parameter])
        return T


def correction_model(arm: Arm) -> CorrectedChain:
    """The model of an arm with a correction at every place."""
    parameters: list[Parameter] = []
    steps: list[_Step] = []

    def add_motion(kind: str, name: str, unit: str, prior: float, axis: int) -> None:
        steps.append(_Step(None, axis, unit == "rad", parameter=len(parameters)))
        parameters.append(Parameter(kind, name, unit, prior))

    def add_frame(kind: str, distance_prior: float, turn_prior: float) -> None:
        for axis in range(3):
            add_motion(kind, f"{kind} {'xyz'[axis]}", "mm", distance_prior, axis)
        for axis in (2, 1, 0):
            add_motion(kind, f"{kind} {('roll', 'pitch', 'yaw')[axis]}", "rad", turn_prior, axis)

    add_frame("base", BASE_PRIOR, BASE_TURN_PRIOR)
    steps.append(_Step(arm.link[0]))
    for joint, name in enumerate(arm.joint_names):
        is_prismatic = bool(arm.prismatic[joint])
        steps.append(_Step(None, 2, not is_prismatic, joint=joint))
        unit, prior = ("mm", SLIDE_PRIOR) if is_prismatic else ("rad", ZERO_PRIOR)
        parameters.append(Parameter("zeros", f"{name} zero", unit, prior))
        parameters.append(Parameter("ratios", f"{name} ratio", "1", RATIO_PRIOR))
        if joint == arm.n - 1:
            break
        A = _link_along_normal(arm.link[joint + 1], arm.reach)
        steps.append(_Step(A))
        add_motion("lengths", f"{name} d", "mm", LENGTH_PRIOR, 2)
        add_motion("lengths", f"{name} a", "mm", LENGTH_PRIOR, 0)
        add_motion("twists", f"{name} alpha", "rad", TWIST_PRIOR, 0)
        add_motion("twists", f"{name} beta", "rad", TWIST_PRIOR, 1)
        steps.append(_Step(inverse(A) @ arm.link[joint + 1]))
    steps.append(_Step(arm.link[-1]))
    add_frame("tool", TOOL_PRIOR, TOOL_TURN_PRIOR)
    return CorrectedChain(arm, tuple(parameters), tuple(steps))


def _link_along_normal(link: Array, reach: float) -> Array:
    """The frame A_i: x along the common normal of a link's two axes, and its origin on the second axis."""
    z, p = link[:3, 2], link[:3, 3]
    sine = math.hypot(z[0], z[1])
    A = np.eye(4)
    if sine > NEARLY_PARALLEL:
        x = np.array([-z[1], z[0]]) / sine
        shift = float((p[:2] - (x @ p[:2]) * x) @ z[:2]) / sine**2
        A[:3, 3] = p - shift * z
        if np.linalg.norm(A[:3, 3]) > 2 * reach:  # with a far normal, keep the file's origin
            A[:3, 3] = p
    else:
        length = math.hypot(p[0], p[1])
        x = p[:2] / length if length > 1e-9 * reach else np.array([1.0, 0.0])
        A[:2, 3] = p[:2]
    A[:2, 0], A[:2, 1] = x, (-x[1], x[0])
    return A


def _axis_motion(step: _Step, value: float) -> Array:
    """The transform (4, 4) of a motion along or about an axis."""
    return _move_columns(np.eye(4), step, value)


def _move_columns(T: Array, step: _Step, value: Array | float) -> Array:
    """Transforms (..., 4, 4) times a motion along or about an axis, which changes the origin or two columns."""
    T, shift = T.copy(), np.asarray(value)[..., None]
    if step.turns:
        i, j = (step.axis + 1) % 3, (step.axis + 2) % 3
        a, b = T[..., i].copy(), T[..., j].copy()
        c, s = np.cos(shift), np.sin(shift)
        T[..., i], T[..., j] = c * a + s * b, c * b - s * a
    else:
        T[..., 3] += shift * T[..., step.axis]
    return T


def _freeze(values: Array) -> Array:
    values.flags.writeable = False
    return values
