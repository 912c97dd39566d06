"""Every path sent from five other places than it starts at, on every simulated kind of board and the emulated Uno.

    python tests/bench/bench_starts.py [KIND ...] [--pins] [--place NUMBER ...]

Prints, for each kind and after each place, how many were carried out, the tip's greatest distance from approach and
path [mm], from the path's first point [mm], and from the plan's end [counts]; a path that cannot be driven from a
place (a line from there leaves the limits) is printed as refused. A kind takes a minute. --pins: by the command line
on the emulated Uno, too, about a quarter of an hour; --place 1 is a fifth of it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
sys.path.insert(0, str(Path(__file__).parents[1] / "firmware"))

from armkin.errors import NoSolutionError
from simulated_starts import ELSEWHERE, EXAMPLES, KINDS, PATHS, Result, carried_out, simulated_kind

NUMBERS = range(1, len(ELSEWHERE) + 1)
Paths = dict[str, dict[str, Any]]
Places = Sequence[Sequence[float]]


def main() -> int:
    """Print the table; 1 if a path was not driven where it is."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kinds", nargs="*", default=[], metavar="KIND", help=f"of {', '.join(KINDS)}")
    parser.add_argument("--pins", action="store_true")
    parser.add_argument("--place", type=int, nargs="+", choices=NUMBERS, default=NUMBERS, metavar="NUMBER")
    arguments = parser.parse_args()
    if unknown := set(arguments.kinds) - set(KINDS):
        parser.error(f"no kind {', '.join(sorted(unknown))}: there are {', '.join(KINDS)}")
    places = [ELSEWHERE[number - 1] for number in arguments.place]
    paths = {path.name: yaml.safe_load(path.read_text()) for path in EXAMPLES}
    paths |= {f"PATHS[{k}]": moves for k, moves in enumerate(PATHS)}
    for moves in paths.values():
        moves.pop("robot", None)
    good = True
    for kind in arguments.kinds or ([] if arguments.pins else KINDS):
        kind_of_board = simulated_kind(kind)
        good &= all_driven(
            kind, partial(carried_out, kind_of_board), paths, places, kind_of_board.tolerance, kind_of_board.rest
        )
    if arguments.pins:
        from emulator import EmulatedBoard
        from starts_on_pins import send_path_from

        for moves in paths.values():
            moves["moves"] = [m for m in moves["moves"] if "grip" not in m]
        with EmulatedBoard(trace=True) as board, tempfile.TemporaryDirectory() as folder:
            good &= all_driven("emulated Uno", partial(send_path_from, board, Path(folder)), paths, places, 0.4, 0)
    return not good


def all_driven(
    kind: str, send: Callable[..., Result], paths: Paths, places: Places, tolerance: float, most_rest: int
) -> bool:
    """Send every path from every place and print what was found so far; whether all were driven where they are."""
    farthest = begins = 0.0
    rest_counts = driven_count = refused = 0
    for place in places:
        for name, moves in paths.items():
            try:
                motion = send(moves, place)
            except NoSolutionError as error:
                refused += 1
                print(f"{kind:16} refused: {name} from {place}: {str(error).splitlines()[0]}", flush=True)
                continue
            driven_count += 1
            farthest, begins, rest_counts = (
                max(farthest, motion.off_mm),
                max(begins, motion.begins_mm),
                max(rest_counts, motion.rest),
            )
        so_far = f"off {farthest:6.3f} mm  start {begins:6.3f} mm  end {rest_counts} counts"
        print(f"{kind:16} {driven_count:4} driven, {refused} refused  {so_far}", flush=True)
    return max(farthest, begins) < tolerance and rest_counts <= most_rest


if __name__ == "__main__":
    sys.exit(main())
