"""`armkin calibrate`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

import armkin
from armkin.cli.parsing import arguments
from armkin.cli.parsing.csv_to_numbers import batch_rows
from armkin.cli.parsing.options import Json, Out, Robot
from armkin.cli.printing import output, render
from armkin.columns.joint_columns import joint_columns
from armkin.errors import UsageError
from armkin.model import units
from armkin.model.target_numbers import targets_in

if TYPE_CHECKING:
    from armkin.calibration.calibrate_arm import Calibration
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm

_UNITS = {"mm": ("mm", 1.0), "rad": ("deg", 1 / units.DEGREE), "1": ("%", 100.0)}

MeasuredRows = Annotated[
    str | None,
    typer.Argument(metavar="CSV", help="One row a pose: joints as commanded, x y z of the tip as measured."),
]
WithRotations = Annotated[
    bool, typer.Option("--poses", help="The rows also have roll, pitch and yaw of the tool, in degrees.")
]
FixedKinds = Annotated[
    str | None,
    typer.Option("--fix", metavar="KIND,...", help="Leave as they are: base, tool, zeros, ratios, lengths, twists."),
]
Suggest = Annotated[
    int | None,
    typer.Option(
        "--suggest",
        metavar="N",
        help="List the next N poses to measure instead: those that would reduce the uncertainty most.",
    ),
]


def calibrate(
    robot: Robot,
    measured: MeasuredRows = None,
    poses: WithRotations = False,
    fix: FixedKinds = None,
    suggest: Suggest = None,
    json: Json = False,
    out: Out = None,
) -> None:
    """A corrected robot file from measured tips.

    Rows that do not fit the others are left out, and numbers that the rows do not determine keep the file's value. How
    much is corrected is decided by cross-validation, on rows that the fit has not seen. --out NEW.yaml writes the
    robot file.
    """
    if suggest is None:
        output.check_destination(out, "a robot file is", ".yaml", ".yml")
    else:
        output.check_destination(out, "poses to measure are", ".json" if json else ".csv")
    arm = arguments.load_arm(robot)
    kinds = [kind.strip() for kind in fix.split(",") if kind.strip()] if fix else []
    tip_names = ["x", "y", "z", *(("roll", "pitch", "yaw") if poses else ())]
    names = [*joint_columns(arm.joint_names), *tip_names]
    numbers, rows = _measured_rows(measured, names, arm)
    if suggest is not None:
        _print_suggestions(arm, suggest, rows, kinds, json, out)
        return
    if rows is None:
        raise UsageError(
            f"a CSV file with columns {','.join(names)} is missing; --suggest 30 says which poses to measure"
        )
    calibration = _fit_calibration(arm, rows, kinds, poses)
    if out is not None:
        with output.destination(out) as write:
            write(_file_text(calibration, arm))
    answer = _answer(arm, calibration, numbers, out)
    with output.destination(None) as write:
        write(f"{render.to_json(answer)}\n" if json else _text(arm, answer))
    for line in calibration.held:
        output.note(f"not corrected: {line}")
    if out is None:
        output.note("--out NEW.yaml writes the corrected robot file")


def _measured_rows(source: str | None, names: list[str], arm: Arm) -> tuple[list[int], Array | None]:
    """Numbers and values of a file's rows; None: there is no file."""
    import numpy as np

    if source is None:
        return [], None
    chunks = list(batch_rows(source, names, arm.name))
    return [number for chunk in chunks for number in chunk.numbers], np.concatenate([chunk.values for chunk in chunks])


def _fit_calibration(arm: Arm, rows: Array, kinds: list[str], poses: bool) -> Calibration:
    """What rows (N, n + 3) or, with `poses`, (N, n + 6) [deg | mm] tell of the arm; kinds: left as they are."""
    q, tips = units.joints_in(arm, rows[:, : arm.n]), rows[:, arm.n :]
    if poses:
        tips = targets_in(["x", "y", "z", "roll", "pitch", "yaw"], tips)
    with output.progress("fits") as tick:
        return armkin.calibrate(arm, q, tips, fix=kinds, tick=tick)


