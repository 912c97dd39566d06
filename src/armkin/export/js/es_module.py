"""Writes the ES module of an arm, which computes all branches in a browser or in node, in double precision."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armkin import __version__, forward, motors
from armkin.errors import UsageError
from armkin.export import arm_formulas
from armkin.export.class_forms import has_form, plain_form, why_no_form
from armkin.export.js import js_elimination
from armkin.export.keep_out_pairs import pair_tables
from armkin.formula import c_and_js_code, recording
from armkin.inverse.branches.names import branch_names
from armkin.inverse.elimination.merge import MAX_ANSWERS
from armkin.inverse.solvers.choose_redundant_joint import redundancy
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.keep_out.bodies import ends_formula
from armkin.model.arm import actual_arm
from armkin.model.lock_joints import lock
from armkin.model.rotation import inverse
from armkin.model.units import radian_or_reach

if TYPE_CHECKING:
    from armkin.inverse.closed.geometry import Geometry
    from armkin.inverse.solvers.choose_redundant_joint import Redundancy
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm

_PARTS = Path(__file__).parent / "parts"
_ONE_COPY = 1e-6  # distance [rad] of limits from half a turn above which a value has only one legal copy
_ROUNDED = 5e-6  # largest deviation from orthonormal of a pose with six printed digits
_ARM_IS = """/** @type {{name: string, joints: number, branches: number, names: string[], method: string,
 *   slides: boolean[], lower: number[], upper: number[], home: number[], ratio: number[], unit: number[],
 *   reach: number, position: number, sums: number[][], offsets: number[], orientation: string, labels: string[]}} */"""
_KEEP_OUT_IS = """/** @type {{thick: number[], solid: number, moving: number[][], shapes: {kind: number,
 *   numbers: number[]}[], crossings: number[][], pairs: string[][], clearance: number}} of segments [mm] */"""
_OF_OTHERS = "ik, branch_names, ask, missOf, stood, told, nearestCopy"  # what families ask of the others' solver
_SOLVER = ("numbers", "linear_algebra", "residual", "component", "singular", "surfaces", "ik", "closest")


def module_text(arm: Arm, task_name: str | None = None) -> str:
    """The text of an ES module of an arm, with names, limits, home, fk, jacobian, target, ik, pulses, joints.

    Raises UsageError if the task does not fit the arm, or if the arm's class has no form without Python.
    """
    if redundant := redundancy(actual_arm(arm), task_name):
        return _module_with_one_held(arm, actual_arm(arm), redundant)
    return _module_of_all(arm, task_name, has_motors=not motors.undriven_joints(arm))


def _module_of_all(arm: Arm, task_name: str | None, has_motors: bool) -> str:
    """The text with data, kinematics, keep-outs, solver, and pulses if driven; UsageError without a form."""
    actual = actual_arm(arm)  # branches are found, and limits hold, in actual joint values
    task, recognised = solver(actual, task_name)
    geometry = plain_form(actual, task, recognised)
    if not has_form(geometry):
        raise UsageError(
            f"{arm.name}: {geometry.name} has no form in JavaScript: {why_no_form(arm, geometry)}; task {task.name} is "
            "solved in Python alone"
        )
    solve, branches = candidates_code(actual, task, geometry)
    parts = [
        f"// {_about_text(arm, task, geometry)}",
        part_text("head"),
        *_exported_lines(arm, task),
        *_data_lines(arm, actual, task, geometry, branches, has_motors),
        *_kinematics(actual, task),
        *_keep_outs(arm, actual),
        _by_joint(actual, has_ratio=bool((arm.ratio != 1.0).any())),
        *map(part_text, _SOLVER),
        *(map(part_text, js_elimination.METHOD) if geometry.pairs is None else ()),
        solve,
        part_text("poses"),
        part_text("module").replace("@TARGET@", _target_text(task)),
        *([part_text("pulses")] if has_motors else []),
    ]
    return "\n".join(parts)


def _module_with_one_held(arm: Arm, actual: Arm, redundant_joint: Redundancy) -> str:
    """The module of an arm with a redundant joint, which is held while an inner module solves the others."""
    name, task = arm.joint_names[redundant_joint.joint], redundant_joint.task
    is_unchanged = actual is arm and not arm.keep_out  # then the solver is prepared already
    other_joints = redundant_joint.rest if is_unchanged else replace(lock(arm, {name: 0.0}), keep_out=(), whole=None)
    other_module = _module_of_all(other_joints, task.name, has_motors=False).replace(part_text("head"), "")
    other_module = re.sub("^export ", "", other_module, flags=re.MULTILINE)
    link = arm.link[-1] if redundant_joint.joint else inverse(arm.link[0])
    has_motors = not motors.undriven_joints(arm)
    redundant = {
        "joint": redundant_joint.joint,
        "before": inverse(link).ravel().tolist(),
        "after": link.ravel().tolist(),
        "sums": task.sums[:, 0].tolist(),
    }
    parts = [
        f"// {_about_text(arm, task, redundant_joint.geometry)} while {name} is held",
        part_text("head"),
        *_exported_lines(arm, task),
        "/** The joint that the target leaves free: `ik` holds it. */",
        f"export const redundant = {_js_text(name)};",
        *_data_lines(arm, actual, task, redundant_joint.geometry, 0, has_motors),
        f"const REDUNDANT = {_js_text(redundant)};",
        f"const OTHERS = (() => {{\n{other_module}{part_text('held_branches')}\nreturn {{ {_OF_OTHERS} }};\n}})();",
        *_kinematics(actual, task),
        *_keep_outs(arm, actual),
        part_text("poses"),
        part_text("redundant").replace("@TARGET@", _target_text(task)),
        part_text("families"),
        *([part_text("pulses")] if has_motors else []),
    ]
    return "\n".join(parts)


def part_text(name: str) -> str:
    """The text of a part."""
    return (_PARTS / f"{name}.js").read_text(encoding="utf-8")


def candidates_code(arm: Arm, task: Task, geometry: Geometry) -> tuple[str, int]:
    """The function `candidates` for the class of an arm, and its number of branches."""
    if geometry.pairs is None:
        return js_elimination.elimination_code(arm, task, geometry.elimination), MAX_ANSWERS
    goal = {f"g{k}": f"goal[{k}]" for k in range(arm_formulas.goal_size(task))}
    recorded = arm_formulas.record_candidates(arm, task, geometry, measured=True)
    code = c_and_js_code.write_code(recorded, [*goal, *_preferred_inputs(arm)], c_and_js_code.JAVASCRIPT)
    *values, miss, length, angle, _ = arm_formulas.by_branch(recorded, code)
    doubts = dict.fromkeys(text for text in code.outputs[-1] if not text.startswith("0.0"))
    lines = [
        *(f"const {name} = {text};" for name, text in goal.items()),
        *code.lines,
        *(f"q[{b * arm.n + j}] = {values[j][b]};" for b in range(len(miss)) for j in range(arm.n)),
        *(f"miss[{k}] = {text};" for k, text in enumerate([*miss, *length, *angle])),
        f"return Boolean({' | '.join(doubts) or 0});",
    ]
    head = (
        "/** Candidate branches; squared residuals, then of lengths and of angles alone; whether it is at an edge.\n"
        " * @param {Numbers} goal @param {Numbers} near @param {Float64Array} q @param {Float64Array} miss\n"
        " * @param {number} [passes] of an elimination */\n"
        "function candidates(goal, near, q, miss, passes)"
    )
    return _function_text(head, lines), len(miss)


def _preferred_inputs(arm: Arm) -> Iterator[str]:
    """Expressions of the values of free joints: `near` of a slide, cosine and sine of a revolute joint."""
    for j in range(arm.n):
        yield from [f"near[{j}]"] if arm.prismatic[j] else [f"Math.cos(near[{j}])", f"Math.sin(near[{j}])"]


def _joint_function(name: str, recorded: recording.Recording) -> str:
    """A function that writes the outputs of a recording for joint values q into an array."""
    inputs = [f"q{j}" for j in range(len(recorded.inputs))]
    code = c_and_js_code.write_code(recorded, inputs, c_and_js_code.JAVASCRIPT)
    lines = [f"const {q} = q[{j}];" for j, q in enumerate(inputs)]
    lines += [*code.lines, *(f"out[{k}] = {text[0]};" for k, text in enumerate(code.outputs))]
    return _function_text(f"/** @param {{Numbers}} q @param {{Float64Array}} out */\nfunction {name}(q, out)", lines)


def _function_text(head: str, lines: list[str]) -> str:
    body = "\n".join(f"  {line}" for line in lines)
    return f"{head} {{\n{body}\n}}\n"


def _kinematics(actual: Arm, task: Task) -> list[str]:
    """The recorded functions of joint values: the tool's pose, the Jacobian, the target that is reached."""
    return [
        _joint_function("poseOf", recording.record(lambda q: forward.tip_formula(actual, q), actual.n)),
        _joint_function("slopeOf", recording.record(lambda q: forward.jacobian_formula(actual, q), actual.n)),
        _joint_function("targetOf", arm_formulas.record_target(actual, task)),
    ]


