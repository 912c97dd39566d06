"""The C file that traces the families of a seven-joint arm whose other joints nearly have a closed form."""

from __future__ import annotations

import hashlib
import re
from typing import TYPE_CHECKING, Any

from armkin import forward
from armkin.compiled.own_parts import own_part
from armkin.export import arm_formulas
from armkin.export.c import c_program
from armkin.export.c.source_parts import part_text
from armkin.formula import c_and_js_code, recording
from armkin.formula.c_and_js_code import number_text
from armkin.inverse.closed.candidates import recorded_formula
from armkin.inverse.closed.subproblems import Pair
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant import curve_points, curve_starts, traced_curves, traced_families
from armkin.inverse.solvers.choose_redundant_joint import Redundancy, move_entries
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.model.rotation import SMALL_TURN

if TYPE_CHECKING:
    from armkin.model.arm import Arm

LEVEL = 3  # of optimisation: it unrolls loops over rows of matrices
CORRECTIONS = 6  # steps of `newton.correct` by default
SWEEPS = 8  # sweeps of Jacobi rotations, which converge quadratically
_CURVES = ("curve_points", "curve_starts", "curve_joins", "curve_rays")
_PIECES = ("curve_samples", "curves_checked", "curve_changes", "curve_pieces", "curve_nearest")

# C on vectors `arm_many`, one number a lane; comparisons are masks
_MASKS = {op: f"(arm_flags)({{}} {sign} {{}})" for op, sign in
          {"less": "<", "less_equal": "<=", "greater": ">", "greater_equal": ">=", "equal": "=="}.items()}  # fmt: skip
_LANES = c_and_js_code.C.operations | _MASKS | {
    "absolute": "arm_size({})",
    "sqrt": "arm_roots({})",
    "cbrt": "arm_cube_roots({})",
    "tan": "arm_tangents({})",
    "arctan2": "arm_angle_lanes({}, {})",
    "rint": "arm_whole({})",
    "sign": "arm_signs({})",
    "copysign": "arm_signed({}, {})",
    "where": "arm_pick({}, {}, {})",
    "maximum": "arm_pick((arm_flags)({1} > {0}), {1}, {0})",
    "minimum": "arm_pick((arm_flags)({1} < {0}), {1}, {0})",
}  # fmt: skip
LANES = c_and_js_code.Language(
    _LANES, "const arm_many", "const arm_flags", lambda value: f"arm_all({number_text(value)})"
)


def library(arm: Arm, redundant: Redundancy, guide: Redundancy) -> tuple[str, str]:
    """The C file and its content's sha256, also in the file as `arm_content`."""
    branches, candidates = _candidates_code(arm, guide)
    settings = _settings(arm, (guide.joint, redundant.joint, other_joint(guide)), branches)
    parts = [own_part("head"), c_program.settings(), part_text("numbers_double"), part_text("whole_turns")]
    parts += ["#ifdef ARM_MANY", own_part("lanes"), own_part("lanes_functions"), *_formulas(arm), candidates]
    parts += [settings, *map(own_part, _CURVES + _PIECES), "#endif", own_part("traced_families")]
    fields = {
        "about": f"{c_program.identifier(arm.name)}: built for this computer by armkin.compile.",
        "joints": str(arm.n),
        "lower": ", ".join(map(number_text, arm.lower.tolist())),
        "upper": ", ".join(map(number_text, arm.upper.tolist())),
        "values": ", ".join(map(number_text, curve_starts.VALUES)),
        "content": "@content@",
    }
    text = c_program.fill_fields("\n".join(parts), fields)
    content = hashlib.sha256(text.encode()).hexdigest()
    return text.replace("@content@", content), content


def other_joint(guide: Redundancy) -> int:
    """The joint between shoulder and elbow, which is held where an answer may be on no curve: as `curve_starts`."""
    return 2 if guide.joint == 0 else 4


