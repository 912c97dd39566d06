"""YAML without its traps: every value is what it looks like, or an error with its line.

The text is parsed into events (by libyaml where PyYAML has it) and the values are built here, so that
nothing of YAML 1.1's guessing is left: ``80:16`` is not 4816, ``017`` is not 15, ``off`` is not false
and ``1e3`` is not text. Anchors and aliases are refused as a whole, because a file of a few lines can
unfold into gigabytes; so are tags, merge keys and several documents. A value that all YAML readers
agree on (``-3.5``, ``.5``, ``1.0e+3``, ``true``, ``"text"``) is accepted.

>>> load_yaml("a: [1, 2.5]\\nb: {c: x}\\n").data
{'a': (1, 2.5), 'b': {'c': 'x'}}
>>> load_yaml("gear: 80:16")
Traceback (most recent call last):
    ...
armkin.robot_file.strict_yaml.StrictYamlError: 1: 80:16 is 4816 to YAML; write teeth as {motor: 16, joint: 80}
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import yaml

MAX_BYTES = 256 * 1024
MAX_VALUES = 2_000  # values of a file, at most: an arm of twelve joints with all its motors has 500
MAX_DEPTH = 12
MAX_DIGITS = 15  # digits of an integer, at most: one of 15 is still exact as a float

Path = tuple[str | int, ...]


@dataclass(frozen=True)
class Kind:
    """What a file is: its name, what it has at the least, what its top level looks like, and how long it may be."""

    name: str
    least: str
    mapping: str
    size: int = MAX_BYTES
    values: int = MAX_VALUES

    @property
    def empty_text(self) -> str:
        """What is said of a file without a value."""
        return f"the file is empty; a {self.name} has at least {self.least}"


ROBOT_FILE = Kind("robot file", "name, convention and joints", "name, convention, joints, ...")

_LOADER: Any = yaml.CSafeLoader if yaml.__with_libyaml__ else yaml.SafeLoader

# YAML 1.1's own patterns, from PyYAML's resolver.py, and what people write that all but matches them.
# Plain text, compiled by `re` when first needed: most files need the first two only.
_INT = r"[-+]?(?:0|[1-9][0-9]*)"
_FLOAT = r"[-+]?(?:0|[1-9][0-9]*)\.[0-9]*(?:[eE][-+][0-9]+)?|\.[0-9]+(?:[eE][-+][0-9]+)?"
_LIKE_FLOAT = r"([-+]?)([0-9]*)(?:\.([0-9]*))?(?:[eE]([-+]?)([0-9]+))?"
_SEXAGESIMAL = r"[-+]?[0-9][0-9_]*(?::[0-9]+)+(?:\.[0-9_]*)?"
_LEADING_ZERO = r"([-+]?)0([0-9_]++(?:\.[0-9_]*+)?(?:[eE][-+]?[0-9]++)?)"
_OTHER_BASE = r"[-+]?0[xXbBoO][0-9a-fA-F_]+"
_UNDERSCORE = r"[-+]?[0-9][0-9_]*+(?:\.[0-9_]*+)?(?:[eE][-+]?[0-9]++)?"
_NOT_FINITE = r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"
_TIMESTAMP = r"[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}(?:[Tt \t].*)?"
_WORDS_FOR_TRUE = ("yes", "on")
_WORDS_FOR_FALSE = ("no", "off")


class StrictYamlError(ValueError):
    """A text that is not strict YAML: ``line`` (from 1; 0 for the file as a whole) and ``problem``."""

    def __init__(self, line: int, problem: str) -> None:
        super().__init__(f"{line}: {problem}" if line else problem)
        self.line = line
        self.problem = problem


@dataclass(frozen=True)
class Document:
    """A document's values, and the line on which each of them (or its key) stands."""

    data: dict[str, Any]
    lines: dict[Path, int] = field(repr=False)

    def line(self, path: Path) -> int:
        """Line of the value at ``path``, or of the nearest enclosing value that is there."""
        while path not in self.lines:
            path = path[:-1]
        return self.lines[path]


def load_yaml(text: bytes | str, kind: Kind = ROBOT_FILE) -> Document:
    """Read one YAML document whose top level is a mapping.

    text: bytes in UTF-8 (a byte order mark is accepted) or text; kind: what messages call it
    returns: mappings as dict, sequences as tuple, scalars as str, int, float and bool
    """
    return _build(_parse(_decode(text, kind), kind), kind)


