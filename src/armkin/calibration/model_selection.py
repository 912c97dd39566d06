"""Selects the corrections that the rows justify: levels from few to all, compared on rows that were not used.

The levels refine those of Roth, Mooring and Ravani (An overview of robot calibration, 1987): the file as it is; the
base and the tool; the joints' zeros; their ratios; the links' lengths; their twists. A richer level is chosen if it
predicts unseen rows better than the simpler one by more than chance (5-fold cross-validation). With fewer than ten rows
chance is hard to estimate. Base and tool, usually the greatest errors, are then chosen if they predict the rows clearly
better and the rows determine them.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armkin.calibration.corrected_chain import KINDS, CorrectedChain, Parameter
from armkin.calibration.observability import tip_deviation
from armkin.calibration.robust_fit import Fit, Measurements, fit_corrections, residuals
from armkin.formula.arrays import Array

LEVELS = ("file", "base and tool", "zeros", "ratios", "lengths", "twists")
FOLDS = 5  # parts of the rows, of which each is left out once
FIRST_ERROR_SHARE = 0.97  # greatest squared error of the first level above the file, as a share of the file's
CERTAIN_GAIN = 0.5  # gain [standard errors] that the first level must exceed; 0 for later levels
FEW_ROWS_GAIN = 18.0  # additional gain [standard errors] of every level, times the number of rows
MANY_ROWS = 10  # rows below which a fit may look good by chance, so that OPEN_SHARE applies as well
CLEAR_SHARE = 0.7  # greatest error with another base and tool for few rows, as a share of the file's
OPEN_SHARE = 0.5  # greatest deviation of the tip after a fit to few rows, as a share of the file's error
ERROR_CAP = 4.0  # greatest error [medians] that counts, so that a single wrong row does not decide


@dataclass(frozen=True, eq=False)
class Choice:
    """The chosen level, and the errors of each level on unseen rows."""

    level: int
    errors: Array  # (levels, M) [mm]
    fit: Fit


def choose_level(
    model: CorrectedChain,
    rows: Measurements,
    fixed: Collection[str] = (),
    tick: Callable[[int, int], object] | None = None,
) -> Choice:
    """The level that the rows justify, fitted to all of them; tick: called with the fits done, and their number."""
    free_sets = [free_indices_at(model, level, rows, fixed) for level in range(len(LEVELS))]
    fits, errors = _cross_validate(model, rows, free_sets, tick or (lambda done, of: None))
    level, is_certain = 0, False  # whether the level is better than the file by more than chance
    for candidate in range(1, len(LEVELS)):
        if np.array_equal(free_sets[candidate], free_sets[level]):
            continue
        is_better = _is_better(errors[level], errors[candidate], first=not is_certain)
        if not is_better and not (candidate == 1 and _is_clearly_better(errors)):
            continue
        if len(rows) >= MANY_ROWS or _determines_tip(model, fits[candidate], errors[0]):
            level, is_certain = candidate, is_better
    return Choice(level, errors, fits[level])


def _cross_validate(
    model: CorrectedChain, rows: Measurements, free_sets: list[NDArray[np.intp]], tick: Callable[[int, int], object]
) -> tuple[list[Fit], Array]:
    """Fits of every level to all rows, and the error of each row when it was left out: (levels, N) [mm].

    free_sets: numbers of the parameters that are free at each level.
    """
    parts = _five_parts(len(rows))
    errors = np.empty((len(free_sets), len(rows)))
    fits: list[Fit] = []
    count = 1 + len(parts)
    for level, free_indices in enumerate(free_sets):
        if level and np.array_equal(free_indices, free_sets[level - 1]):
            errors[level] = errors[level - 1]
            fits.append(fits[-1])
            continue
        # every level starts from the previous fit to all rows, because that has about the right base
        start = fits[-1].corrections if fits else None
        full_fit = fit_corrections(model, rows, free_indices, start)
        fits.append(full_fit)
        for part, test_rows in enumerate(parts):
            tick(level * count + part + 1, len(free_sets) * count)
            training_rows = np.setdiff1d(np.arange(len(rows)), test_rows)
            training_fit = full_fit
            if len(free_indices):
                training_fit = fit_corrections(model, rows.take(training_rows), free_indices, start, steps=12)
            test_residuals = residuals(model, training_fit.corrections, rows.take(test_rows))
            errors[level, test_rows] = np.linalg.norm(test_residuals.position, axis=1)
    return fits, errors


def free_indices_at(model: CorrectedChain, level: int, rows: Measurements, fixed: Collection[str]) -> NDArray[np.intp]:
    """The free parameters of a level, of its own kind and those of simpler levels."""
    kinds = KINDS[: level + 1 if level else 0]  # level 1 frees the first two

    def is_free(parameter: Parameter) -> bool:
        if parameter.kind == "tool" and parameter.unit == "rad" and rows.rotation is None:
            return False  # points do not determine the rotation of the measuring tip
        return parameter.kind in kinds and parameter.kind not in fixed and parameter.name not in fixed

    return np.flatnonzero([is_free(parameter) for parameter in model.parameters])


def _five_parts(count: int) -> list[NDArray[np.intp]]:
    """The rows in five random parts of equal size, the same each time."""
    order = np.random.default_rng(1).permutation(count)
    return [np.sort(order[k :: min(FOLDS, count)]) for k in range(min(FOLDS, count))]


def _determines_tip(model: CorrectedChain, candidate: Fit, file_errors: Array) -> bool:
    """Whether the deviation of the tip after the fit is less than OPEN_SHARE times the error of the file."""
    return tip_deviation(model, candidate) < OPEN_SHARE * float(np.sqrt(np.mean(file_errors**2)))


def _is_clearly_better(errors: Array) -> bool:
    """Whether another base and tool predict few unseen rows clearly better."""
    file_error, base_error = np.sqrt(np.mean(errors[:2] ** 2, axis=1))
    return errors.shape[1] < MANY_ROWS and bool(base_error <= CLEAR_SHARE * file_error)


def _is_better(simple: Array, rich: Array, *, first: bool) -> bool:
    """Whether the richer level's errors on unseen rows are smaller by more than chance.

    The first level above the file needs a clear gain. For later levels the prior prevents overfitting.
    """
    a, b = (np.minimum(errors, ERROR_CAP * np.median(errors)) ** 2 for errors in (simple, rich))
    gain = a - b
    chance = float(gain.std(ddof=1) / np.sqrt(len(gain)))
    share, min_gain = (FIRST_ERROR_SHARE, CERTAIN_GAIN) if first else (1.0, 0.0)
    return bool(b.mean() <= share * a.mean() and gain.mean() > (min_gain + FEW_ROWS_GAIN / len(gain)) * chance)
