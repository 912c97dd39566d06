"""A robot file written from a DH table: complete as far as the table goes, the rest as comments to fill in."""

from collections.abc import Sequence
from dataclasses import dataclass

from armkin.robot_file.robot_file_text import number_text, scalar_text


@dataclass(frozen=True)
class Row:
    """One row of a table: degrees and mm."""

    name: str
    alpha: float
    a: float
    d: float
    theta: float = 0.0
    prismatic: bool = False
    limits: tuple[float, float] | None = None
    home: float = 0.0


_HEAD = {
    "standard": "standard DH: each row is Rz(theta) Tz(d) Tx(a) Rx(alpha)",
    "modified": "modified DH (Craig): each row is Rx(alpha) Tx(a) Rz(theta) Tz(d), alpha and a of the link before",
}

_KEEP_OUT = """# Where the arm must not go, in mm: self, floors, boxes, capsules; clearance: how far to keep away.
# How thick the arm is: `body: {radius: 40}` at a joint, and `base: {body: {radius: 60}}`; absent: 2 % of its reach.
# clearance: 5"""

_AXES = ("X", "Y", "Z", "A", "E0", "E1")  # an example for each drive

_TAIL = """
# A fixed frame before joint 1 and one after the last joint (the tool's tip), in mm and degrees.
# base: {xyz: [0, 0, 0], rpy: [0, 0, 0]}
# tool: {xyz: [0, 0, 0], rpy: [0, 0, 0]}

# What `armkin ik` solves for. Without it the structure decides; `armkin info` shows the choice.
# task: xyz

# Joint values by name: `armkin fk FILE park`.
# poses: {park: [%(home)s]}

%(keep_out)s

# For `armkin send`: the board. (`armkin schema` lists every key; examples/every_key.yaml in armkin's sources shows
# them all: limit switches for `armkin home`, servos, motors that turn several joints.)
# board: {kind: uno_cnc_shield, driver: A4988}
# gripper: {kind: servo, axis: S0, travel: [0, 180], pulse_us: [500, 2500], open: 30, closed: 120}
"""


def new_file_text(name: str, convention: str, rows: Sequence[Row], source: str = "", floor: float | None = None) -> str:
    """The file of a table.

    name, source: as the file shall say; convention: standard or modified; floor: z that the arm may not go below.
    """
    lines = [
        "# Millimetres and degrees throughout. `armkin info` prints the table as papers do: compare it line by line.",
        f"name: {scalar_text(name)}",
        f"source: {scalar_text(source)}" if source else "# source: where the numbers come from",
        f"convention: {convention}   # {_HEAD[convention]}",
        "joints:",
    ]
    for i, row in enumerate(rows):
        lines += _joint_lines(row, _AXES[i % len(_AXES)], with_comments=i == 0)
    entry = "# keep_out: [self, floor: 0]" if floor is None else f"keep_out: [floor: {_number_text(floor)}]"
    fields = {"home": ", ".join(_number_text(row.home) for row in rows), "keep_out": f"{_KEEP_OUT}\n{entry}"}
    return "\n".join(lines) + "\n" + _TAIL % fields


def _joint_lines(row: Row, axis: str, *, with_comments: bool) -> list[str]:
    """A joint's lines in a new robot file; keys that its row says nothing of are comments."""
    unit = "mm" if row.prismatic else "deg"
    dh = ", ".join(f"{key}: {_number_text(getattr(row, key))}" for key in ("alpha", "a", "d", "theta"))
    lower, upper = row.limits or (-90.0, 90.0)
    lead = ", lead: 8" if row.prismatic else ""
    entries = [
        ("type: prismatic", "its value is added to d", row.prismatic),
        (f"dh: {{{dh}}}", "theta, d: the constant part; the joint's value is added", True),
        (
            f"limits: [{_number_text(lower)}, {_number_text(upper)}]",
            f"{unit}; absent: unlimited",
            row.limits is not None,
        ),
        (f"home: {_number_text(row.home)}", "pulses are counted from here", True),
        ("sign: -1", "if the joint counts against its row", False),
        ("max_speed: 60", f"{unit}/s, for send", False),
        ("max_accel: 120", f"{unit}/s2, for send", False),
        ("body: {radius: 40}", "mm, for keep_out", False),
        (f"drive: {{axis: {axis}, full_steps: 200, microsteps: 16, gear: 1{lead}}}", "for pulses and send", False),
    ]
    lines = [f"  - name: {row.name}"]
    for entry, comment, active in entries:
        if active:
            lines.append(f"    {entry}" + (f"   # {comment}" if with_comments else ""))
        elif entry != "type: prismatic":
            lines.append(f"    # {entry}" + (f"   # {comment}" if with_comments else ""))
    return lines


def _number_text(value: float) -> str:
    """A number with at most ten digits, as people write it."""
    return number_text(float(f"{value:.10g}"))
