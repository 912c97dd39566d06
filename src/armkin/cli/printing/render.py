"""Results as text: JSON for programs, aligned columns for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from armkin.cli.printing import output
from armkin.model import units

if TYPE_CHECKING:
    from armkin.cli.answers import Head, Violation
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm

_TERMINAL_COLUMNS = 80  # columns of a terminal that does not tell its own


def head(arm: Arm) -> Head:
    """What every JSON object begins with: the robot, its file as given and the file's hash; the scene's, too."""
    answer: Head = {"robot": arm.name, "robot_file": arm.path, "robot_sha256": arm.sha256}
    answer.update(scene_and_tool(arm))
    return answer


def scene_and_tool(arm: Arm) -> Any:
    """The keys of an answer that was made in a scene, or with another tool than the robot file's; none without."""
    answer: dict[str, Any] = {"scene": arm.scene, "scene_sha256": arm.scene_sha256} if arm.scene else {}
    if arm.tool is not None:
        answer["tool"] = {"xyz": list(arm.tool[:3]), "rpy": list(arm.tool[3:])}
    return answer


def violations(arm: Arm, values: Array, q: Array) -> list[list[Violation]]:
    """For each row, the joints outside their limits: values (N, n) [deg | mm], q the same in [rad | mm]."""
    from armkin.model.limits import outside_limits

    return [
        [violation(arm, i, row[i]) for i, is_outside in enumerate(flags) if is_outside] if any(flags) else []
        for row, flags in zip(values.tolist(), outside_limits(arm, q).tolist(), strict=True)
    ]


def near_by(arm: Arm, q: Array) -> list[Any]:
    """What each posture (N, n) [rad | mm] is near to, for JSON; nothing without keep-outs."""
    if not arm.keep_out:
        return [{}] * len(q)
    from armkin.keep_out.clearance import hits

    return [{"clearance_mm": distance, "hits": hit} for distance, hit in hits(arm, q)]


def hits_in_words(answer: Mapping[str, Any]) -> str:
    """Hits in words: ``hits table by 12.3 mm (q3)``; nothing where there are none."""
    if not answer.get("hits"):
        return ""
    from armkin.keep_out.clearance import hits_text

    return hits_text(answer["hits"])


def violation(arm: Arm, joint: int, value: float) -> Violation:
    """A joint outside its limits, for JSON; value: [deg | mm]."""
    lower, upper = map(units.finite_or_none, units.limits_out(arm)[joint])
    return {"joint": arm.joint_names[joint], "value": value, "lower": lower, "upper": upper}


def violation_text(arm: Arm, violation: Violation) -> str:
    """One violation in words: ``q2 = 130 deg is outside -20 to 120 deg``."""
    from armkin.model import limits

    joint = arm.joint_names.index(violation["joint"])
    return limits.outside_text(arm, joint, violation["value"] * (1.0 if arm.prismatic[joint] else units.DEGREE))


def to_json(value: Any) -> str:
    """One line of JSON; NaN or infinity in it is a bug and raises ValueError."""
    import json

    return json.dumps(value, allow_nan=False)


def fixed_text(value: float, digits: int = 4) -> str:
    """A number for people: fixed decimals, and never -0.0000.

    >>> fixed_text(-0.00001), fixed_text(398.39234)
    ('0.0000', '398.3923')
    """
    text = f"{value:.{digits}f}"
    return text[1:] if text.startswith("-") and not text.strip("-0.") else text


def short_text(value: float) -> str:
    """A number as a file's author would write it: no needless zeros, at most ten digits."""
    return f"{value:.10g}" if value else "0"


def table(rows: Sequence[Sequence[str]], left_aligned: Sequence[int] = (0,), indent: str = "  ") -> str:
    """Aligned columns, two spaces apart; left_aligned: columns that align left, the others right.

    >>> print(table([["", "x", "y"], ["elbow", "110.053", "7.5"]]))
                 x    y
      elbow  110.053  7.5
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [
            cell.ljust(width) if i in left_aligned else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append((indent + "  ".join(cells)).rstrip())
    return "\n".join(lines)


def row(title: str, names: Sequence[str], values: Sequence[str]) -> str:
    """Values below their names, or beside them where that would be wider than a terminal.

    >>> print(row("tool", ["x/mm", "y/mm"], ["110.053", "7.5"]))
               x/mm  y/mm
      tool  110.053   7.5
    """
    wide_table = table([["", *names], [title, *values]])
    fits_terminal = max(map(len, wide_table.splitlines())) <= _TERMINAL_COLUMNS
    return wide_table if fits_terminal else table([[title, ""], *zip(names, values, strict=True)])


def pose_line(arm: Arm, values: Sequence[float]) -> str:
    """The arm and its joint values on one line: ``three_dof: q1 = -30, q2 = 5, q3 = -5 deg``."""
    return f"{arm.name}: {label_values(arm.joint_names, values, units.unit_names(arm))}"


def wrap_text(text: str, first: str = "", indent: str = "") -> str:
    """Running text in lines of a page's width; first, indent: what the first and the other lines begin with."""
    from textwrap import fill

    return fill(" ".join(text.split()), 90, initial_indent=first, subsequent_indent=indent)


def label_values(names: Sequence[str], values: Sequence[float], each_unit: Sequence[str]) -> str:
    """``x = 390, y = 80, z = 300 mm``: a unit where the next number's differs."""
    parts = []
    for i, (name, value, unit) in enumerate(zip(names, values, each_unit, strict=True)):
        is_last = i + 1 == len(names) or each_unit[i + 1] != unit
        parts.append(f"{name} = {short_text(value)}" + (f" {unit}" if is_last and unit else ""))
    return ", ".join(parts)


def joint_headings(arm: Arm) -> list[str]:
    """Column headings of joint values: ``q1/deg``."""
    return [f"{name}/{unit}" for name, unit in zip(arm.joint_names, units.unit_names(arm), strict=True)]


def warn_of_limits(arm: Arm, violations: list[Violation], near: Mapping[str, Any] | None = None) -> None:
    """Say which joints of a pose are outside their limits, and what it hits."""
    if violations:
        output.warn("; ".join(violation_text(arm, violation) for violation in violations))
    if near is not None and (words := hits_in_words(near)):
        output.warn(f"this pose {words}")
