"""The general elimination as C: the method is the same for all arms (`_METHOD`), and its constants are data.

`armkin.inverse.elimination.method` explains the method and why it is complete.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from armkin.export.c.source_parts import part_text
from armkin.export.elimination_data import PASSES, frame_rows, moves_of, pencil_arrays, pencils_of, plans_of
from armkin.formula import c_and_js_code, recording
from armkin.inverse.closed.subproblems import Pair
from armkin.inverse.elimination.merge import weights
from armkin.inverse.elimination.method import Elimination
from armkin.inverse.elimination.passes import REGULAR, TILT
from armkin.inverse.elimination.roots import STEADY_ENTRY
from armkin.inverse.numeric import tolerances
from armkin.inverse.numeric.tolerances import BESIDE_SPECIAL, SHAKES
from armkin.inverse.solvers import tool_axis
from armkin.inverse.solvers.choose_redundant_joint import move_entries
from armkin.model.rotation import inverse

if TYPE_CHECKING:
    from armkin.inverse.elimination.closed_loop import Loop
    from armkin.inverse.elimination.pencil import Pencil
    from armkin.inverse.solvers.choose_redundant_joint import Redundancy
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm

# each part needs the previous ones
_METHOD = ("linear_algebra", "turns", "line_features", "end_joints", "roots", "equal_roots", "polish", "elimination")
_NAMED = {  # numbers of the method, by their names in Python
    name: getattr(tolerances, name)
    for name in (
        "BLURRED_ROOT", "CLOSE_RESIDUAL", "DOUBLE_VALUE", "ELIMINATED", "EQUAL_ROOTS", "EXAMINED_DISTANCE", "GRAZING",
        "ILL_INVERSE", "INFINITE_SLIDE", "LONE_DISTANCE", "NO_PRODUCT", "OWN_ROOT", "PAIRED_PART", "SAME_KEY",
        "SAME_ROOT", "STRAY_DISTANCE", "TWIN_ROOTS", "UPRIGHT",
    )
}  # fmt: skip
ACCEPTED = 1e-18  # bound of the squared residual of answers of the C code


def candidates_code(
    arm: Arm,
    task: Task,
    elimination: Elimination,
    passes: int = PASSES,
    lanes: str = "",
    redundant: Redundancy | None = None,
) -> str:
    """`arm_candidates` for an arm that the elimination solves, with its data and functions.

    lanes: C code in which `arm_first_pass` solves several poses together, for processors with vectors and arms without
    slides. redundant: its joint is held at its value in near; the elimination is that of the others.
    """
    kinds = plans_of(elimination, passes)
    pencils, numbers_of = pencils_of(kinds)
    loop, passes = elimination.loop, len(kinds[0])
    lines = [
        *_definitions(loop.length, arm.reach, _array_sizes(pencils, passes)),
        "",
        *_chain_arrays(loop, task, passes),
        "",
        *(_pencil_code(k, pencil) for k, pencil in enumerate(pencils)),
        f"static const arm_pencil arm_pencils[] = {{{', '.join(f'ARM_PENCIL_{k}' for k in range(len(pencils)))}}};",
        _flags_code("plan", [number for plan in numbers_of for number in plan]),
        "",
    ]
    first = part_text("first_pass")
    if lanes and not loop.prismatic.any():
        first = f"#ifdef ARM_MANY\n{lanes}#else\n{first}#endif\n"
    text = part_text("pencil") + "\n".join(lines) + "\n" + "".join(map(part_text, _METHOD)) + first
    text += part_text("candidates")
    if task.orientation == "axis":
        text = text.replace("arm_candidates", "arm_six_candidates") + _with_virtual_joint()
    if redundant is not None:
        text = text.replace("ARM_JOINTS", str(arm.n - 1)).replace("arm_candidates", "arm_other_candidates")
        text += _with_held_joint(arm, redundant)
    return text


def _definitions(length: float, reach: float, array_sizes: dict[str, int]) -> list[str]:
    """The lines that define array sizes and numbers of the method; length: the unit of the loop [mm]."""
    numbers = {"LENGTH": length, "RESIDUAL": (length / reach) ** 2, "BESIDE": BESIDE_SPECIAL, **_NAMED}
    numbers |= {"MAIN_TILT": TILT[0], "LATER_TILT": TILT[1], "REGULAR": REGULAR, "STEADY": STEADY_ENTRY}
    texts = {name: str(size) for name, size in array_sizes.items()}
    texts |= {name: c_and_js_code.number_text(value) for name, value in numbers.items()}
    return [f"#define ARM_{name} {text}" for name, text in texts.items()]


def _chain_arrays(loop: Loop, task: Task, passes: int) -> list[str]:
    """The arrays of the loop's frames, the weights of residuals, and the motion of the pose in each pass."""
    return [
        "/* The chain, lengths in ARM_LENGTH, its frames moved along the axes to where the links are short. */",
        _array_code("from_base", frame_rows(inverse(loop.base))),
        _array_code("from_tool", frame_rows(inverse(loop.tool))),
        _array_code("loop_links", np.concatenate([frame_rows(link) for link in loop.links])),
        _flags_code("loop_slides", loop.prismatic),
        _array_code("weights", weights(5 if task.orientation == "axis" else 6)),
        _array_code("shakes", SHAKES[:passes]),
        _array_code("shaking", np.concatenate(moves_of(passes))),
    ]


