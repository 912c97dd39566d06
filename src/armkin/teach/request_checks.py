"""Checks of a request's body and fields."""

import json
import math
from collections.abc import Mapping
from typing import Any

from armkin.errors import UsageError
from armkin.teach.page_key import RefusedError

MAX_BYTES = 256 * 1024  # largest body [bytes], for a path file of ten thousand moves


def body_length(headers: Mapping[str, str]) -> int:
    """The length of a body [bytes] from its header, within MAX_BYTES."""
    text = headers.get("Content-Length", "")
    if "Transfer-Encoding" in headers or not (text.isascii() and text.isdigit() and len(text) < 12):
        raise RefusedError(411, "a body needs its Content-Length")
    if int(text) > MAX_BYTES:
        raise RefusedError(413, f"a body may have {MAX_BYTES} bytes")
    return int(text)


def body_fields(raw: bytes) -> dict[str, Any]:
    """A body as a JSON object without NaN or Infinity."""
    try:
        fields = json.loads(raw.decode("utf-8"), parse_constant=_no_constant, parse_float=_finite_float)
    except (ValueError, RecursionError):
        raise RefusedError(400, "the body is no JSON, or has a number that is not finite") from None
    if not isinstance(fields, dict):
        raise RefusedError(400, "the body must be a JSON object")
    return fields


def _no_constant(name: str) -> float:
    raise ValueError(name)


def _finite_float(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


# Fields of a body: an invalid one raises UsageError with its name.


def number_list_field(fields: Mapping[str, Any], name: str, count: int) -> list[float]:
    """A list of `count` finite numbers."""
    values = fields.get(name)
    if not isinstance(values, list) or len(values) != count:
        raise UsageError(f"{name}: expected {count} numbers")
    return [_bounded_number(value, name) for value in values]


def number_field(fields: Mapping[str, Any], name: str, low: float, high: float) -> float:
    """A number from low to high."""
    value = _bounded_number(fields.get(name), name)
    if not low <= value <= high:
        raise UsageError(f"{name}: {value:g} is outside {low:g} to {high:g}")
    return value


def index_field(fields: Mapping[str, Any], name: str, count: int) -> int:
    """An index: from 0, less than `count`."""
    value = fields.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < count:
        raise UsageError(f"{name}: expected a whole number from 0 to {count - 1}")
    return value


def text_field(fields: Mapping[str, Any], name: str, longest: int = 200) -> str:
    """A string of bounded length."""
    value = fields.get(name)
    if not isinstance(value, str) or len(value) > longest:
        raise UsageError(f"{name}: expected text of at most {longest} characters")
    return value


def flag_field(fields: Mapping[str, Any], name: str) -> bool:
    """True or false; false if it is not there."""
    value = fields.get(name, False)
    if not isinstance(value, bool):
        raise UsageError(f"{name}: expected true or false")
    return value


def _bounded_number(value: Any, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UsageError(f"{name}: expected a number")
    try:
        number_value = float(value)
    except OverflowError:
        raise UsageError(f"{name}: the number is too large") from None
    if not abs(number_value) <= 1e9:
        raise UsageError(f"{name}: {number_value:g} is too large; at most 1e9 from 0")
    return number_value
