"""pydantic's errors in the robot file's own words: what is wrong, where, what is allowed.

pydantic names types; the person who wrote the file needs the joint, the key and an example. Each error
becomes ``(path, text)``; the reader adds the file and the line.
"""

import re
from collections.abc import Callable, Iterator
from typing import Any

from pydantic import BaseModel

from armkin.robot_file import keep_out_keys, robot_keys, strict_yaml

Path = tuple[str | int, ...]

# Which model the keys under a name belong to.
_MODELS: dict[str, type[BaseModel]] = {
    "": robot_keys.RobotKeys,
    "joints": robot_keys.Joint,
    "dh": robot_keys.DH,
    "screw": robot_keys.Screw,
    "drive": robot_keys.Drive,
    "motors": robot_keys.Motor,
    "gripper": robot_keys.Gripper,
    "homing": robot_keys.Homing,
    "board": robot_keys.Board,
    "base": robot_keys.Base,
    "body": robot_keys.Body,
    "tool": robot_keys.Pose,
    "zero_pose": robot_keys.Pose,
}
# The same of keep-outs, whose keys (min, max, from, to) are other keys' synonyms elsewhere.
_KEEP_OUT: dict[str, type[BaseModel]] = {
    "keep_out": keep_out_keys.Entry,
    "box": keep_out_keys.Box,
    "capsule": keep_out_keys.Capsule,
}
_EXAMPLES: dict[str, str] = {
    "body": "{radius: 40}, in mm",
    "box": "{min: [200, -300, 0], max: [500, 300, 120]}",
    "capsule": "{from: [0, 400, 0], to: [0, 400, 900], radius: 60}",
    "min": "[x, y, z] in mm",
    "max": "[x, y, z] in mm",
    "size": "[x, y, z] in mm",
    "from": "[x, y, z] in mm",
    "to": "[x, y, z] in mm",
    "xyz": "[x, y, z] in mm",
    "rpy": "[roll, pitch, yaw] in degrees",
    "w": "[x, y, z], of length 1",
    "v": "[x, y, z]",
    "q": "[x, y, z] in mm",
    "limits": "[lower, upper], for example [-90, 90]",
    "travel": "[from, to] in degrees, for example [0, 180]",
    "pulse_us": "[from, to] in microseconds, for example [500, 2500]",
    "dh": "{alpha: 90, a: 0, d: 170, theta: 0}",
    "screw": "{w: [0, 0, 1], v: [0, 0, 0]}",
    "drive": "{full_steps: 200, microsteps: 16, gear: 1, axis: X}",
    "base": "{xyz: [0, 0, 0], rpy: [0, 0, 0]}",
    "tool": "{xyz: [0, 0, 0], rpy: [0, 0, 0]}",
    "zero_pose": "{xyz: [0, 0, 0], rpy: [0, 0, 0]}",
    "joints": "a list, each item beginning with - name: q1",
    "motors": "a list, each item beginning with - name: M1",
    "board": "{kind: uno_cnc_shield, driver: A4988}",
    "gripper": "{kind: servo, axis: S0, travel: [0, 180], pulse_us: [500, 2500], open: 30, closed: 120}",
    "homing": "{switch: X, direction: -1, at: -90, speed: 10, backoff: 3, normally: open}",
    "name": "a word, for example q1",
    "poses": "names with joint values: {park: [0, 90, -90]}",
    "gear": "a number or {motor: 16, joint: 80}",
    "pulley": "a number or {motor: 16, joint: 80}",
}
# What other programs and papers call our keys and values.
_SYNONYMS: dict[str, str] = {
    "offset": "theta",
    "joint_offset": "theta",
    "r": "a",
    "length": "a",
    "twist": "alpha",
    "link_length": "a",
    "link_offset": "d",
    "range": "limits",
    "min": "limits",
    "max": "limits",
    "lower": "limits",
    "upper": "limits",
    "qlim": "limits",
    "speed": "max_speed",
    "velocity": "max_speed",
    "acceleration": "max_accel",
    "accel": "max_accel",
    "steps": "full_steps",
    "steps_per_rev": "full_steps",
    "ratio": "gear",
    "reduction": "gear",
    "pitch": "lead",
    "tcp": "tool",
    "links": "joints",
    "reversed": "invert",
    "inverted": "invert",
    "position": "xyz",
    "translation": "xyz",
    "rotation": "rpy",
    "mdh": "modified",
    "craig": "modified",
    "proximal": "modified",
    "dh": "standard",
    "sdh": "standard",
    "distal": "standard",
    "classic": "standard",
    "poe": "screws",
    "screw": "screws",
    "linear": "prismatic",
    "p": "prismatic",
    "rotary": "revolute",
    "rotational": "revolute",
    "r_joint": "revolute",
}


