"""The C file of `armkin.compile`: the formulas of an arm, and the loop over a batch."""

from __future__ import annotations

import hashlib
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.compiled import families_source
from armkin.compiled.own_parts import own_part
from armkin.export import arm_formulas, class_forms
from armkin.export.c import c_elimination, c_functions, c_program, keep_out_tables
from armkin.export.c.source_parts import part_text
from armkin.formula.c_and_js_code import number_text
from armkin.inverse.numeric.tolerances import (
    ACCEPTED,
    ARRIVED_STEP,
    CLOSE_DISTANCE,
    DRIFT,
    ERROR,
    FAR_DISTANCE,
    FOLD_BEND,
    FOLD_VALUE,
    FOLD_WAY,
    HIGH_ORDER,
    MOVED,
    REACH,
    ROUNDING_DISTANCE,
    ROUNDING_RESIDUAL,
    SEED_RESIDUAL,
    SMOOTH_ERROR,
    SOLUTION,
    STANDING_DISTANCE,
    STILL_TURN,
    TINY,
    WEAK,
)
from armkin.inverse.singular import chains, local_structure, second_order, self_motions
from armkin.inverse.singular.near_itself import COARSE_ROOM, ROOM
from armkin.inverse.tasks.task import MAX_TARGET
from armkin.model.limits import SLACK
from armkin.model.units import radian_or_reach

if TYPE_CHECKING:
    from armkin.inverse.closed.geometry import Geometry
    from armkin.inverse.solvers.choose_redundant_joint import Redundancy
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm

LANES = 16  # poses computed together, for vectors of any length and blocks of a few kilobytes
POSES = 8  # poses of an elimination computed together, a multiple of the lanes of its vectors
_LOCKSTEP = ("lanes", "lanes_eigenvalues", "lanes_pencil", "lanes_roots", "lanes_equal_roots", "lanes_pass")


class Library(NamedTuple):
    """A C file to be compiled.

    content: its sha256, also in the file as `arm_content`. branches: 0 if it has no `arm_batch`. level: of
    optimisation; 3 vectorises formulas, but for an elimination it brings nothing and takes seconds.
    """

    text: str
    content: str
    branches: int
    level: int


def library(
    commanded: Arm, arm: Arm, task: Task | None, geometry: Geometry | None, redundant: Redundancy | None = None
) -> Library:
    """The C file of an arm; only fk without a task, or if the class has no form in C.

    commanded: the arm; arm: the same in actual joint values (`armkin.model.arm.actual_arm`), as branches have them;
    redundant: its redundant joint, if its families are followed in C.
    """
    solve, branches, level = "", 0, 3
    if task is not None and geometry is not None and class_forms.has_form(geometry):
        solve, branches = c_program.candidates_code(
            arm, task, geometry, prefer=False, lanes="".join(map(own_part, _LOCKSTEP))
        )
    fields = {
        "about": f"{c_program.identifier(arm.name)}: built for this computer by armkin.compile.",
        "joints": str(arm.n),
        "lanes": str(LANES),
    }
    parts = [own_part("head"), c_program.settings(), _fast_numbers()]
    parts += [c_functions.forward_kinematics(commanded), _joint_loop("Poses", "arm_pose", 16)]
    parts += [c_functions.position_code(commanded), _joint_loop("Positions of the tool", "arm_point", 3)]
    if commanded.keep_out and commanded.whole is None:
        parts += [keep_out_tables.clearances_code(commanded), own_part("clearances")]
        parts += [_joint_loop("Least clearances and their pairs", "arm_clearance", 2)]
    if redundant is not None:
        parts += [part_text("whole_turns"), families_source.families_code(arm, redundant)]
    if branches:
        assert task is not None
        max_residual = ACCEPTED**2
        if geometry is not None and geometry.pairs is None:
            # the elimination has its own threshold
            max_residual, level, fields["lanes"] = c_elimination.ACCEPTED, 2, str(POSES)
        fields |= _task_fields(arm, task, branches, max_residual)
        # unordered branches are numbered by their columns until `follow_branches` sorts them along a path
        fields["index"] = "b" if geometry is not None and geometry.ordered else "place"
        gather = "gather_pose" if task.orientation == "full" else "gather_numbers"
        jacobian, folds = _fold_code(arm, task, geometry, branches, fields)
        parts += [*jacobian, own_part("lane_sizes"), solve, part_text("whole_turns"), _choose_code(arm, branches)]
        parts += [own_part(gather), folds, own_part("batch")]
        parts += [own_part("elimination_rows")] if has_rows(task, geometry) else []
    text = c_program.fill_fields("\n".join(parts), {**fields, "content": "@content@"})
    content = hashlib.sha256(text.encode()).hexdigest()
    return Library(text.replace("@content@", content), content, branches, level)