def _decode(raw: bytes | str, kind: Kind) -> str:
    """The text of a file. Raises StrictYamlError, with the line, for what is no UTF-8 or no text."""
    if isinstance(raw, str):
        text = raw
    else:
        if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
            raise StrictYamlError(0, "the file is UTF-16; save it as UTF-8")
        try:
            text = raw.decode("utf-8")
        except UnicodeDecodeError as error:
            line = raw.count(b"\n", 0, error.start) + 1
            problem = f"byte 0x{raw[error.start]:02x} is not UTF-8"
            raise StrictYamlError(line, f"{problem}; save the file as UTF-8 text") from None
    if len(text) > kind.size:
        raise StrictYamlError(0, f"larger than {kind.size // 1024} kB; no {kind.name} is that long")
    text = text.removeprefix("\ufeff")
    for character in set(text):
        if not _is_text(ord(character)):
            line = text.count("\n", 0, text.index(character)) + 1
            problem = f"U+{ord(character):04X} has no place in a {kind.name}, which is YAML text"
            raise StrictYamlError(line, f"character {problem}")
    return text


def _is_text(code: int) -> bool:
    """YAML 1.2, production 1, less the line breaks that no editor counts (U+0085, U+2028, U+2029)."""
    if code < 0x7F:
        return code >= 0x20 or code in (0x09, 0x0A, 0x0D)
    if code < 0xA0 or code in (0x2028, 0x2029, 0xFEFF, 0xFFFE, 0xFFFF):
        return False
    return not 0xD800 <= code <= 0xDFFF


def _parse(text: str, kind: Kind) -> Iterator[Any]:
    """Parser events, with syntax errors told in our words."""
    try:
        yield from yaml.parse(text, Loader=_LOADER)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        if mark is None:
            raise StrictYamlError(0, f"not YAML: {error.problem}") from None
        source = text.splitlines() or [""]
        line = min(mark.line + 1, len(source))  # an end that came too early is on the last line
        faulty_line = source[line - 1]
        character = faulty_line[mark.column : mark.column + 1]
        if character == "\t" or "\t" in faulty_line[: len(faulty_line) - len(faulty_line.lstrip())]:
            raise StrictYamlError(line, "a tab is not allowed in YAML's indentation; use spaces") from None
        if character and character in "%@`":
            raise StrictYamlError(line, f"text cannot begin with {character}; put it in quotes") from None
        problem = str(error.problem)
        if problem.startswith("exceeded maximum nesting depth"):  # libyaml's own bound, 1,000, which it reads ahead to
            raise StrictYamlError(line, _too_deep(kind)) from None
        begin = error.context_mark.line + 1 if error.context_mark else line
        context = f" ({error.context} that begins on line {begin})" if begin < line else ""
        hint = "check the colon and space after keys, the indentation, brackets and quotes"
        if problem.startswith("mapping values are not allowed"):
            problem = "a key inside a value"
            hint = "text with ': ' in it needs quotes; the keys of one mapping are indented alike"
        raise StrictYamlError(line, f"not YAML: {problem}{context}; {hint}") from None
    except yaml.YAMLError as error:  # the reader's: a character that YAML has no place for
        raise StrictYamlError(0, f"not YAML: {' '.join(str(error).split())}") from None


def _too_deep(kind: Kind) -> str:
    return f"nested more than {MAX_DEPTH} deep; a {kind.name} never is"


class _Node:
    """A mapping or sequence under construction."""

    __slots__ = ("items", "key", "mapping", "path")

    def __init__(self, path: Path, mapping: bool) -> None:
        self.path = path
        self.mapping = mapping
        self.items: Any = {} if mapping else []
        self.key: str | None = None

    def value_path(self) -> Path:
        """The place of the next value."""
        return (*self.path, self.key if self.mapping and self.key is not None else len(self.items))

    def value(self) -> Any:
        """All that was added."""
        return self.items if self.mapping else tuple(self.items)

    def add(self, value: Any) -> None:
        """The value of the key that stands before it, or the next item."""
        if self.mapping:
            self.items[self.key] = value
            self.key = None
        else:
            self.items.append(value)


def _next_path(parent: _Node | None) -> Path:
    """The place of the next value."""
    return parent.value_path() if parent else ()


def _build(events: Iterator[Any], kind: Kind) -> Document:
    builder = _Builder(kind)
    for event in events:
        builder.take(event)
    if builder.root is None:
        raise StrictYamlError(0, kind.empty_text)
    return Document(builder.root, builder.lines)


