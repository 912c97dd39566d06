"""Results as text: JSON for programs, aligned columns for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from armkin.cli import output, units

if TYPE_CHECKING:
    from armkin.arm import Arm
    from armkin.cli.batch import Tally
    from armkin.soa import Array


def head(arm: Arm) -> dict[str, Any]:
    """What every JSON object begins with: the robot, its file as given and the file's hash."""
    return {"robot": arm.name, "robot_file": arm.path, "robot_sha256": arm.sha256}


def violations(arm: Arm, values: Array, q: Array) -> list[list[dict[str, Any]]]:
    """For each row, the joints outside their limits: values (N, n) [deg | mm], q the same in [rad | mm]."""
    import numpy as np

    from armkin.limits import outside

    found: list[list[dict[str, Any]]] = [[] for _ in values]
    limits = units.limits_out(arm)
    for row, i in np.argwhere(outside(arm, q)).tolist():
        lower, upper = map(finite, limits[i])
        value = float(values[row, i])
        found[row].append({"joint": arm.joint_names[i], "value": value, "lower": lower, "upper": upper})
    return found


def finite(value: float) -> float | None:
    """A number for JSON, which has no infinity."""
    return float(value) if abs(value) < float("inf") else None


def said(arm: Arm, violation: dict[str, Any]) -> str:
    """One violation in words: ``q2 = 130 deg is outside -20 to 120 deg``."""
    unit = units.names(arm)[arm.joint_names.index(violation["joint"])]
    low, high = (short(violation[key]) if violation[key] is not None else "any" for key in ("lower", "upper"))
    return f"{violation['joint']} = {short(violation['value'])} {unit} is outside {low} to {high} {unit}"


def to_json(value: Any) -> str:
    """One line of JSON; NaN or infinity in it is a bug and raises ValueError."""
    import json

    return json.dumps(value, allow_nan=False)


def fixed(value: float, digits: int = 4) -> str:
    """A number for people: fixed decimals, and never -0.0000.

    >>> fixed(-0.00001), fixed(398.39234)
    ('0.0000', '398.3923')
    """
    text = f"{value:.{digits}f}"
    return text[1:] if text.startswith("-") and not text.strip("-0.") else text


def short(value: float) -> str:
    """A number as a file's author would write it: no needless zeros, at most ten digits."""
    return f"{value:.10g}" if value else "0"


def table(rows: Sequence[Sequence[str]], left: Sequence[int] = (0,), indent: str = "  ") -> str:
    """Aligned columns, two spaces apart; left: columns that align left, the others right.

    >>> print(table([["", "x", "y"], ["elbow", "110.053", "7.5"]]))
                 x    y
      elbow  110.053  7.5
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [
            cell.ljust(width) if i in left else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append((indent + "  ".join(cells)).rstrip())
    return "\n".join(lines)


def pose_line(arm: Arm, values: Sequence[float]) -> str:
    """The arm and its joint values on one line: ``three_dof  q1 = -30, q2 = 5 deg``."""
    parts = [
        f"{name} = {short(value)}" + (" mm" if unit == "mm" else "")
        for name, value, unit in zip(arm.joint_names, values, units.names(arm), strict=True)
    ]
    return f"{arm.name}: {', '.join(parts)}" + (" deg" if not arm.prismatic[-1] else "")


def warn_of_limits(arm: Arm, found: list[dict[str, Any]]) -> None:
    """Say which joints of a pose are outside their limits."""
    if found:
        output.warn("; ".join(said(arm, violation) for violation in found))


def warn_of_rows(tally: Tally) -> None:
    """Say how many rows of a batch are outside the limits."""
    if tally.outside:
        rows = f"row {tally.first_outside} is" if tally.outside == 1 else f"{tally.outside} of {tally.rows} rows are"
        first = "" if tally.outside == 1 else f"; the first is row {tally.first_outside}"
        output.warn(f"{rows} outside the limits{first}")
