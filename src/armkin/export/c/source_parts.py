"""Parts of the C source that are the same for all arms."""

from pathlib import Path

PARTS = Path(__file__).parent / "parts"


def part_text(name: str) -> str:
    """The text of a part, with @names@ to be filled in."""
    return (PARTS / f"{name}.c").read_text(encoding="utf-8")