def _exported_lines(arm: Arm, task: Task) -> list[str]:
    """The exported constants: names, limits, home, labels."""
    ranges = np.stack([arm.lower, arm.upper], axis=1).tolist()
    limits = [[None if np.isinf(limit) else limit for limit in joint_range] for joint_range in ranges]
    return [
        "/** The joints. */",
        f"export const names = {_js_text(arm.joint_names)};",
        "/** [low, high] of each joint [rad | mm], null: unlimited. @type {((number | null)[] | null)[]} */",
        f"export const limits = {_js_text([None if row == [None, None] else row for row in limits])};",
        "/** Joint values at home [rad | mm]. */",
        f"export const home = {_js_text(arm.home.tolist())};",
        "/** What a target holds. */",
        f"export const labels = {_js_text(list(task.labels))};",
    ]


def _data_lines(arm: Arm, actual: Arm, task: Task, geometry: Geometry, branches: int, has_motors: bool) -> list[str]:
    """The data of the arm that the parts read."""
    fields: dict[str, Any] = {
        "name": arm.name,
        "joints": arm.n,
        "branches": branches,
        "names": branch_names(actual, task, geometry, branches) if branches else [],
        "method": geometry.name,
        "slides": actual.prismatic.tolist(),
        "lower": actual.lower.tolist(),
        "upper": actual.upper.tolist(),
        "home": actual.home.tolist(),
        "ratio": arm.ratio.tolist(),
        "unit": radian_or_reach(actual).tolist(),
        "reach": actual.reach,
        "position": task.position,
        "sums": task.sums.tolist(),
        "offsets": task.offsets.tolist(),
        "orientation": task.orientation,
        "labels": list(task.labels),
    }
    lines = [f"  {name}: {_js_text(value)}," for name, value in fields.items()]
    code = [_ARM_IS, "const ARM = {", *lines, "};", f"const ROTATION = {_ROUNDED!r};"]
    code.append(f"const CLOSED_FORM = {_js_text(geometry.pairs is not None)};")
    code.append(f"const CALIBRATED = {_js_text(bool((arm.ratio != 1.0).any()))};")
    if has_motors:
        values = {
            "gain": arm.motor_gain.tolist(),
            "bias": arm.motor_bias.tolist(),
            "inverse": motors.joints_per_pulse(arm).tolist(),
        }
        code += ["const MOTORS = {", *(f"  {name}: {_js_text(value)}," for name, value in values.items()), "};"]
    return [*code, ""]


