"""Our firmware on the emulated chips, as the suite that every kind of board passes starts it."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

from emulator import EmulatedBoard
from stepped_port import SteppedPort

from armkin.board.conformance import Emulated, Start
from armkin.board.firmware.configuration import configure
from armkin.board.kinds import board_of
from armkin.model.build_arm import arm_of_file
from armkin.robot_file import parse_robot_file
from other_programs import OURS
from simulated_starts import KINDS


def starter_of(board: EmulatedBoard) -> Start:
    """Every emulator is the same chip after a power-on."""

    def begin() -> Emulated:
        board.control("reset power")
        board.run(0.05)
        kind = board_of(arm_of_file(parse_robot_file(KINDS[board.board])))
        port = SteppedPort(board)
        base = list(board.net().values())
        axes = configure(kind.arm).axes

        def pins() -> Sequence[float]:
            counts = list(board.net().values())
            return [counts[axis] - base[axis] for axis in axes]

        resets = random.Random(1)

        def reset() -> None:
            board.control(f"reset {resets.choice(['external', 'watchdog', 'power'])}")

        def says(data: bytes) -> Callable[[], None]:
            return lambda: port.write(data)

        return Emulated(kind, port, pins, reset=reset, foreign=[says(data) for data in OURS])

    return begin
