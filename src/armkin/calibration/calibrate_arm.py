"""`armkin.calibrate`: computes a corrected arm from commanded joint values and measured tips."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.calibration import observability
from armkin.calibration.corrected_chain import KINDS, CorrectedChain, correction_model
from armkin.calibration.dropped_rows import dropped_row_numbers
from armkin.calibration.measurement_checks import check_measurements
from armkin.calibration.model_selection import LEVELS, MANY_ROWS, Choice, choose_level, free_indices_at
from armkin.calibration.robust_fit import Fit, Measurements
from armkin.errors import UsageError
from armkin.export import conventions
from armkin.formula import arrays
from armkin.formula.arrays import Array
from armkin.forward import as_joints
from armkin.inverse.tasks.choose_task import task_for
from armkin.robot_file.robot_file_text import format_robot_file

if TYPE_CHECKING:
    from armkin.model.arm import Arm

STATED_ROWS = 20  # rows from which on deviations are stated; with 8 to 10 rows only half of the errors lie within one
HOPELESS_SHARE = 0.25  # error on unseen rows, as a share of the points' spread, above which calibration fails

# tasks that need parallel axes, or axes along the base's z; corrections must not change these directions
_PARALLEL = ("xy", "xy_theta", "xyz_yaw", "xyz_pitch", "xyz_pitch_roll", "xyz_roll")
_LEVEL = ("xy", "xy_theta", "xyz_yaw")


@dataclass(frozen=True, eq=False, repr=False)
class Calibration:
    """A corrected arm, with its errors and corrections.

    Attributes:
        arm: the corrected arm.
        data: the corrected robot file's keys and values.
        level: the corrections that the rows justified: file, base and tool, zeros, ratios, lengths or twists.
        before: (M,) [mm] the file's error on each row.
        after: (M,) [mm] the calibrated arm's error on each row, fitted without it.
        flagged: (F,) rows that do not fit the others, from 0.
        noise: [mm] of a measured coordinate.
        corrections: name, value, deviation (nan: few rows), unit (mm, rad, 1) of each.
        unseen: corrections that the rows do not show; they stay with the file.
        held: kinds that were not corrected, and why.
    """

    arm: Arm
    data: dict[str, Any]
    level: str
    before: Array
    after: Array
    flagged: NDArray[np.intp]
    noise: float
    corrections: list[tuple[str, float, float, str]]
    unseen: list[str]
    held: list[str]

    @property
    def text(self) -> str:
        """The corrected robot file."""
        return format_robot_file(self.data)

    @property
    def kinds(self) -> list[str]:
        """The kinds of corrections that were made."""
        names = {name for name, *_ in self.corrections}
        return list(dict.fromkeys(p.kind for p in correction_model(self.arm).parameters if p.name in names))

    def rms(self, which: str) -> float:
        """Root mean square of the rows' errors, flagged rows apart.

        Args:
            which: "before" or "after".

        Returns:
            The error [mm].
        """
        errors = np.delete(self.before if which == "before" else self.after, self.flagged)
        return float(np.sqrt(np.mean(errors**2)))

    def __repr__(self) -> str:
        """The error before and after, on rows that were not used."""
        rows = f"{len(self.before)} rows"
        return f"<Calibration of {self.arm.name}: {rows}, {self.rms('before'):.3g} -> {self.rms('after'):.3g} mm>"


def calibrate(
    arm: Arm,
    q: ArrayLike,
    measured: ArrayLike,
    *,
    fix: Iterable[str] = (),
    tick: Callable[[int, int], object] | None = None,
) -> Calibration:
    """Correct an arm by measured tips, as far as the rows justify it.

    Rows that do not fit the others are ignored.

    Args:
        arm: the arm, as `armkin.load` gives it.
        q: (M, n) [rad | mm] joint values as commanded.
        measured: (M, 3) [mm] points or (M, 4, 4) [mm] poses of the tip.
        fix: kinds that stay as the file has them: "base", "tool", "zeros", "ratios", "lengths", "twists".
        tick: called with the fits that are done, and how many there will be.

    Returns:
        A `Calibration`: the corrected `arm`, its `corrections` [mm, rad, 1], and each row's error `before` and `after`
        (M,) [mm].

    Raises:
        UsageError: rows that cannot be right: too few, on a line, a joint that never moves, other units or columns; or
            an unknown kind.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("robots/three_dof.yaml")
    >>> q = np.random.default_rng(0).uniform(-1, 1, (30, 3))
    >>> tips = armkin.fk(arm, q + [0, 0.02, 0])[:, :3, 3]  # the second zero is 0.02 rad off
    >>> found = calibrate(arm, q, tips, fix=["base", "tool", "ratios", "lengths", "twists"])
    >>> found.level, [round(value, 4) + 0.0 for _, value, _, _ in found.corrections]
    ('zeros', [0.0, 0.02, 0.0])
    """
    fixed = _fixed_kinds(fix)
    rows = _measurements(arm, q, measured)
    check_measurements(arm, rows)
    model = correction_model(arm)
    fixed_names, reasons = fixed_corrections(arm, fixed)
    choice = choose_level(model, rows, fixed_names, tick)
    _require_fit(rows, choice)
    best_fit = choice.fit
    corrected_arm, tool = model.corrected_arm(best_fit.corrections)
    return Calibration(
        arm=corrected_arm,
        data=conventions.screws(corrected_arm, conventions.tool_of(arm) @ tool),
        level=LEVELS[choice.level],
        before=choice.errors[0],
        after=choice.errors[choice.level],
        flagged=dropped_row_numbers(best_fit.weights),
        noise=best_fit.scale[0],
        corrections=_list_corrections(model, best_fit, len(rows)),
        unseen=observability.unseen_corrections(model, best_fit),
        held=reasons,
    )


def _list_corrections(model: CorrectedChain, fit: Fit, rows: int) -> list[tuple[str, float, float, str]]:
    """Name, value, standard deviation (nan for few rows) and unit (mm, rad, 1) of each free correction."""
    deviations = observability.correction_deviations(model, fit) if len(fit.free_indices) else np.zeros(0)
    if rows < STATED_ROWS:
        deviations = np.full(len(deviations), np.nan)
    corrections = []
    for number, deviation in zip(fit.free_indices, deviations, strict=True):
        parameter = model.parameters[number]
        corrections.append((parameter.name, float(fit.corrections[number]), float(deviation), parameter.unit))
    return corrections


def next_poses(arm: Arm, count: int, q: ArrayLike | None = None, *, fix: Iterable[str] = ()) -> Array:
    """The next poses to measure: (count, n) [rad | mm] within limits, the most informative about all corrections.

    q: (M, n) poses measured already; fix as in `calibrate`.
    """
    model = correction_model(arm)
    fixed, _ = fixed_corrections(arm, _fixed_kinds(fix))
    measured = None if q is None else as_joints(arm, q).reshape(-1, arm.n)
    no_rows = Measurements(np.zeros((0, arm.n)), np.zeros((0, 3)))
    return observability.suggest_poses(model, count, free_indices_at(model, len(LEVELS) - 1, no_rows, fixed), measured)


def fixed_corrections(arm: Arm, fixed: set[str]) -> tuple[set[str], list[str]]:
    """Kinds and names of corrections that are not made, and a text for each that the arm's task forbids."""
    try:
        task = task_for(arm).name
    except UsageError:
        return fixed, []
    fixed_names, reasons = set(fixed), []
    if task in _PARALLEL and "twists" not in fixed:
        fixed_names.add("twists")
        reasons.append(f"twists: task {task} needs parallel axes")
    if task in _LEVEL:
        fixed_names |= {"base roll", "base pitch"}
        reasons.append(f"the base's roll and pitch: task {task} needs axes along z")
    return fixed_names, reasons


