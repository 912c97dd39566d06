"""Which classes of arms can be written in C and JavaScript, and why others cannot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armkin.export import elimination_data
from armkin.inverse.solvers import general

if TYPE_CHECKING:
    from armkin.inverse.closed.geometry import Geometry
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm


def plain_form(arm: Arm, task: Task, geometry: Geometry) -> Geometry:
    """The class itself, or the elimination if that has a form in C and JavaScript and the class has none."""
    if has_form(geometry) or not geometry.complete or task.name != "pose" or arm.n != 6:
        return geometry
    elimination = general.recognise(arm, task)
    return geometry if elimination is None or not has_form(elimination) else elimination


def why_no_form(arm: Arm, geometry: Geometry) -> str:
    """The reason why a class of arms cannot be written in C or JavaScript."""
    if geometry.elimination is None and geometry.name.startswith("near "):
        return "its branches are corrected ones of the class that it nearly fits, as many rounds as each needs"
    if geometry.elimination is None:
        return f"{arm.n} joints for a full pose are searched among the branches of a longer arm"
    if int(arm.prismatic.sum()) == 3:
        return "three of its joints are slides"
    return "the pencils that are healthy on it are none of those that the C code reads"


def has_form(geometry: Geometry) -> bool:
    """Whether a class of arms can be written in C and JavaScript."""
    elimination = geometry.elimination
    return geometry.pairs is not None or (elimination is not None and elimination_data.has_form(elimination))
