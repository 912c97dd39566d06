"""Checks measurements before a fit, because a fit would hide wrong rows."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.calibration.robust_fit import Measurements
from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.forward import position
from armkin.model import units
from armkin.model.units import radian_or_reach

if TYPE_CHECKING:
    from armkin.model.arm import Arm

MIN_ROWS = 4  # fewest rows of a measurement
STILL_TURN, STILL_SLIDE = math.radians(0.1), 0.1  # movement [rad], [mm] below which a joint counts as not moving
LINE_THICKNESS = 0.01  # thickness of a cloud, as a share of its length, below which its points are on a line
FIT_SHARE = 0.1  # error, as a share of the points' spread, below which no other reading is tried
EXPLAINED_SHARE = 0.35  # share of the error that another reading must not exceed to be the explanation


def check_measurements(arm: Arm, data_rows: Measurements) -> None:
    """Raise UsageError with the reason if the rows cannot calibrate this arm."""
    if len(data_rows) < MIN_ROWS:
        rows = "1 row is" if len(data_rows) == 1 else f"{len(data_rows)} rows are"
        raise UsageError(f"{rows} too few; measure at least {MIN_ROWS}, better 20 to 60")
    _check_motion(arm, data_rows)
    _check_spread(data_rows)
    _check_readings(arm, data_rows)


def _check_motion(arm: Arm, rows: Measurements) -> None:
    """Raise UsageError if a joint never moves, or all of them in step."""
    thresholds = np.where(arm.prismatic, STILL_SLIDE, STILL_TURN)
    motionless = np.flatnonzero(np.ptp(rows.commanded, axis=0) < thresholds)
    if len(motionless):
        names = ", ".join(arm.joint_names[j] for j in motionless)
        raise UsageError(
            f"{names} never move{'s' if len(motionless) == 1 else ''} in the rows: corrections of "
            f"{'it' if len(motionless) == 1 else 'them'} cannot be determined; measure poses that move every joint"
        )
    unit = radian_or_reach(arm)
    sizes = np.linalg.svd((rows.commanded - rows.commanded.mean(axis=0)) / unit, compute_uv=False)
    if arm.n > 1 and sizes[1] < 1e-3 * sizes[0]:
        raise UsageError(
            "all joints move in step from row to row: their effects cannot be told apart; "
            "measure poses that move them one by one or at random"
        )


def _check_spread(rows: Measurements) -> None:
    """Raise UsageError if the measured points lie on a line."""
    centred = rows.position - np.median(rows.position, axis=0)
    # use the rows nearest to the middle of the cloud, as a single wrong row would make a line look thick
    inner_rows = np.argsort(np.linalg.norm(centred, axis=1))[: max(MIN_ROWS, math.ceil(0.8 * len(centred)))]
    sizes = np.linalg.svd(centred[inner_rows] - centred[inner_rows].mean(axis=0), compute_uv=False)
    if sizes[1] < LINE_THICKNESS * sizes[0] or sizes[0] == 0:
        raise UsageError(
            "the measured points lie on a line: a turn about it leaves them where they are; measure points all around"
        )


class _Reading(NamedTuple):
    """Another interpretation of the rows."""

    explanation: str
    commanded: Array  # (M, n)
    position: Array  # (M, 3)


def _check_readings(arm: Arm, rows: Measurements) -> None:
    """Raise UsageError if the rows fit far better in other units or with columns or signs changed."""
    expected = position(arm, rows.commanded)
    size = _cloud_size(rows.position)
    miss, median_miss = _aligned_miss(expected, rows.position), _median_miss(expected, rows.position)
    hint = ""
    if median_miss > FIT_SHARE * size:
        hint = _axes_in_place(expected, rows.position, 0.2 * median_miss, FIT_SHARE * size)
    if not hint and miss > FIT_SHARE * size:
        least_miss = EXPLAINED_SHARE * miss
        for reading in _readings(arm, rows):
            tips = position(arm, reading.commanded)
            reading_miss = _aligned_miss(tips, reading.position) * size / max(_cloud_size(reading.position), 1e-12)
            if reading_miss < least_miss:
                least_miss, hint = 0.999 * reading_miss, reading.explanation
    if hint:
        raise UsageError(f"{hint}; as given, the rows miss the arm by {miss:.3g} mm (median); nothing is written")


def _axes_in_place(expected: Array, measured: Array, max_miss: float, largest: float) -> str:
    """The explanation of points (M, 3) that fit after a permutation or a change of sign of axes; "" if none fits.

    These readings are tried first and without rigid motions, while `_readings` allows any measuring frame.
    """
    candidates = []
    for order in itertools.permutations(range(3)):
        if order != (0, 1, 2):
            explanation = f"columns {_axis_names(order)} of the measured points look like x y z"
            candidates.append((_median_miss(expected, measured[:, order]), explanation))
    for flip, axis in _FLIPS:
        explanation = f"the measured {axis} looks negative (or the first joint turns the other way)"
        candidates.append((_median_miss(expected, measured * flip), explanation))
    least_miss, explanation = min(candidates)
    return explanation if least_miss < min(max_miss, largest) else ""


_FLIPS = (((-1.0, 1.0, 1.0), "x"), ((1.0, -1.0, 1.0), "y"), ((1.0, 1.0, -1.0), "z"))


def _readings(arm: Arm, rows: Measurements) -> list[_Reading]:
    """The rows in other units, with columns swapped, or with the sign of one joint changed."""
    commanded, points = rows.commanded, rows.position
    degree = units.joint_scale(arm)
    readings = [
        _Reading("the joint values look like radians where degrees are expected", commanded / degree, points),
        _Reading("the joint values look like degrees where radians are expected", commanded * degree, points),
        _Reading("the measured points look like metres where millimetres are expected", commanded, points * 1e3),
        _Reading("the measured points look like micrometres where millimetres are expected", commanded, points * 1e-3),
        _Reading("the measured points look like inches where millimetres are expected", commanded, points * 25.4),
    ]
    for i, j in itertools.combinations(range(arm.n), 2):
        order = list(range(arm.n))
        order[i], order[j] = j, i
        names = f"{arm.joint_names[i]} and {arm.joint_names[j]}"
        readings.append(_Reading(f"the columns of {names} look swapped", commanded[:, order], points))
    for j in range(arm.n):
        sign = np.ones(arm.n)
        sign[j] = -1.0
        readings.append(_Reading(f"{arm.joint_names[j]} looks commanded with the other sign", commanded * sign, points))
    for axes in ((0, 2, 1), (2, 1, 0), (1, 0, 2)):
        explanation = f"columns {_axis_names(axes)} of the measured points look like x y z"
        readings.append(_Reading(explanation, commanded, points[:, axes]))
    return readings


def _axis_names(order: tuple[int, ...]) -> str:
    return " ".join("xyz"[k] for k in order)


def _cloud_size(points: Array) -> float:
    """Median distance of points (M, 3) from their median."""
    return float(np.median(np.linalg.norm(points - np.median(points, axis=0), axis=1)))


def _median_miss(expected: Array, measured: Array) -> float:
    """The median error without any motion."""
    return float(np.median(np.linalg.norm(measured - expected, axis=1)))


def _aligned_miss(expected: Array, measured: Array) -> float:
    """The median error after the best rigid motion of the expected points (Kabsch, 1976), with robust weights."""
    weight = np.ones(len(expected))
    distances = np.zeros(len(expected))
    for _ in range(6):
        a, b = (np.average(points, axis=0, weights=weight) for points in (expected, measured))
        U, _s, Vt = np.linalg.svd((expected - a).T @ ((measured - b) * weight[:, None]))
        turn = np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt)) or 1.0])
        R = (U @ turn @ Vt).T
        distances = np.linalg.norm(measured - b - (expected - a) @ R.T, axis=1)
        weight = (1.0 + (distances / (3.0 * np.median(distances) + 1e-9)) ** 2) ** -2
    return float(np.median(distances))