class _Builder:
    """Puts a document together, event by event."""

    def __init__(self, kind: Kind) -> None:
        self.kind = kind
        self.lines: dict[Path, int] = {}
        self.root: Any = None
        self._stack: list[_Node] = []

    def take(self, event: Any) -> None:
        """Add an event; raises StrictYamlError for what is not allowed there."""
        line = event.start_mark.line + 1
        if isinstance(event, yaml.DocumentStartEvent) and self.root is not None:
            raise StrictYamlError(line, f"a second document begins here; a {self.kind.name} is one document")
        _refuse_what_unfolds(event, line)
        parent = self._stack[-1] if self._stack else None
        awaits_key = parent is not None and parent.mapping and parent.key is None
        if isinstance(event, yaml.MappingStartEvent | yaml.SequenceStartEvent):
            _check_place(awaits_key, len(self._stack), line, self.kind)
            self._stack.append(_Node(_next_path(parent), isinstance(event, yaml.MappingStartEvent)))
            self.lines.setdefault(self._stack[-1].path, line)
        elif isinstance(event, yaml.MappingEndEvent | yaml.SequenceEndEvent):
            self._put(self._stack.pop().value(), line)
        elif isinstance(event, yaml.ScalarEvent) and parent is not None and awaits_key:
            parent.key = _read_key(event, parent, self.lines, line)
        elif isinstance(event, yaml.ScalarEvent):
            value = _read_scalar(event, parent, line, self.kind)
            self.lines.setdefault(_next_path(parent), line)
            self._put(value, line)

    def _put(self, value: Any, line: int) -> None:
        """A value that is complete, where it belongs."""
        if len(self.lines) > self.kind.values:
            raise StrictYamlError(line, f"more than {self.kind.values} values; no {self.kind.name} has so many")
        if self._stack:
            self._stack[-1].add(value)
        else:
            self.root = _check_mapping(value, self.lines, self.kind)


def _check_place(awaits_key: bool, depth: int, line: int, kind: Kind) -> None:
    """Raise StrictYamlError where no list or mapping may begin."""
    if awaits_key:
        raise StrictYamlError(line, "a key must be a word, not a list or mapping")
    if depth >= MAX_DEPTH:
        raise StrictYamlError(line, _too_deep(kind))


def _refuse_what_unfolds(event: Any, line: int) -> None:
    """Raise StrictYamlError for an anchor, an alias or a tag."""
    if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
        mark = "*" if isinstance(event, yaml.AliasEvent) else "&"
        problem = f"{mark}{one_line(event.anchor)}: anchors and aliases are refused, as they can unfold"
        hint = f"write the value out, or quote text that begins with {mark}"
        raise StrictYamlError(line, f"{problem} without bound; {hint}")
    if getattr(event, "tag", None) is not None:
        problem = f"tag {one_line(event.tag)} is refused: values are plain numbers, text, lists and mappings"
        raise StrictYamlError(line, f"{problem}; remove the tag")


def _check_mapping(value: Any, lines: dict[Path, int], kind: Kind) -> dict[str, Any]:
    """The document's value, which is a mapping."""
    if isinstance(value, dict):
        return value
    kind_found = "a list" if isinstance(value, tuple) else f"only the text {one_line(str(value))}"
    problem = f"{kind_found}; a {kind.name} is a mapping: {kind.mapping}"
    raise StrictYamlError(lines[()], f"{problem} (a space follows each colon)")


def _read_key(event: Any, parent: _Node, lines: dict[Path, int], line: int) -> str:
    """A key's text, its line noted; StrictYamlError for merge keys, numbers and keys that stand twice."""
    text = str(event.value)
    if event.implicit[0]:  # plain, without quotes
        if text == "<<":
            raise StrictYamlError(line, "merge keys (<<) are refused; write the values out")
        if not text:
            raise StrictYamlError(line, "a value without a key; write key: value")
        if not isinstance(_resolve(text, line), str):
            raise StrictYamlError(line, f"key {one_line(text)} is not a word; names need a letter, or quotes")
    _check_text(text, line)
    path = (*parent.path, text)
    if text in parent.items:
        first = lines[path]
        raise StrictYamlError(line, f"key {one_line(text)} stands twice, first on line {first}; keep one")
    lines[path] = line
    return text


def _read_scalar(event: Any, parent: _Node | None, line: int, kind: Kind) -> Any:
    """The value of a scalar: text in quotes as it is, else a number, a truth or a word."""
    text = str(event.value)
    if not event.implicit[0]:  # the value is in quotes, or a block of text
        _check_text(text, line)
        return text
    if text in ("", "~", "null", "Null", "NULL"):
        if parent is None:
            raise StrictYamlError(0, kind.empty_text)
        if parent.mapping:
            raise StrictYamlError(line, f"{one_line(parent.key or '')} has no value; give one, or leave the key out")
        raise StrictYamlError(line, f"item {len(parent.items) + 1} of a list has no value; give one")
    value = _resolve(text, line)
    if isinstance(value, str):
        _check_text(text, line)
    return value