def _fixed_kinds(fix: Iterable[str]) -> set[str]:
    """The kinds that are not corrected; UsageError if one is unknown or all are fixed."""
    fixed = {fix} if isinstance(fix, str) else set(fix)
    if unknown := sorted(fixed - set(KINDS)):
        raise UsageError(f"there is no kind {unknown[0]} of corrections; there are {', '.join(KINDS)}")
    if fixed == set(KINDS):
        raise UsageError("all corrections are fixed; nothing is left to find")
    return fixed


def _measurements(arm: Arm, q: ArrayLike, measured: ArrayLike) -> Measurements:
    """The rows; UsageError for shapes that do not match and numbers that are not finite."""
    commanded = as_joints(arm, q)
    values = arrays.real_array(measured, "measured")
    if commanded.ndim != 2:
        raise UsageError(f"calibrate takes one row of joint values a pose: (M, {arm.n}); got {commanded.shape}")
    shapes = ((len(commanded), 3), (len(commanded), 4, 4))
    if values.shape not in shapes:
        raise UsageError(f"measured has shape {values.shape}; expected {shapes[0]} or {shapes[1]}")
    if not (np.isfinite(commanded).all() and np.isfinite(values).all()):
        raise UsageError("a row holds nan or infinity; every number must be finite")
    if values.ndim == 2:
        return Measurements(commanded, values)
    return Measurements(commanded, values[:, :3, 3], values[:, :3, :3])


def _require_fit(rows: Measurements, choice: Choice) -> None:
    """Raise UsageError if the corrected arm misses half of the rows by too much of their spread."""
    spread = float(np.median(np.linalg.norm(rows.position - np.median(rows.position, axis=0), axis=1)))
    error = float(np.median(choice.errors[choice.level]))
    # with few rows, errors on unseen rows are unreliable
    allowed_share = HOPELESS_SHARE if len(rows) >= MANY_ROWS else 1.0
    if error > allowed_share * spread:
        raise UsageError(
            f"the rows do not fit this arm: half of them stay more than {error:.3g} mm off, of points {spread:.3g} mm "
            "around; check the robot file, the order of the columns and the units"
        )
