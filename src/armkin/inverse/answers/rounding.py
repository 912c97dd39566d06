"""How far a target's numbers may be off by their rounding: what `near` may miss and still stand there.

An arm that is asked for its own pose, printed in six digits or kept in float32, is asked for another pose: near a
singular posture the exact answer to that one is far away: docs/solution.md, "Rounded targets".
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import UsageError
from armkin.formula import arrays
from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import ROUNDED, Task
from armkin.model.arm import Arm

# A rotation's defect is the symmetric part of its error, what `near` misses the antisymmetric one, of the same size:
# the defect of nine rounded entries is less than a quarter of it in one case of 100,000, of a turn about one of the
# base's axes, which has four, in one of 13. There the last digit that the entries have tells: an angle is off by less
# than three halves of it, a position of as many digits, beside the reach, by some eleven. A rotation of whole numbers,
# by right angles about the base's axes, shows nothing: only the position's last digit tells there.
DEFECTS = 4.0  # bound of a rounded target's error, in defects of its rotation
HALVES = 12.0  # bound of a rounded target's error, in halves of the last digit of its rotation
MIN_DIGITS = 5  # digits, at least, of a matrix's entries: one of fewer is no rotation to that many
PRINTED = 6  # digits, at least, that a position is printed with; zeros at its end show fewer
ROWS = 2_048  # rows worked on at once: all their arrays fit the cache
MIN_DECIMALS, MAX_DECIMALS = 3, 12  # printed decimals that count as rounded, and as exact


def of_targets(
    arm: Arm,
    task: Task,
    target: Array,
    shown: tuple[Array, Array],
    single: bool,
    stated: ArrayLike | None,
    lead: tuple[int, ...],
) -> tuple[Array, Array]:
    """The rounding of targets (N, ...), a batch of shape lead: (N,), and the residual that solves them (N,), both
    [reaches, rad].

    shown: targets as they were given, and how far their rotations were off (N,); single: they were given in float32;
    stated: () or (...) what the caller says it is.
    Raises UsageError for a rounding that is negative, not finite or of another shape.
    """
    if stated is not None:
        values = arrays.real_array(stated, "rounding")
        if values.shape not in ((), lead) or not np.isfinite(values).all() or (values < 0.0).any():
            shapes = "() or " + str(lead) if lead else "()"
            raise UsageError(f"rounding: expected finite numbers from 0, of shape {shapes}; got shape {values.shape}")
        rounding = np.broadcast_to(values, lead).reshape(-1).astype(float)
        return rounding, tol.SOLUTION + rounding
    numbers, defect = shown
    rounding = defect
    if single:
        point = target[:, :3, 3] if task.orientation == "full" else target[:, : task.position]
        largest = np.abs(point).max(axis=1, initial=0.0) / arm.reach
        rounding = np.maximum(defect, tol.FLOAT32 * np.maximum(largest, 1.0 if task.orientation != "none" else 0.0))
    most = DEFECTS * rounding
    rows = np.flatnonzero(defect > ROUNDED)
    if len(rows):
        most[rows] = np.maximum(most[rows], HALVES * last_place(numbers[rows, :3, :3]))
    if task.orientation == "full":
        corner = numbers[:, 0, 0]  # tells nearly all others
        rows = np.flatnonzero(np.abs(corner - np.rint(corner)) <= ROUNDED)
        R = numbers[rows, :3, :3]
        rows = rows[(np.abs(R - np.rint(R)) <= ROUNDED).all(axis=(1, 2))]
        if len(rows):
            most[rows] = np.maximum(most[rows], last_place_of_position(numbers[rows, :3, 3]) / arm.reach)
    return rounding, tol.SOLUTION + most


def last_place_of_position(p: Array) -> Array:
    """How far positions (N, 3) [mm] may be off (N,), by their digits or as float32; 0 where they are exact.

    Typed ones are: of fewer than six digits, and fewer than three decimals.
    """
    p = np.where(np.abs(p) < tol.SOLUTION, 0.0, p)  # what is that small is rounding
    size = np.floor(np.log10(np.maximum(np.abs(p), tol.SOLUTION)))
    half = np.zeros(len(p))
    typed = _are_whole(p * 10.0 ** (MIN_DECIMALS - 1)) & _are_whole(p * 10.0 ** (PRINTED - 2 - size))
    left = np.flatnonzero(~typed.all(axis=1))
    for digits in range(PRINTED, MAX_DECIMALS):
        fits = _are_whole(p[left] * 10.0 ** (digits - 1 - size[left])).all(axis=1)
        half[left[fits]] = 0.5 * 10.0 ** (size[left[fits]].max(axis=1) + 1 - digits)
        left = left[~fits]
    single = left[(p[left] == p[left].astype(np.float32)).all(axis=1)]
    half[single] = tol.FLOAT32 * np.abs(p[single]).max(axis=1)
    return np.asarray(3.0**0.5 * half)


def last_place(R: Array) -> Array:
    """Half a unit (N,) of the last digit that rotations (N, 3, 3) are rounded to, or of float32; 0 where of neither.

    All nine entries have to be numbers of so few digits, or too small to count: of others the chance is 1e-20 at
    eight. What is rounded to decimals has as many digits, or fewer.
    """
    entries = R.reshape(-1, 9)
    half = np.where((entries == entries.astype(np.float32)).all(axis=1), tol.FLOAT32, 0.0)
    left = np.flatnonzero(half == 0.0)
    for digits in range(MIN_DIGITS, MAX_DECIMALS):
        numbers = entries[left]
        size = np.floor(np.log10(np.maximum(np.abs(numbers), tol.FEW_DIGITS)))
        fits = (_are_whole(numbers * 10.0 ** (digits - 1 - size)) | (np.abs(numbers) < tol.FEW_DIGITS)).all(axis=1)
        half[left[fits]] = 0.5 * 10.0**-digits
        left = left[~fits]
        if not len(left):
            break
    return half


def printed_rounding(units: Sequence[str], values: Array, reach: float, decimals: ArrayLike | None = None) -> Array:
    """The rounding (N,) [reaches, rad] of targets as they are printed, (N, m) in units ("mm", "deg", "").

    Half the last decimal of each number that has three or more; 390 and 400.0 are exact. decimals (N, m): how many are
    printed; by default as many as the row's number with most of them needs. Halves of lengths add as vectors, of
    angles as sums: two of a pose's three may turn about nearly one axis.
    """
    values = np.asarray(values, float).reshape(-1, len(units))
    if decimals is None:  # all numbers of a row have as many: there are no more sizes than decimals
        sizes = printed_rounding(units, values[:0], reach, np.repeat(np.arange(MAX_DECIMALS)[:, None], len(units), 1))
        blocks = [_needed_decimals(values[start : start + ROWS]).max(axis=1) for start in range(0, len(values), ROWS)]
        return np.asarray(sizes[np.concatenate([np.zeros(0, np.intp), *blocks])])
    halves = _HALF.take(np.asarray(decimals, int).reshape(-1, len(units)), mode="clip")
    angles = np.array([unit == "deg" for unit in units])
    scale = np.array([1.0 / reach if unit == "mm" else 1.0 for unit in units])
    turned = np.radians(halves[:, angles].sum(axis=1))
    return np.asarray(np.hypot(np.linalg.norm((halves * scale)[:, ~angles], axis=1), turned))


# half a unit of the last of so many decimals, 0 below MIN_DECIMALS; of more than 300 it is nothing, too
_HALF = np.where(np.arange(300) < MIN_DECIMALS, 0.0, 0.5 * 10.0 ** -np.arange(300.0))


def _needed_decimals(values: Array) -> Int:
    """How many decimals numbers (N, m) need: 0 below MIN_DECIMALS, and from MAX_DECIMALS on: those are not rounded."""
    needed = np.zeros(values.size, np.intp)
    number = values.ravel()
    left = np.flatnonzero(~_are_whole(number * 10.0 ** (MIN_DECIMALS - 1)))
    for decimals in range(MIN_DECIMALS, MAX_DECIMALS):
        if not len(left):
            break
        fits = _are_whole(number[left] * 10.0**decimals)
        needed[left[fits]] = decimals
        left = left[~fits]
    return needed.reshape(values.shape)


def _are_whole(scaled: Array) -> Bool:
    """Which numbers are integers but for rounding."""
    return np.asarray(np.abs(scaled - np.rint(scaled)) <= tol.DECIMAL * np.maximum(np.abs(scaled), 1.0))
