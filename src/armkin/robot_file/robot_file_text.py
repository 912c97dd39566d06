"""Robot files as text: what `read_robot_file` reads back to the last bit.

Numbers are written without exponents (``1e-05`` is text to YAML 1.1) and with all their digits; a pose is
written as xyz and roll, pitch, yaw from which its matrix comes back to rounding.
"""

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from decimal import Decimal
from typing import Any

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]*")
_UNFIT = re.compile("[^\t\n\x20-\x7e\xa0-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]")  # no YAML text
_WORDS = {"y", "n", "yes", "no", "on", "off", "true", "false", "null", "none", "nan", "inf"}


def number_text(value: float) -> str:
    """The shortest decimal number that reads back as this float, without an exponent.

    >>> number_text(1e-05), number_text(90.0), number_text(-0.0)
    ('0.00001', '90', '0')
    """
    if value == 0:
        return "0"
    text = format(Decimal(repr(float(value))), "f")
    return text.rstrip("0").rstrip(".") if "." in text else text


def format_robot_file(keys: Mapping[str, Any], comments: Iterable[str] = ()) -> str:
    """A robot file's text from its keys and values, comments first.

    >>> keys = {"name": "a", "joints": [{"name": "q1", "limits": (-90.0, 90.0)}]}
    >>> print(format_robot_file(keys, ["made by hand"]), end="")
    # made by hand
    name: a
    joints:
      - name: q1
        limits: [-90, 90]
    """
    lines = [f"# {line}" for comment in comments for line in _UNFIT.sub("?", comment).splitlines()]
    for key, value in keys.items():
        if isinstance(value, Mapping) or not _is_list_of_mappings(value):
            lines.append(f"{key}: {flow_text(value)}")
            continue
        lines.append(f"{key}:")
        for item in value:
            entries = [f"{name}: {flow_text(content)}" for name, content in item.items()]
            lines += [f"  {'-' if i == 0 else ' '} {entry}" for i, entry in enumerate(entries)]
    return "\n".join(lines) + "\n"


def pose_keys(T: Sequence[Sequence[float]]) -> dict[str, list[float]]:
    """A rigid transform [mm] as ``{xyz, rpy}`` in mm and degrees; its rotation comes back to 1e-15.

    >>> pose_keys([[0, 0, 1, 5], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])
    {'xyz': [5.0, 0.0, 0.0], 'rpy': [0.0, 90.0, 0.0]}
    """
    position = [tidy(float(row[3]), 12) for row in list(T)[:3]]
    return {"xyz": position, "rpy": [tidy(math.degrees(a), 13) for a in rpy_angles(T)]}


def rpy_angles(T: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """Roll, pitch, yaw [rad] of a transform, R = Rz(yaw) Ry(pitch) Rx(roll), from which R comes back to 1e-15.

    The yaw is taken first and turned back, so that roll and pitch stay sharp where the pitch is a quarter turn.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, _, _) = ([float(e) for e in row[:3]] for row in list(T)[:3])
    # At a pitch of a quarter turn x's direction has no yaw; y's has, together with the roll, which becomes 0.
    upright = math.hypot(xx, yx) < 1e-15
    yaw = math.atan2(-xy, yy) if upright else math.atan2(yx, xx)
    c, s = math.cos(yaw), math.sin(yaw)
    pitch = math.atan2(-zx, c * xx + s * yx)
    roll = math.atan2(s * xz - c * yz, c * yy - s * xy)
    return roll + 0.0, pitch + 0.0, yaw + 0.0


def tidy(value: float, digits: int) -> float:
    """Rounded to so many decimals, and no negative zero."""
    return round(value, digits) + 0.0


def _is_list_of_mappings(value: Any) -> bool:
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(item, Mapping) for item in value)


def flow_text(value: Any) -> str:
    """A value in YAML's flow style, which reads back as the same value."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return number_text(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {flow_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(flow_text, value)) + "]"
    return scalar_text(str(value))


def scalar_text(word: str) -> str:
    """Text as YAML reads it back as text: in quotes if it looks like a number or a truth value."""
    return word if _PLAIN.fullmatch(word) and word.lower() not in _WORDS else json.dumps(word, ensure_ascii=False)
