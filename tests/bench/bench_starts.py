"""Every path sent from five other places than it starts at, on every simulated kind of board and the emulated Uno.

    python tests/bench/bench_starts.py [KIND ...] [--pins]

Prints, for each kind, how many were carried out, the tip's greatest distance from approach and path [mm], from the
path's first point [mm], and from the plan's end [counts]; --pins: by the command line on the emulated Uno, too.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import yaml

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "firmware"))

from starting_elsewhere import ELSEWHERE, EXAMPLES, KINDS, PATHS, Result, carried_out, on


def main() -> int:
    """Print the table; 1 if a path was not driven where it is."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kinds", nargs="*", default=[], metavar="KIND")
    parser.add_argument("--pins", action="store_true")
    given = parser.parse_args()
    paths = (*(yaml.safe_load(path.read_text()) for path in EXAMPLES), *PATHS)
    for moves in paths:
        moves.pop("robot", None)
    good = True
    for kind in given.kinds or ([] if given.pins else KINDS):
        one = on(kind)
        good &= told(kind, [carried_out(one, moves, place) for place in ELSEWHERE for moves in paths], one.tolerance)
    if given.pins:
        from emulator import EmulatedBoard
        from starts_on_pins import sent

        without = [{**moves, "moves": [m for m in moves["moves"] if "grip" not in m]} for moves in paths]
        with EmulatedBoard(trace=True) as board, tempfile.TemporaryDirectory() as folder:
            found = [sent(board, Path(folder), moves, place) for place in ELSEWHERE for moves in without]
        good &= told("emulated Uno", found, 0.4)
    return not good


def told(kind: str, found: list[Result], tolerance: float) -> bool:
    """Print a kind's row; whether all were driven where they are."""
    off, begins, rest = (max(getattr(one, key) for one in found) for key in ("off_mm", "begins_mm", "rest"))
    print(f"{kind:16} {len(found):4} paths  off {off:6.3f} mm  start {begins:6.3f} mm  end {rest} counts", flush=True)
    return bool(max(off, begins) < tolerance)


if __name__ == "__main__":
    sys.exit(main())
