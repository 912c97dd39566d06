"""Destinations of output: data to stdout or a file, messages to stderr, progress to a terminal only."""

import math
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any, Protocol, TextIO

Write = Callable[[str], object]
_COLOURS = {"note": "36", "warning": "33", "error": "31"}
_MAX_LINE = {"error": 240, "warning": 1000, "note": 1000}  # characters of a line; an error may quote a long word
TEXT = (".txt", ".json")  # endings of an answer in a file
_broken: list[str] = []  # words of the command line that have line breaks in them
_waiting: list[tuple[str, str]] | None = None  # under --json: notes and warnings so far


@contextmanager
def destination(path: str | None, content: str = "", endings: Sequence[str] = ()) -> Iterator[Write]:
    """The function that writes a command's data: to stdout ("-"), or to a file that appears whole or not at all.

    content, endings: what is written, and how the file's name may end (`file_ending`), where no option has checked it.
    """
    from armkin.errors import FileError, UsageError

    if path == "":
        raise UsageError("--out needs the name of a file")
    if path is not None and path != "-":
        from armkin import files

        with files.write_whole(path) as file:
            if endings:
                files.file_ending(path, content, endings, may_lack=True)
            yield file.write
    elif sys.stdout is None:
        raise FileError("standard output is closed; give --out FILE or open it")
    else:
        yield sys.stdout.write


def check_destination(path: str | None, content: str, *endings: str) -> None:
    """Raise before long work what `destination` would of a file's name, or that it does not end as what is written."""
    if path not in (None, "", "-"):
        from armkin import files

        files.check_writable(path)
        files.file_ending(path, content, endings, may_lack=True)


@contextmanager
def answer_stream(path: str | None) -> Iterator[Write]:
    """Where a command's answer goes while other data goes to `path`: stderr if that is stdout ("-")."""
    if path == "-" and sys.stderr is not None:
        yield sys.stderr.write
        return
    with destination(None) as write:
        yield write


def for_programs(as_json: bool, words: Iterable[str] = ()) -> None:
    """Begin a command. Under --json an error is one JSON object: notes and warnings wait, and go into it.

    words: the command line's; where a message quotes one that has line breaks in it, it stays one line.
    """
    global _waiting, _broken
    _waiting = [] if as_json else None
    parts = {part for word in words for part in (word, word.partition("=")[2])}
    _broken = sorted((part for part in parts if part.strip() and len(f"{part}.".splitlines()) > 1), key=len)[::-1]
    if (files_module := sys.modules.get("armkin.files")) is not None:  # `armkin --help` needs no files
        files_module.forget_inputs()


def warn(message: str) -> None:
    """Say something on stderr that does not change the exit code."""
    _say_or_keep("warning", message)


def note(message: str) -> None:
    """Say something on stderr that is good to know."""
    _say_or_keep("note", message)


def error(message: str, kind: str, exit_code: int, fields: Mapping[str, Any] | None = None, advice: str = "") -> None:
    """Say on stderr why the command fails; under --json as one JSON object.

    message: as people read it, with the advice in it; fields: what it is about.
    """
    message = _without_breaks(message)
    if _waiting is None:
        _print_message("error", message)
        return
    import json

    answer = {
        "error": _one_line(message, "error"),
        "kind": kind,
        "exit_code": exit_code,
        **(fields or {}),
    }
    if advice:
        answer["next"] = advice
    for word in ("warning", "note"):
        if lines := [_one_line(text, word) for kind_of_line, text in _waiting if kind_of_line == word]:
            answer[f"{word}s"] = lines
    _waiting.clear()
    _print_line(json.dumps(_plain_values(answer)))


def flush() -> None:
    """Say what has waited: the command had no error."""
    for word, message in _waiting or ():
        _print_message(word, message)
    for_programs(False)


def _one_line(message: str, word: str) -> str:
    """A message for programs; what is a line of its own for people follows a semicolon, or a sentence's end."""
    lines = [_printable_text(line.strip(), _MAX_LINE[word]) for line in message.splitlines() if line.strip()]
    text = "".join(lines[:1])
    for line in lines[1:]:
        text += f" {line}" if text[-1] in ".?!;:" else f"; {line}"
    return text


def _without_breaks(message: str) -> str:
    """A message whose quoted words have no line breaks of their own."""
    for word in _broken:
        message = message.replace(word, _printable_text(word, len(word) * 10))
    return message


def _say_or_keep(word: str, message: str) -> None:
    message = _without_breaks(message)
    if _waiting is None:
        _print_message(word, message)
    else:
        _waiting.append((word, message))


def _plain_values(value: Any) -> Any:
    """JSON has no infinity and no arrays of numpy's."""
    if isinstance(value, Mapping):
        return {str(key): _plain_values(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain_values(part) for part in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, str | int | bool | None) else str(value)


def _print_message(word: str, message: str) -> None:
    if sys.stderr is None:
        return
    head = f"\x1b[{_COLOURS[word]}m{word}:\x1b[0m" if _is_coloured(sys.stderr) else f"{word}:"
    # A file's name may hold anything: two lines of printable text, whatever it is.
    lines = [_printable_text(line, _MAX_LINE[word]) for line in message.splitlines() if line.strip()]
    text = "\n".join(f"{head} {line}" if i == 0 else f"  {line}" for i, line in enumerate(lines))
    _print_line(text)


def _print_line(text: str) -> None:
    with suppress(OSError, UnicodeError):  # nobody listens: the exit code still tells
        print(text.encode("utf-8", "backslashreplace").decode(), file=sys.stderr, flush=True)


def _printable_text(line: str, max_length: int) -> str:
    """Without control characters, which a terminal would obey, and not longer than people read."""
    text = "".join(char if char.isprintable() else char.encode("unicode_escape").decode() for char in line)
    return text if len(text) <= max_length else f"{text[: max_length - 90]} ... {text[-80:]}"


def _is_coloured(stream: TextIO) -> bool:
    return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


class Tick(Protocol):
    """How far a command has come: done, and of how many where that is known only then."""

    def __call__(self, count: int, total: int | None = None) -> None: ...


@contextmanager
def progress(task: str, total: int | Callable[[], int | None] | None = None) -> Iterator[Tick]:
    """A bar with rate and time left on stderr, or a counter without a total, if that is a terminal.

    Call it with the count so far; 0 starts the clock anew, where what came before is not the counted work.
    total: or a function that finds it out, called on a terminal alone.
    """
    if sys.stderr is None or not sys.stderr.isatty() or os.environ.get("TERM") == "dumb":
        yield lambda count, total=None: None
        return

    known_total = total() if callable(total) else total
    began = last = time.monotonic()
    shown: Any = None

    def tick(count: int, total: int | None = None) -> None:
        nonlocal began, last, shown, known_total
        known_total = total or known_total
        present = time.monotonic()
        if count == 0:
            began = last = present
        if present - last < 0.2 and count != known_total:
            return
        last = present
        if shown is None:
            from armkin.cli.printing.progress_bar import start_bar

            shown = start_bar(task)
        shown.update(count, known_total, present - began)

    try:
        yield tick
    finally:
        if shown is not None:
            shown.end()
