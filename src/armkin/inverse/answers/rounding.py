"""The rounding error of a target's numbers, within which `near` counts as a solution of the target.

A pose that was printed in six digits or kept in float32 differs from the arm's own pose. Near a singular posture the
exact answer to the rounded pose is far from the arm's posture: docs/solution.md, "Rounded targets".
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import UsageError
from armkin.formula import arrays
from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import ROUNDED, Task
from armkin.model.arm import Arm

# The defect of a rounded rotation is the symmetric part of its error. The residual of `near` is the antisymmetric
# part, of about the same size: with nine rounded entries it exceeds four defects in one case of 100,000, but for a turn
# about an axis of the base, with four rounded entries, in one of 13. Then the last digit of the entries gives a bound:
# an angle is off by less than three halves of it, and a position of as many digits by some eleven. A rotation by right
# angles has whole numbers and shows no error, so only the position's last digit gives a bound there.
DEFECTS = 4.0  # bound of the error in defects of the rotation
HALVES = 12.0  # bound of the error in halves of the rotation's last digit
MIN_DIGITS = 5  # fewest digits of entries; a matrix with fewer is no rotation to that accuracy
PRINTED = 6  # fewest digits of a printed position, with zeros at its end
ROWS = 2_048  # rows in one call, whose arrays fit the cache
MIN_DECIMALS, MAX_DECIMALS = 3, 12  # fewest decimals that count as rounded, and fewest that count as exact


def of_targets(
    arm: Arm,
    task: Task,
    target: Array,
    shown: tuple[Array, Array],
    single: bool,
    stated: ArrayLike | None,
    lead: tuple[int, ...],
) -> tuple[Array, Array]:
    """The rounding of targets (N, ...), a batch of shape lead, and the residual up to which they are solved: (N,) each
    [reaches, rad].

    shown: targets as given, and the defects of their rotations (N,); single: they were given in float32; stated: () or
    (...) the rounding that the caller states.
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
    bound = DEFECTS * rounding
    rows = np.flatnonzero(defect > ROUNDED)
    if len(rows):
        bound[rows] = np.maximum(bound[rows], HALVES * last_place(numbers[rows, :3, :3]))
    if task.orientation == "full":
        corner = numbers[:, 0, 0]  # excludes nearly all other rotations
        rows = np.flatnonzero(np.abs(corner - np.rint(corner)) <= ROUNDED)
        R = numbers[rows, :3, :3]
        rows = rows[(np.abs(R - np.rint(R)) <= ROUNDED).all(axis=(1, 2))]
        if len(rows):
            bound[rows] = np.maximum(bound[rows], last_place_of_position(numbers[rows, :3, 3]) / arm.reach)
    return rounding, tol.SOLUTION + bound


def last_place_of_position(p: Array) -> Array:
    """The rounding error of positions (N, 3) [mm] by their digits or as float32: (N,); 0 for exact ones.

    Typed positions, with fewer than six digits and fewer than three decimals, are exact.
    """
    p = np.where(np.abs(p) < tol.SOLUTION, 0.0, p)  # smaller numbers are rounding errors
    size = np.floor(np.log10(np.maximum(np.abs(p), tol.SOLUTION)))
    half = np.zeros(len(p))
    typed = _are_whole(p * 10.0 ** (MIN_DECIMALS - 1)) & _are_whole(p * 10.0 ** (PRINTED - 2 - size))
    pending = np.flatnonzero(~typed.all(axis=1))
    for digits in range(PRINTED, MAX_DECIMALS):
        fits = _are_whole(p[pending] * 10.0 ** (digits - 1 - size[pending])).all(axis=1)
        half[pending[fits]] = 0.5 * 10.0 ** (size[pending[fits]].max(axis=1) + 1 - digits)
        pending = pending[~fits]
    single = pending[(p[pending] == p[pending].astype(np.float32)).all(axis=1)]
    half[single] = tol.FLOAT32 * np.abs(p[single]).max(axis=1)
    return np.asarray(3.0**0.5 * half)


def last_place(R: Array) -> Array:
    """Half a unit (N,) of the last digit to which rotations (N, 3, 3) are rounded, or of float32; 0 for neither.

    All nine entries must be numbers of so few digits, or negligible; by chance that has a probability of 1e-20 at eight
    digits. Entries that are rounded to decimals have as many digits or fewer.
    """
    entries = R.reshape(-1, 9)
    half = np.where((entries == entries.astype(np.float32)).all(axis=1), tol.FLOAT32, 0.0)
    pending = np.flatnonzero(half == 0.0)
    for digits in range(MIN_DIGITS, MAX_DECIMALS):
        numbers = entries[pending]
        size = np.floor(np.log10(np.maximum(np.abs(numbers), tol.FEW_DIGITS)))
        fits = (_are_whole(numbers * 10.0 ** (digits - 1 - size)) | (np.abs(numbers) < tol.FEW_DIGITS)).all(axis=1)
        half[pending[fits]] = 0.5 * 10.0**-digits
        pending = pending[~fits]
        if not len(pending):
            break
    return half


def printed_rounding(units: Sequence[str], values: Array, reach: float, decimals: ArrayLike | None = None) -> Array:
    """The rounding (N,) [reaches, rad] of targets as they are printed, (N, m) in units ("mm", "deg", "").

    It is half the last decimal of each number with three or more; 390 and 400.0 are exact. decimals (N, m): number of
    printed decimals; by default the most that a number of the row needs. Errors of lengths add as vectors, errors of
    angles as a sum, since two of a pose's three angles may turn about nearly the same axis.
    """
    values = np.asarray(values, float).reshape(-1, len(units))
    if decimals is None:  # one size for each number of decimals, which all numbers of a row share
        sizes = printed_rounding(units, values[:0], reach, np.repeat(np.arange(MAX_DECIMALS)[:, None], len(units), 1))
        blocks = [_needed_decimals(values[start : start + ROWS]).max(axis=1) for start in range(0, len(values), ROWS)]
        return np.asarray(sizes[np.concatenate([np.zeros(0, np.intp), *blocks])])
    halves = _HALF.take(np.asarray(decimals, int).reshape(-1, len(units)), mode="clip")
    angles = np.array([unit == "deg" for unit in units])
    scale = np.array([1.0 / reach if unit == "mm" else 1.0 for unit in units])
    angle_error = np.radians(halves[:, angles].sum(axis=1))
    return np.asarray(np.hypot(np.linalg.norm((halves * scale)[:, ~angles], axis=1), angle_error))


# half a unit of the last decimal by the number of decimals; 0 below MIN_DECIMALS
_HALF = np.where(np.arange(300) < MIN_DECIMALS, 0.0, 0.5 * 10.0 ** -np.arange(300.0))


def _needed_decimals(values: Array) -> Int:
    """The number of decimals of numbers (N, m); 0 below MIN_DECIMALS, and for exact ones from MAX_DECIMALS on."""
    needed = np.zeros(values.size, np.intp)
    number = values.ravel()
    pending = np.flatnonzero(~_are_whole(number * 10.0 ** (MIN_DECIMALS - 1)))
    for decimals in range(MIN_DECIMALS, MAX_DECIMALS):
        if not len(pending):
            break
        fits = _are_whole(number[pending] * 10.0**decimals)
        needed[pending[fits]] = decimals
        pending = pending[~fits]
    return needed.reshape(values.shape)


def _are_whole(scaled: Array) -> Bool:
    """Whether numbers are integers up to rounding errors."""
    return np.asarray(np.abs(scaled - np.rint(scaled)) <= tol.DECIMAL * np.maximum(np.abs(scaled), 1.0))
