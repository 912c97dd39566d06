"""What is wrong with a path file, in its own words."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from armkin.path_file.path_keys import EXAMPLES, KINDS, Arc, Circle, Move, Offset, PathFile, Start
from armkin.robot_file.robot_key_errors import value_text

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

Place = tuple[str | int, ...]
Words = Callable[[list[str], Any], str]  # of the keys that lead to an error, and the error
_OWNERS: dict[str, type[BaseModel]] = {"moves": Move, "arc": Arc, "circle": Circle, "offset": Offset, "start": Start}
_SYNONYMS = {
    "center": "centre", "lin": "line", "ptp": "joint", "joints": "joint", "circ": "arc", "mid": "via", "end": "to",
    "target": "point", "goto": "point", "move": "line", "pause": "wait", "dwell": "wait", "gripper": "grip",
    "radius": "blend", "velocity": "speed", "name": "robot", "points": "polyline", "waypoints": "moves",
}  # fmt: skip


def problems(error: ValidationError) -> Iterator[tuple[Place, str]]:
    """Places and texts, each place once: of a key that takes several shapes, the shape that came nearest."""
    deepest: dict[Place, Any] = {}
    for problem in error.errors(include_url=False):
        place = _place_of(problem["loc"])
        if place not in deepest or _nearness(problem) > _nearness(deepest[place]):
            deepest[place] = problem
    for place in list(deepest):  # what is wrong inside a value says more than that the value is wrong
        if any(len(inner) > len(place) and inner[: len(place)] == place for inner in deepest):
            del deepest[place]
    for place, problem in deepest.items():
        yield place, f"{_place_text(place)}{_problem_text(place, problem)}"


def _nearness(problem: Any) -> tuple[bool, int]:
    """How near a shape came: one whose keys are all right, and together wrong, came nearest."""
    return problem["type"] == "problem", len(problem["loc"])


def _place_of(loc: tuple[str | int, ...]) -> Place:
    """pydantic's location without the names of the shapes it has tried: only our keys, and item numbers."""
    owners: list[type[BaseModel]] = [PathFile, *_OWNERS.values()]
    keys = {*KINDS, *(key for owner in owners for key in owner.model_fields)}
    keys_of_place: list[str | int] = []
    for k, part in enumerate(loc):
        if isinstance(part, int) or part in keys or (k == len(loc) - 1 and not _is_shape(part)):
            keys_of_place.append(part)
    return tuple(keys_of_place)


def _is_shape(part: str) -> bool:
    is_bounded_number = part.startswith("constrained-")
    return (
        is_bounded_number or any(sign in part for sign in "[]()") or part in ("float", "str", "int", "Start", "[key]")
    )


def _place_text(place: Place) -> str:
    words = []
    if place[:1] == ("moves",) and len(place) > 1 and isinstance(place[1], int):
        words.append(f"move {place[1] + 1}")
        place = place[2:]
    while place and isinstance(place[-1], int):
        place = place[:-1]
    if place:
        words.append(".".join(str(part) for part in place if not isinstance(part, int)))
    return "".join(f"{word}: " for word in words)


def _problem_text(place: Place, error: Any) -> str:
    names = [part for part in place if isinstance(part, str)]
    words = _WORDS.get(error["type"])
    if words is not None:
        return words(names, error)
    example = next((EXAMPLES[name] for name in reversed(names) if name in EXAMPLES), None)
    return f"is {value_text(error['input'])}" + (f"; for example {example}" if example else f": {error['msg'].lower()}")


def _unknown_text(names: list[str], error: Any) -> str:
    owner = _OWNERS.get(names[-2], PathFile) if len(names) > 1 else PathFile
    near = _nearest_key(names[-1] if names else "", list(owner.model_fields))
    hint = f"did you mean {near}?" if near else f"the keys here are {', '.join(owner.model_fields)}"
    return f"unknown key; {hint}"


def _missing_text(names: list[str], error: Any) -> str:
    example = ": a list of moves, for example - line: [390, 160, 300]" if names[-1:] == ["moves"] else ""
    return f"is required{example}"


def _bound_text(sign: str, key: str) -> Words:
    return lambda names, error: f"must be {sign} {error['ctx'][key]:g}, not {value_text(error['input'])}"


def _length_text(names: list[str], error: Any) -> str:
    context, count = error["ctx"], error["ctx"]["actual_length"]
    bound = f"at least {context['min_length']}" if "min_length" in context else f"at most {context['max_length']}"
    return f"has {count} item{'s' * (count != 1)}, and must have {bound}"


_WORDS: dict[str, Words] = {  # pydantic's kind of error -> what is said of it
    "extra_forbidden": _unknown_text,
    "missing": _missing_text,
    "problem": lambda names, error: str(error["msg"]),
    "greater_than": _bound_text("above", "gt"),
    "greater_than_equal": _bound_text("at least", "ge"),
    "less_than_equal": _bound_text("at most", "le"),
    "less_than": _bound_text("below", "lt"),
    "too_short": _length_text,
    "too_long": _length_text,
    "finite_number": lambda names, error: "must be a finite number",
}


def _nearest_key(word: str, choices: list[str]) -> str | None:
    low = word.strip().lower().replace("-", "_")
    if _SYNONYMS.get(low) in choices:
        return _SYNONYMS[low]
    near = difflib.get_close_matches(low, choices, n=1, cutoff=0.6)
    return near[0] if near else None
