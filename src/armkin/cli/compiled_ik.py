"""`armkin.ik` and `armkin.fk` by machine code: functions of a module, which other processes find by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.inverse.answers.solutions import Solutions
    from armkin.model.arm import Arm


def prepare(arm: Arm) -> None:
    """Build the machine code, before there are processes, which then have it, too."""
    import armkin

    armkin.compile(arm)


def ik(
    arm: Arm, targets: Array, task: str | None = None, near: Array | None = None, rounding: Array | None = None
) -> Solutions:
    """`armkin.ik`."""
    import armkin

    return armkin.compile(arm).ik(targets, task, near, rounding=rounding)


def fk(arm: Arm, q: Array) -> Array:
    """`armkin.fk`."""
    import armkin

    return armkin.compile(arm).fk(q)