def _resolve(text: str, line: int) -> str | int | float | bool:
    """Value of a plain scalar, or the trap that it is."""
    first = text[0]
    if first.isdigit() or first in "+-.":
        return _read_number(text, line)
    word = text.lower()
    if word in ("true", "false"):
        return word == "true"
    if word in _WORDS_FOR_TRUE or word in _WORDS_FOR_FALSE:
        boolean = "true" if word in _WORDS_FOR_TRUE else "false"
        problem = f"{text} is {boolean} to some YAML readers and text to others"
        raise StrictYamlError(line, f'{problem}; write {boolean}, or "{text}" for text')
    return text


def _read_number(text: str, line: int) -> str | int | float:
    """A plain word as a number, if it is one; StrictYamlError for what may be misread."""
    if re.fullmatch(_INT, text):
        if len(text) > MAX_DIGITS:
            raise StrictYamlError(line, f"{one_line(text)} has more than {MAX_DIGITS} digits; is it a number?")
        return int(text)
    if re.fullmatch(_FLOAT, text):
        value = float(text)
        if not math.isfinite(value):
            raise StrictYamlError(line, f"{one_line(text)} is too large for a number")
        return value
    if re.fullmatch(_NOT_FINITE, text):
        raise StrictYamlError(line, f"{text} is not a finite number; write one, or leave the key out for no bound")
    _refuse_what_misleads(text, line)
    return text


def _refuse_what_misleads(text: str, line: int) -> None:
    """Raise StrictYamlError for text that YAML, or some reader of it, takes for a number or a date."""
    if re.fullmatch(_SEXAGESIMAL, text):
        raise StrictYamlError(line, _sexagesimal_text(text))
    if zeros := re.fullmatch(_LEADING_ZERO, text):
        digits = zeros[2].replace("_", "").lstrip("0")
        number_text = zeros[1] + (digits if digits[:1].isdigit() else f"0{digits}")
        problem = f"{one_line(text)} begins with 0, which YAML may read as octal"
        raise StrictYamlError(line, f"{problem}; write {one_line(number_text)}, or quotes for text")
    if re.fullmatch(_OTHER_BASE, text):
        raise StrictYamlError(line, f"{one_line(text)} is not decimal; write it in decimal, or in quotes")
    if "_" in text and re.fullmatch(_UNDERSCORE, text):
        number_text = text.replace("_", "")
        raise StrictYamlError(line, f"{one_line(text)} has underscores; write {one_line(number_text)}")
    if (near := re.fullmatch(_LIKE_FLOAT, text)) and (near[2] or near[3]):
        sign, integer, part, exponent_sign, exponent = near.groups()
        decimal_text = f"{sign.replace('+', '')}{integer or '0'}.{part or '0'}"
        if exponent:
            decimal_text += f"e{exponent_sign or '+'}{exponent}"
        problem = f"{one_line(text)} is text to YAML, not a number"
        raise StrictYamlError(line, f"{problem}; write {one_line(decimal_text)}, or quotes for text")
    if re.fullmatch(_TIMESTAMP, text):
        raise StrictYamlError(line, f'{one_line(text)} is a date to YAML; write "{text}" for text')


def _sexagesimal_text(text: str) -> str:
    parts = text.lstrip("+-").split(":")
    if len(parts) == 2 and all(part.isdigit() and len(part) < 6 for part in parts):
        first, second = int(parts[0]), int(parts[1])
        value = str(60 * first + second) if second < 60 else "text"
        motor, joint = sorted((first, second))  # a reduction, most likely
        return f"{text} is {value} to YAML; write teeth as {{motor: {motor}, joint: {joint}}}"
    return f"{one_line(text)} is a base-60 number to YAML; write a plain number, or quotes for text"


def _check_text(text: str, line: int) -> None:
    """No terminal escapes and no half characters, which quotes can smuggle in as "\\e" or "\\ud800"."""
    if text.isascii() and text.isprintable():
        return
    for character in set(text) - {"\t", "\n"}:
        if not _is_text(ord(character)) or character == "\r":
            problem = f"control character U+{ord(character):04X} in a text"
            raise StrictYamlError(line, f"{problem}; remove it")


def one_line(text: str) -> str:
    """The text as it goes into a message: one short line."""
    text = " ".join(text.split())
    return text if len(text) <= 40 else f"{text[:37]}..."
