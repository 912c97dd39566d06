"""Parts of the C source of `armkin.compile`."""

from pathlib import Path

PARTS = Path(__file__).parent / "parts"


def own_part(name: str) -> str:
    """The text of a part, with @names@ to be filled in."""
    return (PARTS / f"{name}.c").read_text(encoding="utf-8")
