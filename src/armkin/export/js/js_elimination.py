"""The general elimination as JavaScript: the method is the same for all arms, and its constants are data.

`armkin.inverse.elimination.method` explains the method and why it is complete.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.export.elimination_data import frame_rows, moves_of, pencil_arrays, pencils_of, plans_of
from armkin.formula import c_and_js_code, recording
from armkin.inverse.elimination.merge import weights
from armkin.inverse.elimination.method import Elimination
from armkin.inverse.numeric.tolerances import BESIDE_SPECIAL, EQUAL_ROOTS, SHAKES, TWIN_ROOTS, UPRIGHT
from armkin.inverse.solvers import tool_axis
from armkin.model.rotation import inverse

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from armkin.inverse.elimination.pencil import Pencil
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm

__all__ = ["METHOD", "elimination_code"]
METHOD = ("eigenvalues", "frames", "roots", "equal_roots", "elimination")


def elimination_code(arm: Arm, task: Task, elimination: Elimination) -> str:
    """The constants of an arm that the elimination solves, and its function `candidates`, which calls `METHOD`."""
    kinds = plans_of(elimination, len(SHAKES))
    pencils, plans = pencils_of(kinds)
    loop = elimination.loop
    fields = {
        "length": repr(loop.length),
        "residual": repr((loop.length / arm.reach) ** 2),
        "beside": repr(BESIDE_SPECIAL),
        "equalRoots": repr(EQUAL_ROOTS),
        "twinRoots": repr(TWIN_ROOTS),
        "upright": repr(UPRIGHT),
        "fromBase": _array_code(frame_rows(inverse(loop.base))),
        "fromTool": _array_code(frame_rows(inverse(loop.tool))),
        "links": _arrays_code([frame_rows(link) for link in loop.links]),
        "slides": _flags_code(loop.prismatic),
        "weights": _array_code(weights(5 if task.orientation == "axis" else 6)),
        "shakes": _array_code(SHAKES[: len(kinds[0])]),
        "shaking": _arrays_code(moves_of(len(kinds[0]))),
        "plan": repr(plans),
    }
    lines = ["const LOOP = {", *(f"  {name}: {text}," for name, text in fields.items()), "};"]
    lines += ["/** @type {Pencil[]} */", "const PENCILS = [", *map(_pencil_code, pencils), "];"]
    head = (
        "/** @param {Numbers} goal @param {Numbers} near @param {Float64Array} q @param {Float64Array} miss\n"
        " * @param {number} [passes] */\n"
        "function candidates(goal, near, q, miss, passes) {"
    )
    pose = "goal"
    if task.orientation == "axis":  # solved through a pose with that z axis and an additional joint
        recorded = recording.record(tool_axis.pose_of, 6)
        code = c_and_js_code.write_code(recorded, [f"goal[{k}]" for k in range(6)], c_and_js_code.JAVASCRIPT)
        head = "\n".join([head, *(f"  {line}" for line in code.lines)])
        pose = f"[{', '.join(text[0] for text in code.outputs)}]"
    return "\n".join([*lines, head, f"  return candidatesOfPose({pose}, near, q, miss, passes);", "}", ""])


def _pencil_code(pencil: Pencil) -> str:
    """A pencil as a JavaScript object."""
    role = pencil.role
    fields = {
        "psi": repr(float(pencil.psi)),
        "slot": str(role.slot),
        "backward": "true" if role.backward else "false",
        "hidden": str(role.hidden),
        "dialytic": str(role.dialytic),
        "wide": "true" if role.wide else "false",
        "products": str(pencil.products),
        "rows": str(15 - pencil.ends.rank),
        "r": str(pencil.K_re.shape[1]),
        "w": str(pencil.W.shape[1]),
        "size": str(pencil.size),
        "order": repr([int(k) for k in role.order]),
        "slides": _flags_code(pencil.prismatic),
        **{name: "null" if values is None else _array_code(values) for name, values in pencil_arrays(pencil).items()},
    }
    return "\n".join(["  {", *(f"    {name}: {text}," for name, text in fields.items()), "  },"])


def _array_code(values: ArrayLike) -> str:
    numbers = np.asarray(values, dtype=float).ravel().tolist()
    return f"Float64Array.of({', '.join(str(int(value)) if value == int(value) else repr(value) for value in numbers)})"


def _arrays_code(rows: list[np.ndarray]) -> str:
    return f"[{', '.join(map(_array_code, rows))}]"


def _flags_code(values: ArrayLike) -> str:
    return f"[{', '.join('true' if flag else 'false' for flag in np.asarray(values).ravel())}]"
