"""Converts joint values to motor pulses and back, and computes the error of the tip by rounding.

The exact pulse of a motor is linear in the joint values,

    x = motor_bias + motor_gain (q - home)

where the bias is 0 for steppers, whose pulses are counted from home, the pulse width at home [us] for RC servos, and
the count at home for bus servos. Motors and joints need not correspond one to one (belts, differentials, two motors at
one shoulder); the pseudoinverse of the matrix gives the joints from the pulses.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import UsageError
from armkin.formula import arrays
from armkin.formula.arrays import Array
from armkin.forward import as_joints, position

if TYPE_CHECKING:
    from armkin.model.arm import Arm

Pulses = NDArray[np.int64]

_MAX_PULSES = 2.0**53  # number of pulses up to which doubles represent all whole numbers
_HALF = 1e-9  # distance [pulses] from a half that counts as a half, as degrees have no exact radians
_CANDIDATES = 4096  # pulse vectors that `best_pulses` tries for one pose
_AT_ONCE = 1 << 16  # tips that `best_pulses` computes together


@dataclass(frozen=True)
class Rounding:
    """Joint values rounded to whole pulses, with the exact and the actual tip.

    Attributes:
        joints: (..., n) [rad | mm] as asked.
        pulses: (..., motors) [steps from home | us | counts].
        actual_joints: (..., n) [rad | mm] joint values at those pulses.
        theoretical: (..., 3) [mm] the tip for the exact joints.
        actual: (..., 3) [mm] the tip for the actual joints.
    """

    joints: Array
    pulses: Pulses
    actual_joints: Array
    theoretical: Array
    actual: Array

    @property
    def difference(self) -> Array:
        """(..., 3) [mm] absolute error of the actual tip along each axis."""
        return np.abs(self.actual - self.theoretical)

    @property
    def error(self) -> Array:
        """(...) [mm] distance between the exact and the actual tip."""
        return np.asarray(np.linalg.norm(self.actual - self.theoretical, axis=-1))


@dataclass(frozen=True)
class Best:
    """The pulses whose tip is nearest to the exact tip, and plainly rounded pulses.

    Attributes:
        chosen: the pulses with the nearest tip.
        rounded: every motor rounded by itself.
        tried: pulse vectors compared for each pose.
    """

    chosen: Rounding
    rounded: Rounding
    tried: int

    @property
    def gain(self) -> Array:
        """(...) [mm] reduction of the error by the chosen pulses; never negative."""
        return self.rounded.error - self.chosen.error


def pulses(arm: Arm, q: ArrayLike) -> Pulses:
    """Whole pulses of every motor: steps counted from home, or the pulse widths or counts of servos.

    Halves round away from zero. A width outside a servo's travel is returned as it is: nothing is clamped.

    Args:
        arm: the arm, as `armkin.load` gives it.
        q: (..., n) [rad | mm] joint values; leading axes are a batch.

    Returns:
        (..., motors) whole numbers [steps from home | us | counts], a motor's unit by its kind: stepper, RC or bus
        servo.

    Raises:
        UsageError: the arm's motors do not determine its joints, or q is no finite (..., n), or beyond 2^53 pulses.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("robots/three_dof.yaml")
    >>> armkin.pulses(arm, np.deg2rad([-30, 5, -5])).tolist()
    [-1067, -10144, 5667]
    """
    exact, tolerance = _exact_and_slack(arm, q)
    magnitude = np.floor(np.abs(exact) + (0.5 + tolerance))
    return np.copysign(magnitude, exact).astype(np.int64)


def exact_pulses(arm: Arm, q: ArrayLike) -> Array:
    """Pulses of every motor before they are rounded: (..., n) [rad | mm] -> (..., motors)."""
    return _exact_and_slack(arm, q)[0]


def joints(arm: Arm, p: ArrayLike) -> Array:
    """Joint values of motors at these pulses.

    With more motors than joints, the joints are those that fit all motors best (least squares).

    Args:
        arm: the arm, as `armkin.load` gives it.
        p: (..., motors) [steps from home | us | counts] pulses, whole or not.

    Returns:
        (..., n) [rad | mm] joint values.

    Raises:
        UsageError: the motors do not determine the joints, p is no finite (..., motors), or motors of one joint
            contradict each other by more than their rounding.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("robots/three_dof.yaml")
    >>> np.rad2deg(armkin.joints(arm, [-1067, -10144, 5667])).round(6).tolist()
    [-30.009375, 4.998371, -4.995]
    """
    inverse = joints_per_pulse(arm)
    values = arrays.real_array(p, "pulses")
    count = len(arm.motor_gain)
    if values.ndim == 0 or values.shape[-1] != count:
        given_text = "a single number" if values.ndim == 0 else f"{values.shape[-1]}"
        raise UsageError(f"{arm.name} has {count} motors: expected {count} pulses on the last axis, got {given_text}")
    if not np.all(np.abs(values) <= _MAX_PULSES):
        raise UsageError("pulses must be finite, and at most 2^53 from 0")
    offset = values - arm.motor_bias
    q = offset @ inverse.T
    if count > arm.n:
        _check_agreement(arm, q, offset)
    return np.asarray(arm.home + q)


def _check_agreement(arm: Arm, q: Array, offset: Array) -> None:
    """Raise UsageError if motors deviate from joint values q (..., n) by more than their rounding.

    offset: (..., motors) their pulses from home.
    """
    deviation = np.abs(q @ arm.motor_gain.T - offset)
    # each motor is rounded by up to half a pulse, and least squares may add all of this in one motor
    if np.any(deviation > 0.5 * np.sqrt(len(arm.motor_gain)) + _HALF):
        motor = motor_names(arm)[np.unravel_index(np.argmax(deviation), deviation.shape)[-1]]
        raise UsageError(
            f"the pulses contradict each other: motor {motor} is {deviation.max():.1f} pulses from where "
            "the other motors put its joints; motors of one joint must agree"
        )


def legal_with_same_pulses(arm: Arm, q: ArrayLike) -> Array:
    """Joint values within the limits that have the same pulses, if any, as rounding may exceed a limit by half a step.

    q: (..., n) [rad | mm]. Returns (..., n); q itself where its nearest legal values have other pulses.
    """
    values = np.asarray(q, dtype=float)
    clipped_values = np.clip(values, arm.lower, arm.upper)
    has_same_pulses = (pulses(arm, clipped_values) == pulses(arm, values)).all(axis=-1, keepdims=True)
    return np.where(has_same_pulses, clipped_values, values)


def rounding(arm: Arm, q: ArrayLike, p: ArrayLike | None = None) -> Rounding:
    """Exact and actual joints and tips of the pulses for joint values.

    Args:
        arm: the arm, as `armkin.load` gives it.
        q: (..., n) [rad | mm] joint values; leading axes are a batch.
        p: (..., motors) [steps from home | us | counts] whole pulses; by default `pulses(arm, q)`.

    Returns:
        A `Rounding`: `pulses`, `actual_joints` (..., n) [rad | mm], the exact and the actual tip (..., 3) [mm], and how
        far these are apart, `error` (...) [mm].

    Raises:
        UsageError: the arm's motors do not determine its joints, or q is no finite (..., n), or beyond 2^53 pulses.
    """
    exact = as_joints(arm, q)
    counts = pulses(arm, exact) if p is None else np.asarray(p, dtype=np.int64)
    actual = joints(arm, counts)
    return Rounding(exact, counts, actual, position(arm, exact), position(arm, actual))


def best_pulses(arm: Arm, q: ArrayLike) -> Best:
    """The pulses around the exact ones whose tip is nearest to the exact tip.

    The search is complete over its neighbourhood: every motor takes the two pulses on either side of its exact value
    (one on either side for more than six motors). Only the position of the tip counts; its orientation changes by at
    most these pulses. Pulses are not considered if they exceed the joint limits or the travel of a servo by more than
    plain rounding does, or if two motors of a joint would work against each other.

    Args:
        arm: the arm, as `armkin.load` gives it.
        q: (..., n) [rad | mm] joint values; leading axes are a batch.

    Returns:
        A `Best`: the `chosen` and the plainly `rounded` pulses, a `Rounding` each, and `gain` (...) [mm], by how much
        the chosen ones are nearer.

    Raises:
        UsageError: as `pulses`, or the arm has more than 12 motors.
    """
    exact, _ = _exact_and_slack(arm, q)
    values = as_joints(arm, q)
    motor_count = len(arm.motor_gain)
    steps = (-1.0, 0.0, 1.0, 2.0) if 4**motor_count <= _CANDIDATES else (0.0, 1.0)
    if len(steps) ** motor_count > _CANDIDATES:
        raise UsageError(
            f"{arm.name} has {motor_count} motors: the best pulses are searched among the neighbours of up to 12",
            motors=motor_count,
        )
    offsets = np.array(list(product(steps, repeat=motor_count)))
    flat_q, flat_x = values.reshape(-1, arm.n), exact.reshape(-1, motor_count)
    best_vectors = np.empty((len(flat_q), motor_count), dtype=np.int64)
    block = max(1, _AT_ONCE // len(offsets))
    for start in range(0, len(flat_q), block):
        rows = slice(start, start + block)
        best_vectors[rows] = _nearest_pulses(arm, flat_q[rows], flat_x[rows], offsets)
    return Best(rounding(arm, values, best_vectors.reshape(exact.shape)), rounding(arm, values), tried=len(offsets) + 1)


def resolution(arm: Arm) -> Array:
    """Resolution of each joint, its motion for one pulse: (n,) [rad | mm].

    Rounding the motors changes a joint by at most half of the resolution. With one motor for a joint it is the step of
    the joint; if several motors move a joint, their steps add up.
    """
    return np.asarray(np.abs(joints_per_pulse(arm)).sum(axis=1))


def motor_accel(arm: Arm) -> Array:
    """Greatest acceleration of every motor: (motors,) [counts/s^2].

    A motor that moves several joints gets the smallest acceleration of them, whichever moves. A feed hold, which the
    board computes from motors only, is therefore within the joints' max_accel.
    """
    per_joint = np.abs(arm.motor_gain) * arm.max_accel
    return np.asarray(np.where(per_joint > 0, per_joint, np.inf).min(axis=1))


def motor_names(arm: Arm) -> list[str]:
    """Names of the motors, in the order of the pulses."""
    return [motor.name for motor in arm.motors] or [f"M{k + 1}" for k in range(len(arm.motor_gain))]


def pulse_units(arm: Arm) -> list[str]:
    """``"step"``, ``"us"`` (RC servos) or ``"count"`` (bus servos) for every motor."""
    units = {"stepper": "step", "servo": "us", "bus": "count"}
    return [units[motor.kind] for motor in arm.motors] or ["step"] * len(arm.motor_gain)


def pulse_range(arm: Arm) -> Array:
    """Lowest and highest pulse of every servo: (motors, 2) [us | count]; steppers -inf, inf."""
    allowed = np.tile([-np.inf, np.inf], (len(arm.motor_gain), 1))
    for k, motor in enumerate(arm.motors):
        if motor.kind == "servo" and motor.pulse_us is not None:
            allowed[k] = motor.pulse_us
        elif motor.kind == "bus" and motor.counts is not None:
            allowed[k] = 0, motor.counts - 1
    return allowed


def outside_travel(arm: Arm, p: ArrayLike) -> NDArray[np.bool_]:
    """Which pulses are outside the travel of a servo: (..., motors) -> (..., motors) bool; never for steppers."""
    values, allowed = np.asarray(p), pulse_range(arm)
    return np.asarray((values < allowed[:, 0]) | (values > allowed[:, 1]))


def _exact_and_slack(arm: Arm, q: ArrayLike) -> tuple[Array, Array]:
    """Pulses before rounding, and bounds of their arithmetic error: (..., motors) twice."""
    joints_per_pulse(arm)
    values = as_joints(arm, q)
    if not np.all(np.isfinite(values)):
        raise UsageError("joint values must be finite to become pulses")
    exact = (values - arm.home) @ arm.motor_gain.T + arm.motor_bias
    if not np.all(np.abs(exact) <= _MAX_PULSES):
        raise UsageError("the joint values are too large: more than 2^53 pulses")
    size = (np.abs(values) + np.abs(arm.home)) @ np.abs(arm.motor_gain).T
    return exact, _HALF + 4 * np.finfo(float).eps * size


def undriven_joints(arm: Arm) -> list[str]:
    """Names of the joints that no motor moves."""
    return [name for name, column in zip(arm.joint_names, arm.motor_gain.T, strict=True) if not column.any()]


@lru_cache(maxsize=32)
def joints_per_pulse(arm: Arm) -> Array:
    """Motion of each joint for a pulse of each motor: (n, motors) [rad | mm], read-only, cached.

    Raises UsageError if the motors do not determine the joints.
    """
    gain, idle = arm.motor_gain, undriven_joints(arm)
    if idle:
        missing_text = "drives" if len(idle) == arm.n else f"motor for {', '.join(idle)}"
        raise UsageError(
            f"{arm.name} has no {missing_text}; add motors: to its file, or drive: to each joint", undriven=idle
        )
    # scale by the pulses of each joint, so that rad and mm, and coarse and fine drives, are comparable
    scale = np.abs(gain).max(axis=0)
    if np.linalg.matrix_rank(gain / scale) < arm.n:
        raise UsageError(
            f"{arm.name}'s motors do not determine its joints; give it as many independent motors as joints"
        )
    if np.count_nonzero(gain) == len(gain) == arm.n:  # one motor for each joint: exact without a factorisation
        per_pulse = np.divide(1.0, gain, out=np.zeros_like(gain), where=gain != 0).T
    else:
        per_pulse = np.asarray(np.linalg.pinv(gain / scale) / scale[:, None])
    per_pulse.flags.writeable = False
    return per_pulse


def _nearest_pulses(arm: Arm, q: Array, exact: Array, corners: Array) -> Array:
    """The neighbouring pulses with the nearest tip for each posture: (N, motors)."""
    rounded = pulses(arm, q).astype(float)
    candidates = np.concatenate([rounded[:, None], np.floor(exact)[:, None] + corners], axis=1)  # (N, C, motors)
    actual = arm.home + (candidates - arm.motor_bias) @ joints_per_pulse(arm).T
    tip = position(arm, actual)
    distance = np.linalg.norm(tip - position(arm, q)[:, None], axis=-1)
    distance[_is_worse_than_rounded(arm, candidates, actual)] = np.inf
    # rounded pulses come first, and argmin returns the first of equal values
    best_index = np.argmin(distance, axis=1)
    is_improved = distance[np.arange(len(q)), best_index] < distance[:, 0] * (1 - 1e-12)
    return np.asarray(candidates[np.arange(len(q)), np.where(is_improved, best_index, 0)])


def _is_worse_than_rounded(arm: Arm, candidates: Array, actual: Array) -> NDArray[np.bool_]:
    """Which candidates (N, C, motors), at joints actual (N, C, n), exceed limits or travel, or make motors of a joint
    work against each other, by more than the first candidate does: (N, C)."""
    allowed = pulse_range(arm)
    overrun = np.maximum(arm.lower - actual, actual - arm.upper).max(axis=-1)
    excess = np.maximum(allowed[:, 0] - candidates, candidates - allowed[:, 1]).max(axis=-1)
    strain = np.abs((actual - arm.home) @ arm.motor_gain.T + arm.motor_bias - candidates).max(axis=-1)
    tolerance = 1e-9
    is_worse = overrun > np.maximum(overrun[:, :1], 0.0) + tolerance
    is_worse |= excess > np.maximum(excess[:, :1], 0.0)
    is_worse |= strain > np.maximum(strain[:, :1], 0.5 - 1e-6)
    return np.asarray(is_worse)
