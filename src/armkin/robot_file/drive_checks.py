"""Rules between the values of one drive, and between a drive and its joint, as in `cross_key_checks`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from armkin.robot_file.robot_keys import Gripper

if TYPE_CHECKING:
    from armkin.robot_file.robot_keys import Drive, Joint

Path = tuple[str | int, ...]
Problem = tuple[Path, str]

_STEPPER_KEYS = ("full_steps", "microsteps", "gear", "pulley", "lead")
_SERVO_KEYS = ("travel", "pulse_us", "zero")
_BUS_KEYS = ("id", "counts", "zero")
_KEYS: dict[str, tuple[str, ...]] = {
    "stepper": _STEPPER_KEYS,
    "servo": _SERVO_KEYS,
    "bus": _BUS_KEYS,
    "spindle": (),
}


def check_drive(drive: Drive) -> Iterator[Problem]:
    """A motor's own values, apart from the joints that it turns."""
    keys_given = drive.model_fields_set
    allowed = _KEYS[drive.kind]
    motor = "bus servo" if drive.kind == "bus" else drive.kind
    for key in (key for key in dict.fromkeys(sum(_KEYS.values(), ())) if key in keys_given and key not in allowed):
        message = f"a {motor} has no {key}; it takes {', '.join(allowed) or 'open and closed alone'}"
        kind, kind_name = ("bus", "bus servo") if key in ("id", "counts") else ("servo", "servo")
        yield (key,), message + (f"; for a {kind_name} write kind: {kind}" if drive.kind == "stepper" else "")
    yield from _OF_DRIVES[drive.kind](drive)


def _check_spindle(drive: Drive) -> Iterator[Problem]:
    if not isinstance(drive, Gripper):
        yield ("kind",), "a spindle is GRBL's M3 output, which turns no joint; it can be the gripper's"
    if drive.axis is not None or drive.invert:
        yield ("axis" if drive.axis is not None else "invert",), "a spindle has none: M3 is GRBL's one such output"


def _check_bus_servo(drive: Drive) -> Iterator[Problem]:
    if missing_keys := _missing_keys(drive, "id", "counts"):
        yield (), f"a bus servo needs {missing_keys}, for example id: 1, counts: 4096, zero: 2048"
    if drive.axis is not None:
        yield ("axis",), "a bus servo has no axis; its place on the bus is id"


def _check_stepper(drive: Drive) -> Iterator[Problem]:
    missing_keys = _missing_keys(drive, "full_steps", "microsteps")
    if missing_keys and not any(key in drive.model_fields_set for key in _SERVO_KEYS):
        example = "for example full_steps: 200, microsteps: 16 (an RC servo: kind: servo)"
        yield (), f"a stepper needs {missing_keys}, {example}"
    elif not missing_keys and not 1e-3 <= drive.pulses_per_turn() <= 1e9:
        yield (), f"{drive.pulses_per_turn():g} pulses per turn; 0.001 to 1e9 can be right"


def _check_servo(drive: Drive) -> Iterator[Problem]:
    if missing_keys := _missing_keys(drive, "travel", "pulse_us"):
        yield (), f"a servo needs {missing_keys}, for example travel: [0, 180], pulse_us: [500, 2500]"
    for key in ("travel", "pulse_us"):
        pair = getattr(drive, key)
        if pair is not None and pair[0] >= pair[1]:
            hint = "for a servo that turns the other way write invert: true"
            yield (key,), f"must go up, [{pair[1]:g}, {pair[0]:g}]; {hint}"


_OF_DRIVES = {"spindle": _check_spindle, "bus": _check_bus_servo, "stepper": _check_stepper, "servo": _check_servo}


def _missing_keys(drive: Drive, *keys: str) -> str:
    """The keys that are not given, in words: a and b."""
    return " and ".join(key for key in keys if getattr(drive, key) is None)


def _check_bus_reach(drive: Drive, joint: Joint) -> Iterator[Problem]:
    """A joint value beyond the one turn that a bus servo counts: 0 to counts - 1."""
    if drive.counts is None:
        return
    turn = -1.0 if drive.invert else 1.0
    key = "home" if joint.limits is None else "limits"
    for value in joint.limits or (joint.home,):
        count = drive.zero + turn * value * drive.counts / 360.0
        if not -0.5 <= count < drive.counts - 0.5:
            low, high = sorted(turn * (end - drive.zero) * 360.0 / drive.counts for end in (0, drive.counts - 1))
            yield (key,), f"{value:g} needs count {count:.0f}; with zero {drive.zero:g} it takes {low:g} to {high:g}"
            return


def check_drive_reach(drive: Drive, joint: Joint) -> Iterator[Problem]:
    """A joint value that its servo cannot take: the pulse would be outside pulse_us, the count beyond a turn."""
    if drive.kind == "bus":
        yield from _check_bus_reach(drive, joint)
        return
    if drive.kind != "servo" or drive.travel is None or drive.travel[0] >= drive.travel[1]:
        return
    turn = -1.0 if drive.invert else 1.0
    key = "home" if joint.limits is None else "limits"
    for value in joint.limits or (joint.home,):
        angle = drive.zero + turn * value
        if not drive.travel[0] - 1e-9 <= angle <= drive.travel[1] + 1e-9:
            low, high = sorted(turn * (end - drive.zero) for end in drive.travel)
            message = f"{value:g} needs servo angle {angle:g}; its travel allows {low:g} to {high:g}"
            yield (key,), message
            return
