"""Joints held or swept, as words: `--lock J3=20`, `--sweep J3=-90:90:16`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from armkin.cli.parsing.number_parsing import number, whole_number
from armkin.errors import NoSolutionError, UsageError
from armkin.model import units

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_RANGE = "JOINT=LOW:HIGH:COUNT, for example J3=-90:90:16"


def locked_values(arm: Arm, words: Sequence[str] | None) -> dict[str, float]:
    """`--lock J=V`: joint name -> value [deg | mm]. Raises NoSolutionError for one outside its joint's limits."""
    from armkin.model import limits
    from armkin.model.lock_joints import joint_index

    values: dict[str, float] = {}
    for text in words or ():
        name, word = _split_joint(arm, text, "--lock", "JOINT=VALUE, for example J3=20", values)
        values[name] = number(word, f"--lock {name}")
        k = joint_index(arm, name)
        value = units.joints_in(arm, [values[name] if i == k else 0.0 for i in range(arm.n)])
        if limits.outside_limits(arm, value)[k]:
            raise NoSolutionError(
                f"--lock {text}: {limits.outside_text(arm, k, value[k])}", **limits.limit_fields(arm, k, value[k])
            )
    return values


def locked_radians(arm: Arm, words: Sequence[str] | None) -> dict[str, float]:
    """`--lock J=V`: joint name -> value [rad | mm], as `armkin.lock` takes them."""
    slides = dict(zip(arm.joint_names, arm.prismatic, strict=True))
    return {name: value * (1.0 if slides[name] else units.DEGREE) for name, value in locked_values(arm, words).items()}


def swept_values(arm: Arm, words: Sequence[str] | None, held: Mapping[str, float]) -> dict[str, list[float]]:
    """`--sweep J=LOW:HIGH:COUNT`: joint name -> values [deg | mm], both ends included."""
    from armkin.inverse.choose_branch import MAX_SWEEPS

    values_of: dict[str, list[float]] = {}
    for text in words or ():
        name, value = _split_joint(arm, text, "--sweep", _RANGE, {**held, **values_of})
        parts = value.split(":")
        if len(parts) != 3:
            raise UsageError(f"--sweep {text}: write {_RANGE}")
        low, high = number(parts[0], f"--sweep {name}"), number(parts[1], f"--sweep {name}")
        count = whole_number(parts[2], f"--sweep {name}: count", 1, MAX_SWEEPS)
        values_of[name] = [low + (high - low) * i / max(count - 1, 1) for i in range(count)]
    return values_of


def _split_joint(arm: Arm, text: str, option: str, example: str, given_joints: dict[str, Any]) -> tuple[str, str]:
    from armkin.model.lock_joints import joint_index

    name, equals, value = text.partition("=")
    if not equals:
        raise UsageError(f"{option} {text}: write {example}")
    joint_index(arm, name)
    if name in given_joints:
        raise UsageError(f"{option} {text}: {name} is held already")
    return name, value
