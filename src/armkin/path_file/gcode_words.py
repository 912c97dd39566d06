"""G-code, line by line, as words: a letter and a number each."""

import re
from collections.abc import Iterator

from armkin.errors import PathFileError

_COMMENT = re.compile(r"\([^()]*\)")
_WORD = re.compile(r"([A-Z])([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))")
_CHECKSUM = re.compile(r"\*\s*([0-9]{1,3})\s*$")
_OWN_WORDS = re.compile(r"\s*(?:N\s*[0-9]+\s*)?(?:M\s*0*([0-9]+)|T\s*([0-9]+))")
_MACHINE_M = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 30, 48, 49}  # M codes of RS-274: the other words of the line stay words
_HOME = re.compile(r"\s*(?:N\s*[0-9]+\s*)?G\s*0*28(?![0-9.])")
_FLAG = re.compile(r"[A-Z](?!\s*[-+.0-9])")  # flag of G28: slicers name axes, and what is left out, without a number
_MAX_LINE = 1000  # characters, at most, of a line that is not a comment alone
_PLACE = r"([+-]?(?:[0-9]{1,15}\.?[0-9]{0,15}|\.[0-9]{1,15}))"
_FEED = r"(?:F([0-9]{1,15}(?:\.[0-9]{0,15})?) ?)?"
# most lines of slicers and of CAM programs: G0 or G1 (or neither), F, X, Y, Z, E, F
PLAIN = re.compile(rf"(?:G0?([01]) ?)?{_FEED}(?:X{_PLACE} ?)?(?:Y{_PLACE} ?)?(?:Z{_PLACE} ?)?(?:E{_PLACE} ?)?{_FEED}")

Words = tuple[tuple[str, float, str], ...]  # letter, number, as written


def line_error(name: str, line: int, text: str) -> PathFileError:
    """The error of a line of a file."""
    return PathFileError(f"{name}:{line}: {text}", file=name, line=line)


def lines(text: str, name: str) -> Iterator[tuple[int, str]]:
    """The lines that have words, each with its number, up to a second `%`. Raises PathFileError with line and word."""
    percents = 0
    for number, raw in enumerate(text.splitlines(), 1):
        if "%" in raw and raw.strip() == "%":
            percents += 1
            if percents == 2:
                return
            continue
        line = raw.split(";", 1)[0] if ";" in raw else raw
        if "(" in line or ")" in line:
            line = _COMMENT.sub(" ", line)
            if "(" in line or ")" in line:
                raise line_error(name, number, "a comment's bracket ( or ) has no partner")
        if not line or line.isspace():
            continue
        if "*" in line:
            line = _strip_checksum(line, raw, name, number)
        yield number, line


def _strip_checksum(line: str, raw: str, name: str, number: int) -> str:
    """A line without its comments and its checksum: the exclusive or of all bytes before the star, comments too."""
    checksum = _CHECKSUM.search(line)
    if checksum is None:
        raise line_error(
            name, number, f"'{line[line.index('*') :].strip()[:20]}' is no checksum: * and a number up to 255"
        )
    body, total = line[: checksum.start()], 0
    for byte in raw[: raw.split(";", 1)[0].rindex("*")].encode("utf-8", "replace"):
        total ^= byte
    if total != int(checksum[1]):
        raise line_error(name, number, f"its checksum is {total}, and it says *{checksum[1]}: the line was damaged")
    return body


def _why_no_words(line: str, dense_line: str) -> str:
    """What is wrong with a line that is more than words; dense_line: the line without its blanks."""
    index = 0
    while (word := _WORD.match(dense_line, index)) is not None:
        index = word.end()
    unread = dense_line[index:]
    if unread[0] in "#=[]" or unread[1:2] in ("#", "["):
        return f"'{unread[:20]}': expressions, parameters and macros are not known"
    near = next((part for part in line.split() if not _is_words(part)), unread)
    return f"'{near[:20]}' is no word of G-code: a letter and a number, such as X10"


def words_of(line: str, name: str, number: int) -> Words:
    """The words of a line. Raises PathFileError with line and word."""
    line = line.upper()
    own_words = _OWN_WORDS.match(line) if "M" in line else None
    if own_words is not None and own_words[1] is not None and int(own_words[1]) not in _MACHINE_M:
        # M201 X500: what follows is the M word's own; of a fan the S counts
        speed = re.search(r"\bS\s*([0-9.]+)", line[own_words.end() :])
        word = ("M", float(own_words[1]), f"M{int(own_words[1])}")
        return (word, ("S", _number(speed[1]), "S")) if speed else (word,)
    if len(line) > _MAX_LINE:
        raise line_error(name, number, f"has {len(line)} characters; a line of G-code has at most {_MAX_LINE}")
    if "28" in line and _HOME.match(line) is not None:
        line = _FLAG.sub(" ", line)
    dense_line = "".join(line.split())
    if dense_line.startswith("/"):
        raise line_error(name, number, "'/' marks a line that a machine's switch leaves out: write it or leave it out")
    pairs = _WORD.findall(dense_line)
    words = [letter + number for letter, number in pairs]
    if "".join(words) != dense_line:
        raise line_error(name, number, _why_no_words(line, dense_line))
    return tuple(
        (letter, float(number), word) for (letter, number), word in zip(pairs, words, strict=True) if letter != "N"
    )


def _is_words(text: str) -> bool:
    return re.fullmatch(f"(?:{_WORD.pattern})+", text) is not None


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 1.0