def _fold_code(
    arm: Arm, task: Task, geometry: Geometry | None, branches: int, fields: dict[str, str]
) -> tuple[list[str], str]:
    """The Jacobian, if C judges targets on an edge, and the code that judges them or leaves them to Python."""
    if geometry is None or not _can_judge_folds(arm, task, geometry) or branches > LANES:
        return [], own_part("no_folds")
    text = own_part("folds")
    for field, part in (("@followed@", "branch_to_fold"), ("@twins@", "twin_branches")):
        text = text.replace(field, own_part(part) + "\n")
    return [c_functions.jacobian_code(arm)], c_program.fill_fields(text, _fold_fields(arm, task) | fields)


def has_rows(task: Task, geometry: Geometry | None) -> bool:
    """Whether the file has `arm_rows`, an elimination of targets as they are given."""
    return geometry is not None and geometry.pairs is None and task.orientation == "full"


def _task_fields(arm: Arm, task: Task, branches: int, max_residual: float) -> dict[str, str]:
    """Values of the fields in the parts of `ik`."""
    bounds = ["ARM_FARTHEST"] * task.position + ["ARM_WILD"] * len(task.sums)
    if task.orientation == "axis":
        bounds += [number_text(2.0)] * 3
    return {
        "branches": str(branches),
        "target": str(c_program.target_size(task)),
        "goal": str(arm_formulas.goal_size(task)),
        "accepted": number_text(max_residual),
        "room": number_text(ROOM * arm.reach),
        "coarse": number_text(COARSE_ROOM * arm.reach),
        "close": ", ".join(number_text(STANDING_DISTANCE * unit) for unit in radian_or_reach(arm).tolist()),
        "slides": ", ".join(str(int(slides)) for slides in arm.prismatic.tolist()),
        "lowest": ", ".join(number_text(limit - SLACK) for limit in arm.lower.tolist()),
        "highest": ", ".join(number_text(limit + SLACK) for limit in arm.upper.tolist()),
        "position": str(task.position),
        "first": str(9 if task.orientation == "full" else 0),
        "farthest": number_text(_farthest_coordinate(arm)),
        "most": ", ".join(bounds),
        "axis": str(int(task.orientation == "axis")),
    }


def _can_judge_folds(arm: Arm, task: Task, geometry: Geometry) -> bool:
    """Whether parts/folds.c can judge branches on an edge: for closed forms that list all branches, and tasks with as
    many numbers as joints."""
    rows = 6 if task.orientation == "full" else task.position + len(task.sums)
    is_square = task.orientation != "axis" and rows == arm.n > 1
    return is_square and geometry.pairs is not None and not geometry.ends and geometry.doubts is None


