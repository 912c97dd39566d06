"""The columns of joints in tables that have other columns, too."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def joint_columns(names: Sequence[str], others: Iterable[str]) -> list[str]:
    """The columns of joints of these names: `joint_x` of one that is named like one of the other columns.

    Upper and lower case are one, as they are for what reads the table (`input_columns.column_places`).

    >>> joint_columns(["yaw", "shoulder", "X"], ["x", "y", "z", "roll", "pitch", "yaw"])
    ['joint_yaw', 'shoulder', 'joint_X']
    """
    taken = {other.lower() for other in others}
    return [f"joint_{name}" if name.lower() in taken else name for name in names]
