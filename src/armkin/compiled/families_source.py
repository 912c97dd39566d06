"""The C text of the families of an arm, with the closed form of the joints that are not redundant."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.compiled import boundaries_source
from armkin.compiled.own_parts import own_part
from armkin.export.c.c_program import fill_fields
from armkin.export.c.source_parts import part_text
from armkin.formula import c_and_js_code, recording
from armkin.formula.c_and_js_code import number_text
from armkin.inverse.closed.candidates import recorded_formula
from armkin.inverse.closed.subproblems import Pair
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.arm_angle import arm_angle
from armkin.inverse.redundant.boundaries import boundaries
from armkin.inverse.redundant.followed_branches import EVEN_SAMPLES, STEPS
from armkin.inverse.solvers.choose_redundant_joint import move_entries, redundancy
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.model.arm import actual_arm

if TYPE_CHECKING:
    from armkin.formula.arrays import Entry
    from armkin.inverse.solvers.choose_redundant_joint import Redundancy
    from armkin.model.arm import Arm

INSIDE_STEPS = 1e-13, 1e-11, 1e-9  # ways [rad] from a branch's end to where it may be there
PART_NAMES = "family_branches", "family_nearest", "followed_families"
MAX_PIECES = 64  # pieces, at most, of a target in C
GOAL = 12  # numbers of a pose


def followed_redundancy(arm: Arm, task: str | None) -> Redundancy | None:
    """The redundant joint of an arm whose families are followed in C; None for every other arm."""
    redundant = redundancy(arm, task)
    if redundant is None or redundant.joint != arm.n - 1 or redundant.task.orientation != "full":
        return None
    if arm.keep_out or actual_arm(arm) is not arm or not redundant.by_formula or arm_angle(arm) is not None:
        return None
    return redundant if boundaries(arm) is not None else None


def families_code(arm: Arm, redundant: Redundancy) -> str:
    """`arm_families` of an arm."""
    form, fields = _others_code(arm, redundant)
    bounds = boundaries(arm)
    assert bounds is not None
    fields |= boundaries_source.roots_fields(bounds) | {
        "turns": part_text("turns"),
        "others": form,
        "accepted": number_text(tol.ACCEPTED**2),
        "reach": number_text(tol.REACH),
        "beside": number_text(tol.BESIDE_END),
        "crossing": number_text(tol.BESIDE_CROSSING),
        "probe": number_text(tol.PROBE_SHARE),
        "same_end": number_text(tol.SAME_END),
        "inside": ", ".join(map(number_text, INSIDE_STEPS)),
        "pieces": str(MAX_PIECES),
        "even": str(EVEN_SAMPLES),
        "sections": str(STEPS),
        "lower": _numbers(arm.lower),
        "upper": _numbers(arm.upper),
    }
    text = "\n".join(map(own_part, PART_NAMES))
    return fill_fields(text, fields)


def _others_code(arm: Arm, redundant: Redundancy) -> tuple[str, dict[str, str]]:
    """`arm_others`, all branches of a target at values of the redundant joint, and fields that tell where each stands.

    What branches share stands there once.
    """
    rest_form = recorded_formula(redundant.rest, solver(redundant.rest, redundant.task.name)[0], redundant.geometry)
    n = arm.n

    def formula(x: list[Entry]) -> list[Entry]:
        goal = move_entries(arm, redundant, x[:GOAL], Pair(x[GOAL], x[GOAL + 1]))
        return rest_form.candidates(goal, [None] * (n - 1))[:n]

    recorded = recording.record(formula, GOAL + 2)
    code = c_and_js_code.write_code(recorded, [*(f"goal[{k}]" for k in range(GOAL)), "c", "s"])
    axes = np.broadcast_shapes((1,), *map(recording.axes_of, recorded.outputs))
    places = np.empty((n + 1, int(np.prod(axes))), int)  # of each joint's values, and of the residuals
    columns: list[tuple[int, str]] = []
    for j, (output, texts) in enumerate(zip(recorded.outputs, code.outputs, strict=True)):
        first = 0 if j == n - 1 else len(columns)
        own = first + np.arange(len(texts)).reshape(recording.axes_of(output) or (1,))
        places[j if j < n - 1 else n] = np.broadcast_to(own, axes).ravel()
        columns += [(j, text) for text in texts] if j < n - 1 else []
    places[n - 1] = len(columns)
    columns.append((n - 1, "t[i]"))
    stores = [f"value[{k} * ARM_LANES + i] = {text};" for k, (_, text) in enumerate(columns)]
    stores += [f"miss[{k} * ARM_LANES + i] = {text};" for k, text in enumerate(code.outputs[n - 1])]
    body = "\n".join(f"        {line}" for line in ["const double c = cosine[i], s = sine[i];", *code.lines, *stores])
    text = f"""/* All branches of the other joints at values t of the redundant one. */
static void arm_others(const double *ARM_RESTRICT goal, const double *ARM_RESTRICT t, double *ARM_RESTRICT value,
    double *ARM_RESTRICT miss)
{{
    double cosine[ARM_LANES], sine[ARM_LANES];
    int i;
    for (i = 0; i < ARM_LANES; i += 8)
        arm_turns(t + i, cosine + i, sine + i);
    for (i = 0; i < ARM_LANES; i++) {{
{body}
    }}
}}
"""
    assert places.shape[1] <= 32, "branches are the bits of a word"
    return text, {
        "branches": str(places.shape[1]),
        "columns": str(len(columns)),
        "misses": str(len(code.outputs[n - 1])),
        "joint_of": ", ".join(str(j) for j, _ in columns),
        "column": ", ".join("{" + ", ".join(map(str, row)) + "}" for row in places[:n].T.tolist()),
        "missed": ", ".join(map(str, places[n].tolist())),
    }


def _numbers(values: np.ndarray) -> str:
    return ", ".join(number_text(float(value)) for value in values)
