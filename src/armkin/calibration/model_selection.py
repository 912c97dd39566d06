"""Which corrections the rows justify: levels from few to all, compared on rows that were not used.

The levels are those of Roth, Mooring and Ravani (An overview of robot calibration, 1987), finer: the file as it is;
the base and the tool; the joints' zeros; their ratios; the links' lengths; their twists. A richer level is taken when
it predicts rows it has not seen better than the simpler one, by more than chance (5-fold cross-validation). Of fewer
than ten rows chance says little; there base and tool, which are usually the greatest errors, are taken if they predict
the rows clearly better and the rows determine them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armkin.calibration.corrected_chain import KINDS, Model, Parameter
from armkin.calibration.observability import left_open
from armkin.calibration.robust_fit import Fit, Measurements, fit_corrections, residuals
from armkin.formula.arrays import Array

LEVELS = ("file", "base and tool", "zeros", "ratios", "lengths", "twists")
FOLDS = 5  # parts of the rows, each of which is left out once
GAIN = 0.97  # share of the squared error, at most, that the first level above the file must leave to be taken
CERTAIN_GAIN = 0.5  # gain [standard errors] that the first level must have besides; later levels: 0
FEW_ROWS_GAIN = 18.0  # gain [standard errors] times the number of rows that every level must have on top
MANY_ROWS = 10  # rows below which a fit can look good by chance: OPEN_SHARE holds for it, too
CLEAR_SHARE = 0.7  # share of the file's error on unseen rows that base and tool may leave with few rows
OPEN_SHARE = 0.5  # share of the file's error that the covariance of a fit to few rows may leave open at the tip
CAP = 4.0  # error [medians] that larger ones count as: one wrong row does not decide


@dataclass(frozen=True, eq=False)
class Choice:
    """The level chosen, and what each level's error is on rows that it has not seen."""

    level: int
    errors: Array  # (levels, M) [mm]
    fit: Fit


def choose_level(
    model: Model,
    rows: Measurements,
    fixed: Collection[str] = (),
    tick: Callable[[int, int], object] | None = None,
) -> Choice:
    """The level that the rows justify, fitted to all of them; tick: how many fits are done, and of how many."""
    sets = [free_at(model, level, rows, fixed) for level in range(len(LEVELS))]
    fits, errors = _cross_validate(model, rows, sets, tick or (lambda done, of: None))
    level, sure = 0, False  # sure: the level is better than the file by more than chance
    for richer in range(1, len(LEVELS)):
        if np.array_equal(sets[richer], sets[level]):
            continue
        better = _is_better(errors[level], errors[richer], first=not sure)
        if not better and not (richer == 1 and _is_clearly_better(errors)):
            continue
        if len(rows) >= MANY_ROWS or _is_settled(model, fits[richer], errors[0]):
            level, sure = richer, better
    return Choice(level, errors, fits[level])


def _cross_validate(
    model: Model, rows: Measurements, sets: list[NDArray[np.intp]], tick: Callable[[int, int], object]
) -> tuple[list[Fit], Array]:
    """Every level fitted to all rows, and how far each row is off where it was left out: (levels, N) [mm].

    sets: numbers of the parameters that are free at each level.
    """
    parts = _five_parts(len(rows))
    errors = np.empty((len(sets), len(rows)))
    fits: list[Fit] = []
    count = 1 + len(parts)
    for level, free in enumerate(sets):
        if level and np.array_equal(free, sets[level - 1]):
            errors[level] = errors[level - 1]
            fits.append(fits[-1])
            continue
        # Every level starts from the last one's fit to all rows: from the pose of its base.
        start = fits[-1].p if fits else None
        full_fit = fit_corrections(model, rows, free, start)
        fits.append(full_fit)
        for part, held in enumerate(parts):
            tick(level * count + part + 1, len(sets) * count)
            used = np.setdiff1d(np.arange(len(rows)), held)
            p = fit_corrections(model, rows.take(used), free, start, steps=12).p if len(free) else full_fit.p
            errors[level, held] = np.linalg.norm(residuals(model, p, rows.take(held)).position, axis=1)
    return fits, errors


def free_at(model: Model, level: int, rows: Measurements, fixed: Collection[str]) -> NDArray[np.intp]:
    """The free parameters of a level: its own kind's and the simpler levels'."""
    kinds = KINDS[: level + 1 if level else 0]  # level 1 frees the first two

    def is_free(parameter: Parameter) -> bool:
        if parameter.kind == "tool" and parameter.unit == "rad" and rows.rotation is None:
            return False  # points alone do not show how the measuring tip is turned
        return parameter.kind in kinds and parameter.kind not in fixed and parameter.name not in fixed

    return np.flatnonzero([is_free(parameter) for parameter in model.parameters])


def _five_parts(count: int) -> list[NDArray[np.intp]]:
    """The rows in five parts of equal size, by chance (the same each time)."""
    order = np.random.default_rng(1).permutation(count)
    return [np.sort(order[k :: min(FOLDS, count)]) for k in range(min(FOLDS, count))]


def _is_settled(model: Model, candidate: Fit, before: Array) -> bool:
    """Whether the fit's covariance leaves less of the tip's place open than OPEN_SHARE times the file's error."""
    return left_open(model, candidate) < OPEN_SHARE * float(np.sqrt(np.mean(before**2)))


def _is_clearly_better(errors: Array) -> bool:
    """Whether few rows, each predicted without itself, are met clearly better with another base and tool."""
    file, placed = np.sqrt(np.mean(errors[:2] ** 2, axis=1))
    return errors.shape[1] < MANY_ROWS and bool(placed <= CLEAR_SHARE * file)


def _is_better(simple: Array, rich: Array, *, first: bool) -> bool:
    """Whether the richer level's errors on unseen rows are smaller by more than chance.

    The file is left only for a clear gain. From there on the prior keeps richer levels from doing harm.
    """
    a, b = (np.minimum(errors, CAP * np.median(errors)) ** 2 for errors in (simple, rich))
    gain = a - b
    chance = float(gain.std(ddof=1) / np.sqrt(len(gain)))
    most, certain = (GAIN, CERTAIN_GAIN) if first else (1.0, 0.0)
    return bool(b.mean() <= most * a.mean() and gain.mean() > (certain + FEW_ROWS_GAIN / len(gain)) * chance)
