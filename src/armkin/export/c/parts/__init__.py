"""Parts in C that are the same for all arms."""

from pathlib import Path


def part(name: str) -> str:
    """A part's text, with @names@ to be filled in."""
    return (Path(__file__).parent / f"{name}.c").read_text(encoding="utf-8")
