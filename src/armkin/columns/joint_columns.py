"""The columns of joints in tables that have other columns, too: how they are written, and found again."""

from __future__ import annotations

from collections.abc import Sequence

# Columns of any table that is written, and what targets are read by, in lower case.
_OTHERS = {
    "x", "y", "z", "roll", "pitch", "yaw", "phi", "theta", "ax", "ay", "az", "x_mm", "y_mm", "z_mm", "s_mm", "time_s",
    "row", "status", "branch", "within_limits", "residual_mm", "residual_deg", "motion", "error_mm",
}  # fmt: skip


def joint_columns(names: Sequence[str]) -> list[str]:
    """The columns of joints of these names: `joint_x` of one that is named like another column or joint.

    Upper and lower case are one, as they are for what reads the table.

    >>> joint_columns(["yaw", "shoulder", "X", "x"])
    ['joint_yaw', 'shoulder', 'joint_X', 'joint_joint_x']
    """
    taken, columns = set(_OTHERS), list[str]()
    for name in names:
        column = name
        while column.lower() in taken:
            column = f"joint_{column}"
        taken.add(column.lower())
        columns.append(column)
    return columns


def places_of_columns(heading: Sequence[str], names: Sequence[str], of_joints: bool) -> dict[str, list[int]]:
    """Where in a heading the columns of these names stand: those of exactly that name, or those with a unit behind it.

    of_joints: they are joints, whose columns are called as `joint_columns` says, or by their names alone.
    """
    lower_heading = [cell.lower() for cell in heading]
    columns = joint_columns(names) if of_joints else names
    return {
        name: _places(lower_heading, column.lower()) or _places(lower_heading, name.lower())
        for name, column in zip(names, columns, strict=True)
    }


def _places(heading: Sequence[str], name: str) -> list[int]:
    exact = [i for i, cell in enumerate(heading) if cell == name]
    with_units = (f"{name}_mm", f"{name}_deg", f"{name}/mm", f"{name}/deg", f"tool_{name}_mm")
    return exact or [i for i, cell in enumerate(heading) if cell in with_units]