def _by_joint(arm: Arm, *, has_ratio: bool) -> str:
    """The joint values of a candidate and their legal copies, without loops, which would take twice as long."""
    n = arm.n
    values = ", ".join(f"allJoints[{n} * b + {j}]" for j in range(n))
    head = "/** Joint values of a candidate. @param {number} b @returns {number[]} */\nfunction candidate(b)"
    text = _function_text(head, [f"return [{values}];"])
    lines = ["let inside = true;", "let turned = 0;", "let slid = 0;", "let value = 0;"]
    for j in range(n):
        lines += _copy_of_joint(arm, j, has_ratio=has_ratio)
    lines += [
        "copyInside = inside;",
        "copyMotion[0] = turned * DEGREES + slid;",
        "copyMotion[1] = turned + slid;",
        "return q;",
    ]
    head = (
        "/** Turns a posture into its legal copy nearest to `near`; `copyInside` and `copyMotion` tell of it.\n"
        " * @param {number[]} q @param {Numbers} near */\n"
        "function legal(q, near)"
    )
    return text + "\n" + _function_text(head, lines)


def _copy_of_joint(arm: Arm, j: int, *, has_ratio: bool) -> list[str]:
    """The lines that move joint j to its nearest legal copy, and add up its motion."""
    low, high, slides = float(arm.lower[j]), float(arm.upper[j]), bool(arm.prismatic[j])
    tests = [f"value >= {low!r} - SLACK"] if np.isfinite(low) else []
    tests += [f"value <= {high!r} + SLACK"] if np.isfinite(high) else []
    check = [f"if (!({' && '.join(tests)})) inside = false;"] if tests else []
    change = f"Math.abs(value - near[{j}]){f' / ARM.ratio[{j}]' if has_ratio else ''}"
    if slides:
        return [f"value = q[{j}];", *check, f"slid += {change};"]
    copy = f"  q[{j}] = value = nearestCopy(value, near[{j}], {_js_text(low)}, {_js_text(high)}, {_js_text(slides)});"
    if low > -np.pi + _ONE_COPY and high < np.pi - _ONE_COPY:  # only one copy is legal, whatever `near` is
        nearest = ["if (!(Math.abs(value) < Math.PI - SLACK)) {", copy, "}", *check]
    else:
        keeps_value = " && ".join([f"Math.abs(value - near[{j}]) < Math.PI - SLACK", *tests])
        nearest = [f"if (!({keeps_value})) {{", copy, *(f"  {line}" for line in check), "}"]
    return [f"value = q[{j}];", *nearest, f"turned += {change};"]