def _file_text(calibration: Calibration, arm: Arm) -> str:
    """The corrected robot file, with the errors before and after at its top."""
    from armkin.robot_file.robot_file_text import format_robot_file

    rms_before, rms_after = calibration.rms("before"), calibration.rms("after")
    heading = [
        f"{arm.name}, calibrated from {len(calibration.before)} measured poses by armkin calibrate.",
        f"On rows not used: {rms_before:.3f} mm rms before, {rms_after:.3f} mm after.",
    ]
    return format_robot_file(calibration.data, heading)


def _print_suggestions(arm: Arm, count: int, rows: Array | None, kinds: list[str], json: bool, out: str | None) -> None:
    """Print the poses to measure next [deg, mm], as CSV or JSON."""
    from armkin.calibration.calibrate_arm import next_poses
    from armkin.columns.csv_cells import csv_line

    measured_q = None if rows is None else units.joints_in(arm, rows[:, : arm.n])
    poses = units.joints_out(arm, next_poses(arm, count, measured_q, fix=kinds)).round(9).tolist()
    with output.destination(out) as write:
        if json:
            answer = {**render.head(arm), "joint_units": units.unit_names(arm), "poses": poses}
            write(f"{render.to_json(answer)}\n")
        else:
            write("\n".join([csv_line(arm.joint_names), *map(csv_line, poses), ""]))


def _answer(arm: Arm, calibration: Calibration, numbers: list[int], out: str | None) -> dict[str, Any]:
    """A calibration as data of JSON [mm, deg]; numbers: of its rows in their file. Errors are without flagged rows."""
    import numpy as np

    used_rows = np.delete(np.arange(len(calibration.before)), calibration.flagged)
    corrections = []
    for name, value, doubt, unit in calibration.corrections:
        unit_text, size = _UNITS[unit]
        deviation = None if np.isnan(doubt) else doubt * size
        corrections.append({"name": name, "value": value * size, "deviation": deviation, "unit": unit_text})
    return {
        **render.head(arm),
        "rows": len(calibration.before),
        "level": calibration.level,
        "corrected": calibration.kinds,
        "before": _error_statistics(calibration.before[used_rows]),
        "after": _error_statistics(calibration.after[used_rows]),
        "noise_mm": calibration.noise,
        "flagged": [{"row": numbers[k], "off_mm": float(calibration.after[k])} for k in calibration.flagged],
        "corrections": corrections,
        "unseen": calibration.unseen,
        "held": calibration.held,
        "out": out,
    }


def _error_statistics(errors: Array) -> dict[str, float]:
    """Median, root mean square and maximum of errors (M,) [mm]."""
    import numpy as np

    return {
        "median_mm": float(np.median(errors)),
        "rms_mm": float(np.sqrt(np.mean(errors**2))),
        "max_mm": float(errors.max()),
    }


def _text(arm: Arm, answer: dict[str, Any]) -> str:
    """An answer as tables, errors in mm, and what was left out or not seen."""
    rows = [["on rows not used", "before", "after", ""]]
    for key, name in (("median_mm", "median"), ("rms_mm", "rms"), ("max_mm", "largest")):
        rows.append(
            [name, render.fixed_text(answer["before"][key], 3), render.fixed_text(answer["after"][key], 3), "mm"]
        )
    corrected_text = "corrected: " + (", ".join(answer["corrected"]) or "nothing, the file is as good")
    lines = [f"{arm.name}: {answer['rows']} measured poses, {corrected_text}", "", render.table(rows, (0, 3)), ""]
    if answer["corrections"]:
        table = [["correction", "value", "+-", ""]]
        for entry in answer["corrections"]:
            numbers = (
                "?" if entry[key] is None else render.fixed_text(entry[key], 3) for key in ("value", "deviation")
            )
            table.append([entry["name"], *numbers, entry["unit"]])
        lines += [render.table(table, (0, 3)), ""]
        if answer["corrections"][0]["deviation"] is None:
            lines.append("+- is not stated from fewer than 20 rows")
    if flagged := answer["flagged"]:
        rows_text = ", ".join(f"{entry['row']} ({entry['off_mm']:.1f} mm)" for entry in flagged)
        lines.append(render.wrap_text(rows_text, "rows left out: ", " " * 15))
    if unseen_corrections := answer["unseen"]:
        lines.append(render.wrap_text(", ".join(unseen_corrections), "not seen in these rows: ", " " * 24))
    lines.append(f"noise of a measured coordinate: {answer['noise_mm']:.3f} mm")
    return "\n".join(lines) + "\n"
