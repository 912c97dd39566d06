"""Parts in C that are the same for all arms."""

from pathlib import Path

PARTS = Path(__file__).parent / "parts"


def part_text(name: str) -> str:
    """A part's text, with @names@ to be filled in."""
    return (PARTS / f"{name}.c").read_text(encoding="utf-8")