def _fold_fields(arm: Arm, task: Task) -> dict[str, str]:
    """Values of the fields in parts/folds.c."""
    values = {
        "reach": arm.reach, "solution": SOLUTION, "closed": ROUNDING_RESIDUAL, "folded": FOLD_VALUE, "lost": WEAK,
        "seed": SEED_RESIDUAL, "close_by": CLOSE_DISTANCE, "smooth": SMOOTH_ERROR, "bent": FOLD_BEND, "wide": REACH,
        "way": FOLD_WAY,
        "series": second_order.MAX_DISTANCE, "tiny": TINY, "arrived": ARRIVED_STEP, "error": ERROR, "high": HIGH_ORDER,
        "shrink": local_structure.SHRINK, "bend": local_structure.BEND, "moved": MOVED,
        "same": ROUNDING_DISTANCE, "turned": STILL_TURN, "drift": DRIFT,
        "nearer": local_structure.USED_SHARE, "shorter": local_structure.FAILED_RATIO,
        "longest": local_structure.MAX_RATIO,
    }  # fmt: skip
    fields = {name: number_text(value) for name, value in values.items()}
    fields["motions"] = str(int(not arm.keep_out))  # with keep-outs, Python searches a self-motion for a free posture
    fields |= {"back": str(second_order.BACK), "full": str(int(task.orientation == "full"))}
    fields |= {"iterations": str(local_structure.ITERATIONS), "shrinks": str(local_structure.SHRINKS)}
    fields |= {"fine": str(len(local_structure.FINE_GRID)), "points_count": str(len(local_structure.POINTS))}
    tables = {"points": local_structure.POINTS, "last": local_structure.TO_LAST}
    sides = local_structure.BOTH_WAYS, local_structure.ONE_WAY
    tables |= {"nodes": np.stack([side.node for side in sides]), "fit": np.stack([side.to_powers for side in sides])}
    tables["gains"] = np.array([side.gain for side in sides])
    fields |= {
        name: ", ".join(number_text(float(number)) for number in table.ravel()) for name, table in tables.items()
    }
    fields |= {
        "nodes_count": str(local_structure.NODES),
        "links": str(chains.LINKS),
        "few_links": str(chains.FEW_LINKS),
        "along": str(self_motions.LINE_JOINTS),
    }
    sums = [[*row, offset] for row, offset in zip(task.sums.tolist(), task.offsets.tolist(), strict=True)]
    fields["weights"] = ", ".join("{" + ", ".join(map(number_text, row)) + "}" for row in sums)
    fields["sums"] = str(len(sums))
    return fields | {"unit": ", ".join(number_text(unit) for unit in radian_or_reach(arm).tolist())}


def _farthest_coordinate(arm: Arm) -> float:
    """Greatest allowed coordinate [mm]; with slides, targets are at most `FAR_DISTANCE` reaches away."""
    if not arm.prismatic.any():
        return MAX_TARGET
    return max((FAR_DISTANCE * arm.reach - math.hypot(*arm.link[0][:3, 3])) / 2, 0.0)


def _joint_loop(content: str, formula: str, size: int) -> str:
    """A loop over a batch of joint values."""
    return c_program.fill_fields(own_part("joint_batches"), {"what": content, "formula": formula, "size": str(size)})


def _fast_numbers() -> str:
    """The settings of double precision, with faster tan and atan2."""
    numbers = part_text("numbers_double")
    return numbers.partition("#ifndef ARM_TAN")[0] + part_text("fast_numbers")


def _choose_code(arm: Arm, branches: int) -> str:
    """`arm_choose`, which moves joints to their nearest legal copies and tells which branches are within limits."""
    loops = []
    for joint in range(arm.n):
        lower, upper = (number_text(float(limit[joint])) for limit in (arm.lower, arm.upper))
        value = f"q[(b * {arm.n} + {joint}) * ARM_LANES + i]"
        near_value = f"near[{joint} * ARM_LANES + i]"
        if arm.prismatic[joint]:
            loops.append(
                _in_every_lane(f"in[i] &= ({value} >= {lower} - ARM_SLACK) & ({value} <= {upper} + ARM_SLACK);")
            )
            continue
        copied = _in_every_lane(f"{value} = arm_copy({value}, {near_value}, {lower}, {upper}, &in[i]);")
        if arm.lower[joint] >= -math.pi and arm.upper[joint] <= math.pi:
            loops.append(copied)
            continue
        # usually all values within half a turn of `near` are legal, and so is the nearest copy
        nearest = _in_every_lane(f"{value} = arm_nearest({value}, {near_value});")
        positive = _in_every_lane(f"{value} = arm_principal({value});")
        range_test = f"arm_wide(near + {joint} * ARM_LANES, {lower}, {upper}, count)"
        choices = zip(("if (wide == 0)", "else if (wide == 1)", "else"), (copied, nearest, positive), strict=True)
        loops.append(f"wide = {range_test};\n" + " ".join(f"{condition} {{\n{loop}\n}}" for condition, loop in choices))
    body = "\n".join(f"        {line}" for line in "\n".join(loops).splitlines())
    return f"""{own_part("half_turn_in_limits")}
static void arm_choose(const double *ARM_RESTRICT near, double *ARM_RESTRICT q, int *ARM_RESTRICT inside,
    int count)
{{
    int i, b, wide;
    (void)wide;
    for (b = 0; b < {branches}; b++) {{
        int *ARM_RESTRICT in = inside + b * ARM_LANES;
        for (i = 0; i < count; i++)
            in[i] = 1;
{body}
    }}
}}
"""


def _in_every_lane(line: str) -> str:
    return f"for (i = 0; i < count; i++)\n    {line}"
