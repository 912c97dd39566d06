"""Single lines of CSV, without numpy: for what has few of them."""

from collections.abc import Iterable
from typing import Any


def csv_line(record: Iterable[Any]) -> str:
    """One line of CSV: numbers at full precision, text quoted where it holds a comma or a quote.

    >>> csv_line([1.5, "left, elbow up", True, None])
    '1.5,"left, elbow up",true,'
    >>> csv_line(['is "home" now', -0.0])
    '"is ""home"" now",-0.0'
    """
    return ",".join([repr(value) if type(value) is float else csv_cell(value) for value in record])


def csv_cell(value: Any) -> str:
    """One cell."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    text = str(value)
    if any(mark in text for mark in ',"\r\n'):
        return '"' + text.replace('"', '""') + '"'
    return text
