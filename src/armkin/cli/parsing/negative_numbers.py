"""The command line before it is parsed: negative numbers are arguments, not options."""

from collections.abc import Collection

_NOT_NUMBERS = ("inf", "infinity", "nan")
_SHORT_FOR = {"--assume-home": ("--assume", "home")}  # of commands that have the first of these


def options_first(args: list[str], takes_value: Collection[str]) -> list[str]:
    """Sort a command's words so that the parser cannot take ``-30`` for an option, and write out what is short.

    takes_value: options that are followed by a value, which is left as it is. Whatever begins with a
    dash and is no number stays an option, known or not, so that ``--jsn`` is still an error.

    >>> options_first(["arm.yaml", "-30", "5", "--near", "-1,2", "--json"], ["--near"])
    ['--near', '-1,2', '--json', '--', 'arm.yaml', '-30', '5']
    """
    options: list[str] = []
    words: list[str] = []
    words_left = iter(args)
    for word in words_left:
        if word == "--":
            words.extend(words_left)
        elif word[:1] != "-" or word == "-" or _looks_like_number(word):
            words.append(word)
        else:
            long_form = _SHORT_FOR.get(word, (word,))
            options.extend(long_form if long_form[0] in takes_value else (word,))
            if word in takes_value:
                value = next(words_left, None)
                if value is None:
                    return options  # the parser complains; "--" would be taken for the value
                options.append(value)
    return [*options, "--", *words] if words else options


def _looks_like_number(word: str) -> bool:
    """Whether somebody who wrote this word meant a negative number: -5, -.5, -5x, -inf."""
    body = word[1:].lower()
    pi = body == "pi" or body.startswith(("pi/", "pi*"))  # no number here, and an error that says so
    return body[:1].isdigit() or (body[:1] == "." and body[1:2].isdigit()) or body in _NOT_NUMBERS or pi
