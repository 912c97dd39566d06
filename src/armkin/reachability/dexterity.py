"""Measures of a posture: how well an arm can move its tip, and how precisely."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.forward import jacobian
from armkin.motors import joints_per_pulse
from armkin.reachability.volume import tip_freedoms

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_MAX_MOTORS = 14  # most motors of an arm, 8,192 combinations of signs for a posture
MEASURES = ("manipulability", "step_error")


def measure_function(arm: Arm, name: str) -> Callable[[Array], Array]:
    """The function (N, n) [rad | mm] -> (N,) that computes a measure.

    step_error [mm]: error of the tip if every motor is half a pulse off, for the worst combination of signs: the
    largest ``|J M^-1 s / 2|`` over all s of +1 and -1, J the linear rows of the Jacobian, M the motors matrix (pulses
    per rad | mm). To first order it bounds the error of rounding joint values to pulses.
    manipulability: the product of the singular values of J (Yoshikawa, Manipulability of Robotic Mechanisms, 1985,
    eq. 13), a power of mm; of an arm that moves in a plane, within that plane.
    """
    if name == "step_error":
        if len(arm.motor_gain) > _MAX_MOTORS:
            raise UsageError(
                f"{arm.name} has {len(arm.motor_gain)} motors: the worst of all their roundings is searched for up to "
                f"{_MAX_MOTORS}",
                motors=len(arm.motor_gain),
                most=_MAX_MOTORS,
            )
        return partial(_step_errors, arm, 0.5 * joints_per_pulse(arm))
    normal, _ = tip_freedoms(arm)
    basis = np.eye(3) if normal is None else np.linalg.svd(normal[None])[2][1:]
    return partial(_manipulabilities, arm, basis)


def _step_errors(arm: Arm, half_pulses: Array, q: Array) -> Array:
    """The worst error (N,) [mm] of the tip, each motor off by half a pulse: half_pulses (n, motors) [rad | mm]."""
    return _longest_sum(jacobian(arm, q)[:, :3] @ half_pulses)


def _manipulabilities(arm: Arm, basis: Array, q: Array) -> Array:
    """Manipulability (N,) within the directions (k, 3) that the tip can move in."""
    return _singular_value_product(basis @ jacobian(arm, q)[:, :3])


def _singular_value_product(J: Array) -> Array:
    """Product of the singular values of J (N, k, n)."""
    k, n = J.shape[1:]
    if k == n:  # without a square root no digits are lost at a singular posture
        return np.asarray(np.abs(np.linalg.det(J)))
    square = J @ J.transpose(0, 2, 1) if k < n else J.transpose(0, 2, 1) @ J
    return np.asarray(np.sqrt(np.maximum(np.linalg.det(square), 0.0)))


def _longest_sum(columns: Array) -> Array:
    """Largest length of a sum of the columns of (N, 3, m) over all combinations of signs.

    The combinations follow a Gray code, so that each differs from the previous one in one sign. The last sign is
    constant, because the negative of a sum is as long as the sum.
    """
    step = 2.0 * np.ascontiguousarray(columns.transpose(2, 1, 0))  # (m, 3, N)
    total = 0.5 * step.sum(axis=0)
    greatest = np.einsum("kn,kn->n", total, total)
    is_positive = [True] * len(step)
    for code in range(1, 1 << (len(step) - 1)):
        flip = (code & -code).bit_length() - 1
        total += -step[flip] if is_positive[flip] else step[flip]
        is_positive[flip] = not is_positive[flip]
        np.maximum(greatest, np.einsum("kn,kn->n", total, total), out=greatest)
    return np.asarray(np.sqrt(greatest))