def _settings(arm: Arm, joints: tuple[int, int, int], branches: int) -> str:
    """The constants of the tracing, those of numpy's; joints: the guide's, the redundant one, and `other_joint`."""
    counts = dict(zip(("GUIDE", "REDUNDANT", "OTHER"), joints, strict=True)) | {
        "BRANCHES": branches,
        "PLANES": curve_starts.PLANES, "WAY_PARTS": curve_starts.WAY_PARTS, "NEWTON": curve_points.NEWTON,
        "HALVINGS": traced_curves.HALVINGS, "TRIES": traced_curves.TRIES, "ROUNDS": traced_curves.ROUNDS,
        "TRACES": traced_curves.TRACES,
        "PARTS": traced_families.PARTS, "SECANTS": traced_families.SECANTS, "TURNS": traced_families.TURNS,
        "LAST": traced_families.LAST, "STEPS": traced_families.STEPS, "CROSSING_SECANTS": curve_starts.SECANTS,
        "CORRECTIONS": CORRECTIONS, "SWEEPS": SWEEPS,
    }  # fmt: skip
    numbers = {
        "REACH_LENGTH": arm.reach, "SMALL_TURN": SMALL_TURN, "TINY": tol.TINY, "NEWTON_STEP": curve_points.MAX_STEP,
        "MID_MISS": tol.MID_MISS, "SAME_SEED": tol.SAME_SEED, "PAIR_STEP": tol.PAIR_STEP, "REACH": tol.REACH,
        "NEAR_DEFECT": tol.NEAR_DEFECT, "ACCEPTED_DEFECT": tol.ACCEPTED, "ARC_LENGTH": traced_curves.ARC_LENGTH,
        "RAY_STEP": traced_curves.MAX_STEP, "STEP_SHARE": traced_curves.STEP_SHARE, "TOUCHING": tol.TOUCHING_STEP,
        "SIDE_SHARE": traced_curves.SIDE_SHARE, "WAY": traced_families.WAY,
        "SHORTEST_ARC": tol.SHORTEST_ARC, "ON_CURVE": curve_starts.ON_CURVE, "PROBE_SHARE": tol.PROBE_SHARE,
        "ROUNDING": tol.ROUNDING, "CONVERGING": tol.CONVERGING, "LEFT_OUT_VALUE": tol.LEFT_OUT_VALUE,
    }  # fmt: skip
    lines = [f"#define ARM_{name} {value}" for name, value in counts.items()]
    lines += [f"#define ARM_{name} {number_text(value)}" for name, value in numbers.items()]
    return "\n".join([*lines, ""])


def _formulas(arm: Arm) -> list[str]:
    """`arm_tip_lanes`, the tool's pose row by row, and `arm_slope_lanes`, the Jacobian too, of cosines and sines."""
    inputs = [text for j in range(arm.n) for text in (f"c[{j}]", f"s[{j}]")]

    def code(formula: forward.Formula, first: int) -> tuple[list[str], list[str]]:
        recorded = recording.record(lambda x: formula(arm, list(zip(x[::2], x[1::2], strict=True))), 2 * arm.n)
        written = c_and_js_code.write_code(recorded, inputs, LANES)
        texts = [text[0] for text in written.outputs]
        stores = [f"T[{k}] = {text};" for k, text in enumerate(texts[:12])]
        return written.lines, stores + [f"J[{k}] = {text};" for k, text in enumerate(texts[first:])]

    head = "(const arm_many *c, const arm_many *s, arm_many *T"
    tip = _function(f"static void arm_tip_lanes{head})", *code(forward.tip_formula, 16))
    return [tip, _function(f"static void arm_slope_lanes{head}, arm_many *J)", *code(forward.pose_and_jacobian, 16))]


def _candidates_code(arm: Arm, guide: Redundancy) -> tuple[int, str]:
    """`arm_guide_lanes`: branches of the nearly equal arm at values of the guide's joint, what they miss squared."""
    rest_form = recorded_formula(guide.rest, solver(guide.rest, guide.task.name)[0], guide.geometry)

    def formula(x: list[Any]) -> list[Any]:
        return rest_form.candidates(move_entries(arm, guide, x[:12], Pair(x[12], x[13])), [None] * guide.rest.n)[:-2]

    recorded = recording.record(formula, 14)
    written = c_and_js_code.write_code(recorded, [*(f"g{k}" for k in range(12)), "c", "s"], LANES)
    *values, misses = arm_formulas.by_branch(recorded, written)
    others = [j for j in range(arm.n) if j != guide.joint]
    stores = [
        f"q[{b * arm.n + j}] = {text};" for j, texts in zip(others, values, strict=True) for b, text in enumerate(texts)
    ]
    stores += [f"miss[{b}] = {text};" for b, text in enumerate(misses)]
    read = set(re.findall(r"\bg\d+\b", "\n".join(written.lines)))
    inputs = [f"const arm_many g{k} = arm_all(goal[{k}]);" for k in range(12) if f"g{k}" in read]
    head = "static void arm_guide_lanes(const double *goal, arm_many c, arm_many s, arm_many *q, arm_many *miss)"
    return len(misses), _function(head, [*inputs, *written.lines], stores)


def _function(head: str, lines: list[str], stores: list[str]) -> str:
    body = "\n".join(f"    {line}" for line in [*lines, *stores])
    return f"{head}\n{{\n{body}\n}}\n"
