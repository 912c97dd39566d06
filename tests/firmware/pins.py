"""What the pins of the emulated board do."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from emulator import CLOCK_HZ, EmulatedBoard


def net_steps(board: EmulatedBoard) -> list[int]:
    """Net steps on the pins of X, Y, Z."""
    net_of = board.net()
    return [net_of[axis] for axis in "XYZ"]


def at_rest(board: EmulatedBoard) -> list[int]:
    """Net steps once they have not changed for 0.15 s."""
    end = time.monotonic() + 60
    before = net_steps(board)
    while time.monotonic() < end:
        board.wait(0.15)
        counts = net_steps(board)
        if counts == before:
            return counts
        before = counts
    raise AssertionError("the arm does not come to rest")


def on_the_line(counts: Sequence[int], start: Sequence[int], end: Sequence[int]) -> bool:
    """Within two steps of the straight line between two counts."""
    far = int(np.argmax(np.abs(np.subtract(end, start))))
    share = (counts[far] - start[far]) / (end[far] - start[far])
    return 0 <= share <= 1 and all(
        abs(n - a - share * (b - a)) <= 2 for n, a, b in zip(counts, start, end, strict=True)
    )


def rests_within(board: EmulatedBoard, seconds: float) -> None:
    """The pins are still after at most so much simulated time."""
    begin = board.control("cycles")["cycle"]
    before, since = net_steps(board), begin
    while True:
        cycle, counts = board.control("cycles")["cycle"], net_steps(board)
        if counts != before:
            before, since = counts, cycle
        if cycle - since > 0.2 * CLOCK_HZ:
            break
    assert (since - begin) / CLOCK_HZ < seconds
