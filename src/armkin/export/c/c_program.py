"""The files of an arm in C99: a header, the source, and a test program with golden values."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from armkin import __version__
from armkin.errors import UsageError
from armkin.export import arm_formulas
from armkin.export.c import c_elimination, c_functions, keep_out_tables
from armkin.export.c.golden_values import golden_test
from armkin.export.c.source_parts import part_text
from armkin.export.class_forms import has_form, plain_form, why_no_form
from armkin.formula.arrays import Array
from armkin.formula.c_and_js_code import number_text
from armkin.inverse.branches.names import branch_names
from armkin.inverse.elimination.merge import MAX_ANSWERS
from armkin.inverse.numeric.tolerances import CLOSE_DISTANCE, DECIMAL, FLOAT32
from armkin.inverse.solvers.choose_redundant_joint import held_by_near, redundancy
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.task import MAX_TARGET, ROUNDED
from armkin.model.arm import actual_arm

if TYPE_CHECKING:
    from armkin.inverse.closed.geometry import Geometry
    from armkin.inverse.solvers.choose_redundant_joint import Redundancy
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm

# thresholds of squared residuals (in reaches, rad) of exact branches, of branches, and of near solutions; distance
# below which answers are equal; deviation of a rotation matrix from orthonormal
_DOUBLE = {"ACCEPTED": 1e-24, "SOLUTION": 1e-18, "NEARBY": 1e-12, "SAME": 1e-6, "ROTATION": 5e-6, "LARGEST": MAX_TARGET}
_SINGLE = {"ACCEPTED": 1e-10, "SOLUTION": 1e-9, "NEARBY": 1e-6, "SAME": 1e-3, "ROTATION": 1e-3, "LARGEST": 1e9}


class Program(NamedTuple):
    """Texts of the header, the source and the test program."""

    header: str
    source: str
    test: str


def program(arm: Arm, file: str, task_name: str | None = None, single: bool = False) -> Program:
    """An arm as C99; file: the source's name, such as ``arm.c``; single: 32-bit numbers.

    Raises UsageError if the task does not fit the arm, or if the arm's class has no form in C.
    """
    actual = actual_arm(arm)  # branches and limits are in actual joint values
    method = _method_of(actual, task_name)
    task, geometry = method.task, method.geometry
    candidates, branches = candidates_code(actual, task, geometry, single, redundant=method.redundant)
    prefix = identifier(arm.name)
    units = ["mm" if slides else "rad" for slides in arm.prismatic]
    joints = ", ".join(f"{name} [{unit}]" for name, unit in zip(arm.joint_names, units, strict=True))
    user_texts = {  # texts chosen by users stay as they are, even if a source is called arm_ik.c
        "about": _about_text(arm, task, geometry, single),
        "stem": Path(file).stem,
        "joints_are": comment_text(joints),
    }
    fields = _fields(arm, task, geometry, branches, single) | {name: f"@{name}@" for name in user_texts}
    source = _source_text(arm, task, candidates, single)
    test = golden_test(arm, task, part_text("test"), single, method.numbered)
    texts = (part_text("header"), source, test)
    return Program(*(fill_fields(_prefix_names(fill_fields(text, fields), prefix), user_texts) for text in texts))


def _fields(arm: Arm, task: Task, geometry: Geometry, branches: int, single: bool) -> dict[str, str]:
    """Texts of the @names@ in the fixed parts, except those chosen by users."""
    actual = actual_arm(arm)
    names = branch_names(actual, task, geometry, branches)
    other_held_values = part_text("other_held_values").replace("@reach@", number_text(arm.reach, single))
    return {
        "keep_outs": keep_out_tables.declarations(arm) if arm.keep_out else "",
        "guard": f"ARMKIN_{identifier(arm.name).upper()}_H",
        "real": "float" if single else "double",
        "joints": str(arm.n),
        "branches": str(branches),
        "target": str(target_size(task)),
        "goal": str(arm_formulas.goal_size(task)),
        "target_is": _target_text(task),
        "names": ",\n    ".join(f'"{name}"' for name in names),
        "position": str(task.position),
        "first": "9" if task.orientation == "full" else "0",
        "reach": number_text(arm.reach, single),
        "orientation": _orientation_lines(arm, task, single),
        "most": "arm_most(target)" if task.orientation == "full" else "ARM_SOLUTION",
        "other_held_values": other_held_values if geometry.pairs is not None else "",
        "lower": _number_list(actual.lower, single),
        "upper": _number_list(actual.upper, single),
        **_ratio_lines(arm, single),
        "slides": ", ".join(str(int(slides)) for slides in arm.prismatic),
    }


def _source_text(arm: Arm, task: Task, candidates: str, single: bool) -> str:
    """The source before its @names@ are filled in; candidates: the function `arm_candidates`."""
    parts = [
        part_text("source_head"),
        part_text("numbers_float" if single else "numbers_double"),
        settings(single),
        c_functions.forward_kinematics(arm, single),
        c_functions.jacobian_code(arm, single),
        c_functions.target_code(arm, task, single),
        candidates,
        part_text("whole_turns"),
        part_text({"full": "read_pose", "axis": "read_axis"}.get(task.orientation, "read_numbers")),
        part_text("ik"),
        part_text("source_tail"),
        *([keep_out_tables.clearances_code(arm, single), keep_out_tables.free_code(arm)] if arm.keep_out else []),
    ]
    return "\n".join(parts)


class _Method(NamedTuple):
    """The method that solves the targets of an arm in C."""

    task: Task
    geometry: Geometry  # the class; with a redundant joint, the class of the others with that joint held by near
    redundant: Redundancy | None
    numbered: bool  # whether branches have the same numbers as in Python


def _method_of(arm: Arm, task_name: str | None) -> _Method:
    """The method for the class of an arm; UsageError if the task does not fit the arm."""
    redundant = redundancy(arm, task_name)
    if redundant is None:
        task, recognised = solver(arm, task_name)
        geometry = plain_form(arm, task, recognised)
        return _Method(task, geometry, redundant=None, numbered=geometry is recognised)
    geometry = plain_form(redundant.rest, redundant.task, redundant.geometry)
    is_numbered = geometry is redundant.geometry
    redundant = redundant._replace(geometry=geometry)
    return _Method(redundant.task, held_by_near(arm, redundant), redundant, numbered=is_numbered)


def candidates_code(
    arm: Arm,
    task: Task,
    geometry: Geometry,
    single: bool = False,
    prefer: bool = True,
    lanes: str = "",
    redundant: Redundancy | None = None,
) -> tuple[str, int]:
    """The function `arm_candidates` for the class of an arm, and its number of branches.

    lanes, redundant: see `c_elimination.candidates_code`; closed forms contain the held joint.
    Raises UsageError if the class has no form in C, or none in single precision.
    """
    if geometry.pairs is not None:
        return c_functions.candidates_code(arm, task, geometry, single, prefer)
    if not has_form(geometry):
        raise UsageError(
            f"{arm.name}: {geometry.name} has no form in C: {why_no_form(arm, geometry)}; task {task.name} is solved "
            "in Python alone"
        )
    if single:
        raise UsageError(f"{arm.name}: {geometry.name} needs double precision", precision="double")
    return c_elimination.candidates_code(arm, task, geometry.elimination, lanes=lanes, redundant=redundant), MAX_ANSWERS


def settings(single: bool = False) -> str:
    """The constants of the fixed parts."""
    values = {**(_SINGLE if single else _DOUBLE), "CLOSE_BY": CLOSE_DISTANCE}  # answers this close may be equal
    values |= {"ROUNDED": ROUNDED, "DECIMAL": DECIMAL, "FLOAT": FLOAT32}
    lines = [f"#define ARM_{name} {number_text(value, single)}" for name, value in values.items()]
    return "\n".join([*lines, ""])


def target_size(task: Task) -> int:
    """Number of values of a target as given by users."""
    return 16 if task.orientation == "full" else len(task.labels)


def identifier(name: str) -> str:
    """A robot's name as a C identifier.

    >>> identifier("RA02 (5 axes)"), identifier("6dof")
    ('ra02_5_axes', 'arm_6dof')
    """
    text = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "arm"
    return text if text[0].isalpha() else f"arm_{text}"


def fill_fields(text: str, fields: dict[str, str]) -> str:
    """A text with its @names@ filled in."""
    return re.sub(r"@(\w+)@", lambda match: fields[match[1]], text)


def _prefix_names(text: str, prefix: str) -> str:
    """The text with the robot's name in public names, so that a program can contain two arms."""
    text = re.sub(r"\barm_(fk|jacobian|target|ik|best|names|real|solution|free|pairs)\b", rf"{prefix}_\1", text)
    return re.sub(r"\bARM_(JOINTS|BRANCHES|TARGET)\b", rf"{prefix.upper()}_\1", text)