def problems(errors: list[Any]) -> Iterator[tuple[Path, str]]:
    """pydantic's error list (``ValidationError.errors()``) as paths and texts."""
    suggested_keys = _suggested_keys(errors)
    wrong_lengths: set[Path] = set()
    for error in errors:
        path: Path = tuple(part for part in error["loc"] if part != "[key]")
        if error["type"] == "problems":
            yield from error["ctx"]["problems"]
        elif error["type"] == "errors":  # a part that is validated by itself has such errors
            yield from problems(error["ctx"]["errors"])
        elif error["type"] == "too_short" and len(error["input"]) >= error["ctx"]["min_length"]:
            continue  # pydantic counts valid items only, and the invalid ones are told already
        elif error["type"] == "missing" and path and isinstance(path[-1], int):
            if path[:-1] not in wrong_lengths:  # [1] for a triple misses two numbers: one message
                wrong_lengths.add(path[:-1])
                yield path[:-1], f"is too short; write {_example(path[:-1])}"
        elif error["type"] != "missing" or path not in suggested_keys:
            yield path, _error_text(error)


def _suggested_keys(errors: list[Any]) -> set[Path]:
    """Keys that are meant by misspelt ones, and missing for that alone: it is said once."""
    unknown = [error["loc"] for error in errors if error["type"] == "extra_forbidden"]
    return {(*loc[:-1], key) for loc in unknown if (key := _suggestion(loc)) is not None}


def _error_text(error: Any) -> str:
    """One of pydantic's errors in words."""
    kind, path, value = error["type"], error["loc"], error["input"]
    context = error.get("ctx", {})
    if path and path[-1] in ("sign", "direction"):
        return f"must be 1 or -1, not {value if isinstance(value, float) else value_text(value)}"
    if kind in _BOUNDS:
        text = f"{_BOUNDS[kind].format(**context)}, not {value_text(value)}"
        is_negative_ratio = path[-1] in ("gear", "pulley") and value < 0
        return f"{text}; for the other direction write invert: true" if is_negative_ratio else text
    words = _WORDS.get(kind)
    return str(error["msg"]) if words is None else words(path, value, context)


def _missing_text(path: Path, value: Any, context: Any) -> str:
    key = str(path[-1])
    example = "text, for example three_dof" if path == ("name",) else _EXAMPLES.get(key)
    return f"is required: {example or _first_sentence(_owner(path), key)}"


def _too_long(path: Path, value: Any, context: Any) -> str:
    if path in (("joints",), ("motors",)):
        return f"{len(value)} {path[0]}; armkin takes 1 to {context['max_length']}"
    return f"is too long; write {_example(path)}"


def _too_short(path: Path, value: Any, context: Any) -> str:
    return "is empty; an arm has at least one joint" if path == ("joints",) else f"is too short; write {_example(path)}"


def _another_type(path: Path, value: Any, context: Any) -> str:
    return f"must be {_example(path)}, not {value_text(value)}"


def _not_a_number(kind: str, path: Path, value: Any) -> str:
    is_whole = kind == "a whole number"
    if path[-1] in ("gear", "pulley"):
        kind += " or teeth {motor: 16, joint: 80}"
    if is_whole and isinstance(value, float) and value.is_integer():
        return f"must be {kind}, not {value}; write {value:.0f}"
    text = f"must be {kind}, not {value_text(value)}"
    return f"{text}{_instead_text(path[-1], value)}" if isinstance(value, str) else text


def _instead_text(key: str | int, value: str) -> str:
    """What to write instead of text that is meant as a number; empty where that cannot be known."""
    stripped = value.strip().lower()
    if key in ("theta", "d") and re.fullmatch(r"[+-]?(?:q|theta|th|d)_?[0-9]{0,2}\*?(?: *[+-].*)?", stripped):
        return (
            f"; leave the variable out: {key} is the constant part, and the joint's value is added "
            "to theta (of a prismatic joint: to d)"
        )
    for unit in ("mm", "deg", "degrees", "°", "us"):
        stripped = stripped.removesuffix(unit).strip()
    if stripped != value.strip().lower():
        return f"; units are fixed (mm, degrees), write {stripped}" if _is_number(stripped) else ""
    if _is_number(stripped):
        return f"; write {stripped} without quotes"
    if _is_number(stripped.replace(",", ".")):
        return f"; write {stripped.replace(',', '.')} with a point"
    return "; angles are in degrees, so pi/2 is 90" if "pi" in stripped else ""


def _is_number(text: str) -> bool:
    try:
        return abs(float(text)) < 1e300
    except ValueError:
        return False


def _not_a_choice(value: str, expected: str, value_text: str) -> str:
    choices = expected.replace(" or ", ", ").split(", ")
    near = _nearest_key(value, choices)
    return f"must be {expected}, not {value_text}" + (f"; did you mean {near}?" if near else "")


