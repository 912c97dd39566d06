"""Keep-outs in C: a formula of the arm's segments, tables of pairs and obstacles, and the loops over both."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from armkin.export.c import c_functions
from armkin.export.c.source_parts import part_text
from armkin.export.keep_out_pairs import pair_tables
from armkin.formula.c_and_js_code import number_text
from armkin.keep_out.bodies import ends_formula
from armkin.keep_out.body_pairs import guard

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_NUMBERS = 15  # numbers of the largest shape


def clearances_code(arm: Arm, single: bool = False) -> str:
    """`arm_least`, the least clearance and its pair for the ends of segments from `arm_ends`."""
    tables = pair_tables(arm)

    def initialiser(values: Iterable[float]) -> str:
        return ", ".join(number_text(float(value), single) for value in values)

    rows = [initialiser([*values, *[0.0] * (_NUMBERS - len(values))]) for _, values in tables.shapes]
    crossings = [f"{{{i}, {j}, {k}}}" for i, j, k in tables.crossings]
    fields = {
        "segments": str(len(tables.thick)),
        "moving_count": str(len(tables.moving)),
        "obstacle_count": str(len(tables.shapes)),
        "crossing_count": str(len(crossings)),
        "solid": str(tables.solid),
        "thick": initialiser(tables.thick),
        "moving": ", ".join(str(k) for pair in tables.moving for k in pair) or "0",
        "kinds": ", ".join(str(kind) for kind, _ in tables.shapes) or "0",
        "obstacles": ",\n    ".join(f"{{{row}}}" for row in rows) or "{0}",
        "crossings": ", ".join(crossings) or "{0}",
        "clearance": number_text(arm.clearance, single),
    }
    text = part_text("keep_out")
    for name, value in fields.items():
        text = text.replace(f"@{name}@", value)
    return c_functions.joint_function_code(arm, "arm_ends", ends_formula, "e", single) + text


def free_code(arm: Arm) -> str:
    """`arm_free`, and the names of pairs."""
    names = pair_tables(arm).pairs or [("", "")]
    pairs = ",\n    ".join("{" + ", ".join(f'"{_quoted_name(name)}"' for name in pair) + "}" for pair in names)
    return part_text("free_posture").replace("@pairs@", pairs)


def _quoted_name(name: str) -> str:
    """A name escaped for a C string."""
    ascii_name = name.encode("ascii", "replace").decode()
    return ascii_name.replace("\\", "\\\\").replace('"', '\\"').replace("??", "?\\?")


def declarations(arm: Arm) -> str:
    """The lines of the header."""
    count = max(len(guard(arm).pairs), 1)
    return f"""
/* Whether joint values hit none of the keep-outs of the robot file and its scene. clearance: how far the nearest pair
   is from being hit [mm], negative: a hit; pair: its index into arm_pairs, -1: nothing counts. Both may be null. */
int arm_free(const arm_real *q, arm_real *clearance, int *pair);

extern const char *const arm_pairs[{count}][2]; /* a body, and what it is held against */
"""
