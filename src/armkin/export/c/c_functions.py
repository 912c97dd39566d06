"""Recorded formulas as C functions: candidates of a closed form, forward kinematics, Jacobian.

Every function is a loop over lanes, with the values of pose i at ``[k * ARM_LANES + i]``. With one lane there is no
loop; with more lanes, compilers vectorise it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from armkin import forward
from armkin.export import arm_formulas
from armkin.formula import c_and_js_code, recording
from armkin.inverse.closed.subproblems import IN_DOUBLE, IN_SINGLE, recorded_for

if TYPE_CHECKING:
    from armkin.inverse.closed.geometry import Geometry
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm


def candidates_code(
    arm: Arm, task: Task, geometry: Geometry, single: bool = False, prefer: bool = True
) -> tuple[str, int]:
    """`arm_candidates` of a closed form, and its number of branches.

    prefer: whether free joints take their value from `near`; otherwise a target with a free joint has doubt 3 instead
    of 1.
    """
    n = arm.n
    declared = [(f"g{k}", f"goal[{k} * ARM_LANES + i]") for k in range(arm_formulas.goal_size(task))]
    declared += _preferred_inputs(arm) if prefer else []
    with recorded_for(IN_SINGLE if single else IN_DOUBLE):
        recorded = arm_formulas.record_candidates(arm, task, geometry, prefer)
    code = c_and_js_code.write_code(recorded, [name for name, _ in declared], _language(single))
    outputs = arm_formulas.by_branch(recorded, code)
    values, miss = outputs[:n], outputs[n]
    stores = [f"q[{b * n + j} * ARM_LANES + i] = {values[j][b]};" for b in range(len(miss)) for j in range(n)]
    stores += [f"miss[{b} * ARM_LANES + i] = {miss[b]};" for b in range(len(miss))]
    edge, *joint_is_free = map(_any_true, code.outputs[n + 1 :])
    doubt = f"({edge}) | ({joint_is_free[0]}) * 2" if joint_is_free and joint_is_free[0] else edge or "0"
    stores.append(f"doubt[i] = {doubt};")
    head = (
        "static void arm_candidates(const arm_real *ARM_RESTRICT goal, const arm_real *ARM_RESTRICT near,\n"
        "    arm_real *ARM_RESTRICT q, arm_real *ARM_RESTRICT miss, int *ARM_RESTRICT doubt, int count)"
    )
    text = _lane_loop(head, declared, [*code.lines, *stores])
    return (text if "near[" in text else text.replace("int i;", "int i;\n    (void)near;", 1)), len(miss)


def _preferred_inputs(arm: Arm) -> list[tuple[str, str]]:
    """Names and expressions of the values of free joints: `near` of a slide, cosine and sine of a revolute joint."""
    declared = []
    for joint in range(arm.n):
        near = f"near[{joint} * ARM_LANES + i]"
        cos_and_sin = [(f"c{joint}", f"ARM_COS({near})"), (f"s{joint}", f"ARM_SIN({near})")]
        declared += [(f"p{joint}", near)] if arm.prismatic[joint] else cos_and_sin
    return declared


def _any_true(texts: Sequence[str]) -> str:
    """The expression of whether one of these is true, without those that never are."""
    return " | ".join(dict.fromkeys(text for text in texts if not text.startswith("0.0")))


def forward_kinematics(arm: Arm, single: bool = False) -> str:
    """`arm_pose`, of 16 numbers row by row."""
    return joint_function_code(arm, "arm_pose", forward.tip_formula, "T", single)


def position_code(arm: Arm) -> str:
    """`arm_point`, of 3 numbers."""
    return joint_function_code(arm, "arm_point", forward.point_formula, "p", False)


def jacobian_code(arm: Arm, single: bool = False) -> str:
    """`arm_slope`, of 6 n numbers row by row."""
    return joint_function_code(arm, "arm_slope", forward.jacobian_formula, "J", single)


def target_code(arm: Arm, task: Task, single: bool = False) -> str:
    """`arm_goal`, the target that joint values reach."""
    return _recorded_code(arm_formulas.record_target(arm, task), "arm_goal", "target", single)


def joint_function_code(arm: Arm, name: str, formula: forward.Formula, output: str, single: bool) -> str:
    """A function of joint values."""
    return _recorded_code(recording.record(lambda q: formula(arm, q), arm.n), name, output, single)


def _recorded_code(recorded: recording.Recording, name: str, output: str, single: bool) -> str:
    declared = [(f"q{j}", f"q[{j} * ARM_LANES + i]") for j in range(len(recorded.inputs))]
    code = c_and_js_code.write_code(recorded, [name for name, _ in declared], _language(single))
    stores = [f"{output}[{k} * ARM_LANES + i] = {text[0]};" for k, text in enumerate(code.outputs)]
    head = f"static void {name}(const arm_real *ARM_RESTRICT q, arm_real *ARM_RESTRICT {output}, int count)"
    return _lane_loop(head, declared, [*code.lines, *stores])


def _language(single: bool) -> c_and_js_code.Language:
    return c_and_js_code.C_SINGLE if single else c_and_js_code.C


def _lane_loop(head: str, declared: Sequence[tuple[str, str]], lines: Sequence[str]) -> str:
    """A function that runs the lines for every lane, with declarations of the inputs that they read."""
    read = set(re.findall(r"\b[gpcsq]\d+\b", "\n".join(lines)))
    inputs = [f"const arm_real {name} = {text};" for name, text in declared if name in read]
    body = "\n".join(f"        {line}" for line in [*inputs, *lines])
    return f"{head}\n{{\n    int i;\n    for (i = 0; i < count; i++) {{\n{body}\n    }}\n}}\n"
