"""Numbers as people write them on a command line or in a CSV file."""

import re
from collections.abc import Sequence

from armkin.errors import UsageError

# Far beyond any arm, in degrees or mm: what is larger is a slip, and would drown in rounding.
MAX_NUMBER = 1e9
NOT_FINITE = ("nan", "inf", "infinity")

_PI = r"([+-]?)([0-9]{0,9}(?:\.[0-9]{1,9})?)\*?(?:pi|\u03c0)(?:/([0-9]{1,9}))?"
_NUMBER = re.compile(r"[+-]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:[eE][+-]?[0-9]++)?")
_MAX_DIGITS = 10_000  # characters of a number, at most


def number(text: str, name: str, largest: float = MAX_NUMBER) -> float:
    """One finite number up to `largest` in size; name: what it is, for the message.

    >>> number("-1e3", "q1")
    -1000.0
    """
    cleaned_text = text.strip().replace("\u2212", "-")  # the minus sign of printed papers
    short_form = text if len(text) <= 40 else text[:37] + "..."
    if len(cleaned_text) > _MAX_DIGITS:
        raise UsageError(f"{name}: '{short_form}' is too long for a number", argument=name, value=short_form)
    if not _NUMBER.fullmatch(cleaned_text):
        raise UsageError(f"{name}: {_refusal_reason(cleaned_text, short_form)}", argument=name, value=short_form)
    value = float(cleaned_text)
    if abs(value) > largest:
        message = f"{name}: '{short_form}' is too large; numbers here go up to {largest:g}"
        raise UsageError(message, argument=name, value=short_form, most=largest)
    return value


def decimal_count(text: str) -> int:
    """How many decimals a number is printed with.

    >>> decimal_count("345.040"), decimal_count("390"), decimal_count("3.45040e2")
    (3, 0, 3)
    """
    mantissa, _, exponent = text.strip().lower().partition("e")
    return max(len(mantissa.partition(".")[2]) - int(exponent or 0), 0)


def is_number(text: str) -> bool:
    """Whether a word is a number."""
    return _NUMBER.fullmatch(text.strip()) is not None


def numbers(words: Sequence[str], names: Sequence[str], purpose: str) -> list[float]:
    """One number a name; purpose: who wants them, for the message about a wrong count.

    >>> numbers(["390", "80"], ["x", "y"], "task xy")
    [390.0, 80.0]
    """
    if len(words) != len(names):
        raise UsageError(
            f"{purpose} takes {len(names)} number{'s' if len(names) != 1 else ''} ({' '.join(names)}), "
            f"got {len(words)}{_separator_hint(words, names)}",
            argument=purpose,
            names=list(names),
            got=len(words),
        )
    return [number(word, name) for word, name in zip(words, names, strict=True)]


def comma_separated(text: str, names: Sequence[str], purpose: str) -> list[float]:
    """Comma-separated numbers, as options take them: ``--near 0,90,-90``."""
    words = text.split(",")
    if len(words) == 1 and len(names) > 1 and len(text.split()) == len(names):
        raise UsageError(f"{purpose}: separate the numbers with commas: {','.join(text.split())}")
    if len(words) == len(names):
        names = [f"{purpose}: {name}" for name in names]
    elif len(words) == 1:
        example = ",".join([text.strip() or "0", *["0"] * (len(names) - 1)])
        raise UsageError(
            f"{purpose} takes {len(names)} numbers ({' '.join(names)}) with commas and no spaces, as {example}; got 1"
        )
    return numbers(words, names, purpose)


def place_numbers(text: str, purpose: str) -> list[float]:
    """``X,Y,Z``, or with roll, pitch and yaw, as options take them: three numbers or six [mm, deg]."""
    names = ("x", "y", "z", "roll", "pitch", "yaw")
    return comma_separated(text, names[: 6 if text.count(",") > 2 else 3], purpose)


def whole_number(text: str, name: str, low: int, high: int) -> int:
    """A whole number within bounds."""
    value = number(text, name, float("inf"))
    if not low <= value <= high or value != int(value):
        short_form = text if len(text) <= 40 else text[:37] + "..."
        message = f"{name}: '{short_form}' must be a whole number from {low} to {high}"
        raise UsageError(message, argument=name, value=text, least=low, most=high)
    return int(value)


def _refusal_reason(number: str, short_form: str) -> str:
    """Why a word is no number, in words: unit, sign, comma or infinity."""
    unsigned = number.lower().lstrip("+-")
    if not unsigned:
        return "a number is missing"
    if unsigned in NOT_FINITE:
        return f"'{short_form}' is not finite; give a number"
    for unit in ("mm", "degrees", "deg", "\u00b0", "%"):
        if unsigned.endswith(unit) and _NUMBER.fullmatch(unsigned.removesuffix(unit).strip()):
            value = number[: -len(unit)].strip()
            fixed = f"units are fixed (mm, degrees); write {value}"
            return f"'{short_form}': {f'write {value}, without a sign for its unit' if unit == '%' else fixed}"
    if (angle := of_pi(number)) is not None:
        return f"'{short_form}': angles are degrees; write {angle:.10g}"
    if _NUMBER.fullmatch(number.rstrip(",")):
        return f"'{short_form}' ends with a comma; write {number.rstrip(',')}"
    if number.count(",") == 1 and _NUMBER.fullmatch(number.replace(",", ".")):
        return f"'{short_form}' is not a number; write {number.replace(',', '.')} with a point"
    return f"'{short_form}' is not a number"


def of_pi(text: str) -> float | None:
    """A multiple of pi in degrees; None for other text.

    >>> of_pi("-pi/2"), of_pi("3pi/4"), of_pi("pie")
    (-90.0, 135.0, None)
    """
    match = re.fullmatch(_PI, text.strip().lower())
    if match is None or (match[3] is not None and int(match[3]) == 0):
        return None
    return float(f"{match[1]}1") * 180 * float(match[2] or 1) / float(match[3] or 1)


def _separator_hint(words: Sequence[str], names: Sequence[str]) -> str:
    if len(words) == 1 and words[0].lower().endswith(".csv"):
        return f"; rows of a file: --batch {words[0]}"
    if len(words) == 1 and len(names) > 1:
        parts = words[0].strip("[]()").replace(",", " ").split()
        if len(parts) == len(names):
            return "; separate them with spaces: " + " ".join(parts)
    return ""