def _keep_outs(arm: Arm, actual: Arm) -> list[str]:
    """The tables of keep-outs, and the function of clearances; empty ones without keep-outs."""
    if not arm.keep_out:
        return ["const KEEPS_OUT = false;", "/** @type {(q: Numbers) => any} */", "const hitsOf = () => ({});"]
    tables = pair_tables(actual)
    values = {
        **tables._asdict(),
        "shapes": [{"kind": kind, "numbers": numbers} for kind, numbers in tables.shapes],
        "clearance": arm.clearance,
    }
    return [
        "const KEEPS_OUT = true;",
        _KEEP_OUT_IS,
        "const KEEP_OUT = {",
        *(f"  {name}: {_js_text(value)}," for name, value in values.items()),
        "};",
        _joint_function("endsOf", recording.record(lambda q: ends_formula(actual, q), arm.n)),
        part_text("keep_out"),
    ]


def _js_text(value: Any) -> str:
    """A value as JavaScript (JSON and infinity), escaped so that it ends neither a script element nor a line."""
    escape_of = {"<": "\\u003c", "\u2028": "\\u2028", "\u2029": "\\u2029"}
    text = json.dumps(value, ensure_ascii=False)
    for letter, code in escape_of.items():
        text = text.replace(letter, code)
    return text


def _about_text(arm: Arm, task: Task, geometry: Geometry) -> str:
    lines = [
        f"{arm.name}: kinematics in JavaScript, double precision. Generated, do not edit.",
        f"By armkin {__version__} from {Path(arm.path).name if arm.path else 'an arm made in Python'}, "
        f"sha256 {arm.sha256 or 'unknown'}.",
        f"Task {task.name}; {geometry.name}: {geometry.why}.",
        "Lengths in mm, angles in rad.",
    ]
    return "\n// ".join(" ".join(line.split()).replace("<", "\\u003c") for line in lines)


def _target_text(task: Task) -> str:
    if task.orientation == "full":
        return "the tool's pose, four rows of four [mm]"
    return f"{' '.join(task.labels)} [mm, rad]"
