"""The whole suite that every kind of board passes, on every kind: `armkin.board.conformance`.

    python tests/bench/bench_conformance.py [KIND ...]

KIND: one of the kinds in this process, `dynamixel` (examples/board_plugin must be installed), or `chip:BOARD` for the
compiled firmware in the emulator, such as `chip:uno_cnc_shield`. Prints the seconds of a core that a case took.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
sys.path.insert(0, str(Path(__file__).parents[1] / "firmware"))

from armkin.board import conformance
from armkin.board.conformance import Start
from emulated_kinds import EMULATED, starter_of


def all_cases_pass(kind: str, begin: Start) -> bool:
    """Run all cases, print one row each; whether all pass."""
    good = True
    for case in conformance.CASES:
        began, words = time.process_time(), "passed"
        try:
            case(begin)
        except Exception as error:
            good, words = False, f"FAILED {type(error).__name__}: {error}"
        print(f"{kind:20} {time.process_time() - began:7.1f} s  {case.__name__}: {words}", flush=True)
    return good


def main(kinds: list[str]) -> int:
    """1 if a case of a kind fails."""
    good = True
    for kind in kinds or EMULATED:
        if not kind.startswith("chip:"):
            good &= all_cases_pass(kind, starter_of(kind))
            continue
        import emulated_chips
        from emulator import EmulatedBoard

        with EmulatedBoard(kind.removeprefix("chip:"), speed="step") as board:
            good &= all_cases_pass(kind, emulated_chips.starter_of(board))
    return not good


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
