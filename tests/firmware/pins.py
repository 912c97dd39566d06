"""What the pins of the emulated board do."""

from __future__ import annotations

from emulator import CLOCK_HZ, EmulatedBoard


def net(board: EmulatedBoard) -> list[int]:
    """Net steps on the pins of X, Y, Z."""
    found = board.net()
    return [found[axis] for axis in "XYZ"]


def rests_within(board: EmulatedBoard, seconds: float) -> None:
    """The pins are still after at most so much simulated time."""
    begin = board.control("cycles")["cycle"]
    before, since = net(board), begin
    while True:
        now, at = board.control("cycles")["cycle"], net(board)
        if at != before:
            before, since = at, now
        if now - since > 0.2 * CLOCK_HZ:
            break
    assert (since - begin) / CLOCK_HZ < seconds