def _ratio_lines(arm: Arm, single: bool) -> dict[str, str]:
    """Lines that convert `near` to actual joint values and branches to commanded ones, for calibrated arms."""
    if (arm.ratio == 1.0).all():
        return {"actual_near": "", "commanded": "", "close": ""}
    table = f"static const arm_real ratio[ARM_JOINTS] = {{{_number_list(arm.ratio, single)}}};"
    return {
        "close": ", close[ARM_JOINTS]",
        "actual_near": f"""    {{ /* actual turn per commanded turn, from calibration */
        {table}
        for (j = 0; j < ARM_JOINTS; j++)
            close[j] = near[j] * ratio[j];
        near = close;
    }}
""",
        "commanded": f"""        for (j = 0; j < ARM_JOINTS; j++) {{
            {table}
            one->q[j] /= ratio[j];
        }}
""",
    }


def _orientation_lines(arm: Arm, task: Task, single: bool) -> str:
    """Lines that add the residual of the orientation at joint values q to `sum`."""
    lines = []
    if task.orientation == "full":  # half the squared Frobenius norm approximates the squared angle
        lines = [
            "for (i = 0; i < 9; i++) {",
            "    off = T[4 * (i % 3) + i / 3] - goal[i];",
            "    sum += off * off / 2;",
            "}",
        ]
    if task.orientation == "axis":
        lines = ["for (i = 0; i < 3; i++) {", "    off = T[4 * i + 2] - goal[3 + i];", "    sum += off * off;", "}"]
    for k, (row, offset) in enumerate(zip(task.sums, task.offsets, strict=True), task.position):
        terms = [f"{number_text(float(weight), single)} * q[{j}]" for j, weight in enumerate(row * arm.ratio) if weight]
        lines += [
            f"off = {' + '.join([*terms, number_text(float(offset), single)])} - goal[{k}];",
            "off -= ARM_TURN * ARM_RINT(off / ARM_TURN);",
            "sum += off * off;",
        ]
    return "".join(f"    {line}\n" for line in lines)