def _array_sizes(pencils: list[Pencil], passes: int) -> dict[str, int]:
    """Sizes of arrays of the method."""
    return {
        "PASSES": passes,
        "PRODUCTS": max(pencil.products for pencil in pencils),
        "WIDTH": max((4 if pencil.role.wide else 2) * (pencil.products + pencil.size) for pencil in pencils),
        "MOST": max(16, *(-(-pencil.size // 4) * 4 for pencil in pencils)),  # rows are processed in groups of four
        "ROWS": max(15 - pencil.ends.rank for pencil in pencils),
        "ANSWERS": passes * max(pencil.size for pencil in pencils),
    }


def _pencil_code(number: int, pencil: Pencil) -> str:
    """The arrays of a pencil, and the macro that initialises its struct."""
    slot, ends, arrays = pencil.role.slot, pencil.ends, pencil_arrays(pencil)
    texts = [_array_code(f"{name}_{number}", values) for name, values in arrays.items() if values is not None]
    role = pencil.role
    sizes = (15 - ends.rank, pencil.K_re.shape[1], pencil.W.shape[1], pencil.size)
    numbers = (slot, int(role.backward), role.hidden, role.dialytic, int(role.wide), *sizes)
    fields = [
        c_and_js_code.number_text(float(pencil.psi)),
        *map(str, numbers),
        f"{{{', '.join(map(str, role.order))}}}",
        f"{{{', '.join(str(int(flag)) for flag in pencil.prismatic)}}}",
        *(f"arm_{name}_{number}" if values is not None else "0" for name, values in arrays.items()),
    ]
    return "\n".join([*texts, f"#define ARM_PENCIL_{number} {{{', '.join(fields)}}}", ""])


def _with_virtual_joint() -> str:
    """`arm_candidates` of five joints and the tool's axis, through the pose of `solvers.tool_axis`."""
    inputs = [f"axis[{k} * ARM_LANES + i]" for k in range(6)]
    code = c_and_js_code.write_code(recording.record(tool_axis.pose_of, 6), inputs)
    lines = [*code.lines, *(f"goal[{k} * ARM_LANES + i] = {text[0]};" for k, text in enumerate(code.outputs))]
    return part_text("virtual_joint").replace("@lines@", "\n        ".join(lines))


def _with_held_joint(arm: Arm, redundant: Redundancy) -> str:
    """`arm_candidates` of an arm whose redundant joint is held at its value in near."""
    size = 12 if redundant.task.orientation == "full" else len(redundant.task.labels)
    inputs = [f"goal[{k} * ARM_LANES + i]" for k in range(size)]
    held_value = f"near[{redundant.joint} * ARM_LANES + i]"
    inputs += [f"ARM_COS({held_value})", f"ARM_SIN({held_value})"]
    recorded = recording.record(lambda x: move_entries(arm, redundant, x[:size], Pair(*x[size:])), len(inputs))
    code = c_and_js_code.write_code(recorded, inputs)
    lines = [*code.lines, *(f"others[{k} * ARM_LANES + i] = {text[0]};" for k, text in enumerate(code.outputs))]
    text = part_text("held_joint").replace("@lines@", "\n        ".join(lines))
    return text.replace("@held@", str(redundant.joint)).replace("@others@", str(arm.n - 1)).replace("@goal@", str(size))


def _array_code(name: str, values: ArrayLike) -> str:
    texts = [c_and_js_code.number_text(float(value)) for value in np.asarray(values, dtype=float).ravel()]
    rows = [", ".join(texts[k : k + 5]) for k in range(0, len(texts), 5)]
    return f"static const double arm_{name}[{len(texts)}] = {{\n    " + ",\n    ".join(rows) + "};"


def _flags_code(name: str, values: Iterable[int]) -> str:
    numbers = [str(int(flag)) for flag in values]
    return f"static const unsigned char arm_{name}[{len(numbers)}] = {{{', '.join(numbers)}}};"