def _unknown_key(path: Path) -> str:
    """What to say of an unknown key: the one that was meant, where it belongs, or the keys there are."""
    key, owner = str(path[-1]), _owner(path)
    near = _suggestion(path)
    if near is not None:
        return f"unknown key; did you mean {near}?"
    for name, model in _models(path).items():
        if key in model.model_fields and model is not owner and name:
            return f"unknown key here; it belongs in {_place_name(name)}"
    if key in robot_keys.RobotKeys.model_fields and path[0] != "keep_out":
        return "unknown key here; it belongs at the top of the file"
    return f"unknown key; the keys here are {', '.join(_keys(owner))}"


def _place_name(name: str) -> str:
    return {"joints": "a joint", "motors": "motors"}.get(name, name)


def _suggestion(path: Path) -> str | None:
    key, owner = str(path[-1]), _owner(path)
    belongs = any(key in _keys(model) for model in _models(path).values())
    synonyms = {} if path[0] == "keep_out" else _SYNONYMS
    return None if belongs else _nearest_key(key, _keys(owner), synonyms)


def _keys(owner: type[BaseModel]) -> list[str]:
    """The keys of a model as files have them."""
    return [field.alias or name for name, field in owner.model_fields.items()]


def _nearest_key(word: str, choices: list[str], synonyms: dict[str, str] = _SYNONYMS) -> str | None:
    import difflib

    low = word.strip().lower().replace("-", "_").replace(" ", "_")
    by_lower = {choice.lower(): choice for choice in choices}
    synonym = synonyms.get(low, low)
    if synonym.lower() in by_lower:
        return by_lower[synonym.lower()]
    near = difflib.get_close_matches(low, by_lower, n=1, cutoff=0.65)
    return by_lower[near[0]] if near else None


def _owner(path: Path) -> type[BaseModel]:
    names = [part for part in path[:-1] if isinstance(part, str)]
    return _models(path).get(names[-1] if names else "", robot_keys.RobotKeys)


def _models(path: Path) -> dict[str, type[BaseModel]]:
    """Which models the keys of a place may belong to."""
    return _KEEP_OUT if path[:1] == ("keep_out",) and len(path) > 1 else _MODELS


def _example(path: Path) -> str:
    """What may stand at a key, for example."""
    names = [part for part in path if isinstance(part, str)]
    key = names[-1] if names else ""
    if path and isinstance(path[-1], int):
        return {"joints": "a joint: name: q1, dh: {...}", "motors": "a motor: name: M1, joints: {q1: 1}"}.get(
            key, "a number"
        )
    if names[:1] == ["poses"] and len(names) > 1:
        return "joint values, for example [0, 90, -90]"
    if key == "joints" and "motors" in names:
        return "{q1: 1, q2: 2}, weights by joint name"
    return _EXAMPLES.get(key, "a mapping of keys")


def _first_sentence(owner: type[BaseModel], key: str) -> str:
    field = owner.model_fields.get(key)
    text = (field.description if field else None) or "see the schema"
    first = text.split(". ")[0].split("; ")[0].rstrip(".")
    return first[:1].lower() + first[1:]


def value_text(value: Any) -> str:
    """A value as the file's author would recognise it, on one short line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return f"{value:.10g}"
    if isinstance(value, dict):
        return "a mapping" if value else "an empty mapping {}"
    if isinstance(value, tuple | list):
        return "a list" if value else "an empty list []"
    return f"the text '{strict_yaml.one_line(str(value))}'"


_BOUNDS = {
    "greater_than": "must be above {gt:.10g}",
    "greater_than_equal": "must be at least {ge:.10g}",
    "less_than": "must be below {lt:.10g}",
    "less_than_equal": "must be at most {le:.10g}",
}
# What is said of each kind of error, from its path, the value found and what pydantic says besides.
_WORDS: dict[str, Callable[[Path, Any, Any], str]] = {
    "extra_forbidden": lambda path, _value, _context: _unknown_key(path),
    "missing": _missing_text,
    "too_long": _too_long,
    "too_short": _too_short,
    "tuple_type": _another_type,
    "model_type": _another_type,
    "dict_type": _another_type,
    "model_attributes_type": _another_type,
    "float_type": lambda path, value, _context: _not_a_number("a number", path, value),
    "int_type": lambda path, value, _context: _not_a_number("a whole number", path, value),
    "string_type": lambda _path, value, _context: (
        f'must be text, not {value_text(value)}; write "{value_text(value)}" in quotes if that is meant'
    ),
    "bool_type": lambda _path, value, _context: f"must be true or false, not {value_text(value)}",
    "literal_error": lambda _path, value, context: _not_a_choice(
        str(value), context["expected"].replace("'", ""), value_text(value)
    ),
    "string_pattern_mismatch": lambda _path, value, _context: (
        f"{value_text(value)} is not a name: letters, digits, _ . and -, beginning with a letter"
    ),
    "string_too_long": lambda _path, _value, context: f"is longer than {context['max_length']} characters",
    "string_too_short": lambda _path, _value, _context: "is empty",
}