def _number_list(values: Array, single: bool) -> str:
    return ", ".join(number_text(float(value), single) for value in values)


def _about_text(arm: Arm, task: Task, geometry: Geometry, single: bool) -> str:
    lines = [
        f"{arm.name}: kinematics in C99, {'single' if single else 'double'} precision. Generated, do not edit.",
        f"By armkin {__version__} from {arm.path or 'an arm made in Python'}, sha256 {arm.sha256 or 'unknown'}.",
        f"Task {task.name}; {geometry.name}: {geometry.why}.",
        "Lengths in mm, angles in rad. No allocation, no global state; needs libm alone.",
    ]
    return "\n   ".join(map(comment_text, lines))


def comment_text(text: str) -> str:
    """A line that is safe in a C comment: without comment marks and trigraphs.

    >>> comment_text("reach 2*/3")
    'reach 2* /3'
    """
    return " ".join(re.sub(r"\*(?=/)|/(?=\*)|\?(?=\?)", lambda mark: f"{mark[0]} ", text).split())


def _target_text(task: Task) -> str:
    if task.orientation == "full":
        return "the tool's pose, a 4 x 4 matrix row by row"
    return " ".join(task.labels) + (
        " (direction of the tool's z axis, any length)" if task.orientation == "axis" else ""
    )
