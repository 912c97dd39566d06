"""Parses the replies of GRBL 1.1: status reports, settings, offsets, alarms and errors.

Source: the project's public interface description (github.com/gnea/grbl, doc/markdown/interface.md,
settings.md and the CSV tables of alarms and errors). grblHAL and FluidNC use the same.
"""

import re
from dataclasses import dataclass, field

STATUS, HOLD = b"?", b"!"  # these commands and the next two pass every queue
RESET, JOG_CANCEL = b"\x18", b"\x85"
PLAIN_FEED = b"\x90"  # command: no override of feeds
LETTERS = "XYZABC"
RX_BUFFER = 128  # size [bytes] of GRBL's buffer on an Uno; one stays free

ALARMS = {
    1: "a limit switch closed in motion",
    2: "the target is outside GRBL's own soft limits ($20)",
    3: "GRBL was reset in motion",
    4: "the probe was not in its starting state",
    5: "the probe did not touch",
    6: "homing was interrupted by a reset",
    7: "the door opened while homing",
    8: "homing could not leave the switch: lengthen the pull-off ($27)",
    9: "homing found no switch: wiring, direction ($23) or travel ($130) is wrong",
}
ERRORS = {
    1: "it expected a letter",
    2: "a number is malformed",
    3: "it knows no such $ command",
    5: "homing is not enabled ($22)",
    8: "a $ command needs an idle machine",
    9: "it is locked by an alarm",
    15: "the jog leaves its travel",
    20: "it does not support this command",
    22: "no feed rate",
    24: "two commands want the axis words",
    33: "the target is invalid",
    52: "the value is out of range, or no whole number",
}
LOSES_POSITION = {1, 3, 6, 7, 8, 9}  # alarms after which counted steps mean nothing

_NUMBER = r"-?[0-9]{1,9}(?:\.[0-9]{1,9})?"  # a number as GRBL prints it


@dataclass(frozen=True)
class Report:
    """One status report."""

    state: str  # Idle, Run, Hold, Jog, Alarm, Door, Check, Home, Sleep
    detail: int  # number behind Hold and Door: 0 when the machine stands
    position: tuple[float, ...] | None  # machine position
    free: tuple[int, int] | None  # planner blocks and receive bytes
    pins: str  # inputs that are active: limits X Y Z A B C, probe P, door D, hold H, reset R, start S
    # [%] that feeds are overridden by; only some reports hold it
    feed: int | None = field(default=None, compare=False)


def parse_report(line: str) -> Report | None:
    """A status report, or None if the line is none or damaged.

    >>> parse_report("<Hold:0|MPos:1.000,-2.500,0.000|Bf:15,128|Pn:X>").position
    (1.0, -2.5, 0.0)
    """
    if not (line.startswith("<") and line.endswith(">")):
        return None
    head, *fields = line[1:-1].split("|")
    state, _, detail = head.partition(":")
    field_of: dict[str, str] = dict(field.partition(":")[::2] for field in fields)
    try:
        position = _parse_values(field_of["MPos"]) if "MPos" in field_of else None
        free = [int(value) for value in _parse_values(field_of["Bf"])] if "Bf" in field_of else None
        room = (free[0], free[1]) if free else None
        feed = int(_parse_values(field_of["Ov"])[0]) if "Ov" in field_of else None
        return Report(
            state=state,
            detail=int(_parse_value(detail or "0")),
            position=position,
            free=room,
            pins=field_of.get("Pn", ""),
            feed=feed,
        )
    except (ValueError, IndexError):
        return None


def parse_setting(line: str) -> tuple[int, float] | None:
    """A line of ``$$``: number and value.

    >>> parse_setting("$100=44.444")
    (100, 44.444)
    """
    match = re.fullmatch(rf"\$(\d{{1,3}})=({_NUMBER})(?:\s.*)?", line)
    return (int(match[1]), float(match[2])) if match else None


def parse_offset(line: str) -> tuple[str, tuple[float, ...]] | None:
    """A line of ``$#``: name and values.

    >>> parse_offset("[G92:1000.000,0.000,0.000]")
    ('G92', (1000.0, 0.0, 0.0))
    """
    match = re.fullmatch(r"\[(G5[4-9]|G92|TLO):([-\d.,]+)(?::[-\d.]+)?\]", line)
    if match is None:
        return None
    try:
        return match[1], _parse_values(match[2])
    except ValueError:
        return None


def parse_modes(line: str) -> list[str]:
    """The words of the answer to ``$G``; none in other lines.

    >>> parse_modes("[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]")[1]
    'G54'
    """
    return line[4:-1].split() if line.startswith("[GC:") and line.endswith("]") else []


def parse_spindle(line: str) -> float | None:
    """The S word in force, of the answer to ``$G``; None while the spindle is off or in other lines.

    >>> parse_spindle("[GC:G0 G54 G17 G21 G90 G94 M3 M9 T0 F0 S120]")
    120.0
    """
    words = parse_modes(line)
    speeds = [word[1:] for word in words if re.fullmatch(f"S{_NUMBER}", word)]
    return float(speeds[0]) if "M3" in words and speeds else None


def _parse_value(text: str) -> float:
    """A number as GRBL prints it. Raises ValueError for others, such as nan, 1e400 or 1_0."""
    if not re.fullmatch(_NUMBER, text):
        raise ValueError(text)
    return float(text)


def _parse_values(text: str) -> tuple[float, ...]:
    return tuple(_parse_value(part) for part in text.split(","))


def alarm_text(number: int) -> str:
    """The meaning of an alarm."""
    return ALARMS.get(number, f"alarm {number}")


def error_text(number: int) -> str:
    """The meaning of an error."""
    return ERRORS.get(number, f"error {number}")
